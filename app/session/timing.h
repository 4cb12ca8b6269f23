// app/session: measured and predicted cost of a plan.
#pragma once

#include <string>

#include "app/rooms.h"
#include "core/compile/compile.h"

namespace ressort::session {

// Measures the cost of each part at rest with all voices, and sets Part::measured_ns to the fastest
// of a few blocks. Takes a few milliseconds in all. [any thread but audio]
void measure(Plan& plan, const Engine& engine, const CompileOptions& options, int voices);

// Returns a warning if one core is too slow for all voices with all contacts closed; empty if it is
// fast enough. [any thread but audio]
std::string overload_warning(const Plan& plan, int voices, double rate_hz, Precision precision);

// Returns ways to lower the load: "-p 3, a lower rate, ...". `voices`: how many fit; 0: none.
std::string ways_to_lower_load(int voices, Precision precision);

}  // namespace ressort::session
