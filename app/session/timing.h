// app/session: what a kernel costs on this machine, now, and what a plan costs at most.
#pragma once

#include <string>

#include "app/rooms.h"
#include "core/compile/compile.h"

namespace ressort::session {

// Fills Part::measured_ns: each part's kernels for all voices, at rest and undisturbed, the fastest
// of a few blocks. Takes a few milliseconds in all. [any thread but audio]
void measure(Plan& plan, const Engine& engine, const CompileOptions& options, int voices);

// What to say of a plan for which one core has no time while all voices sound and everything
// touches; empty where there is enough. [any thread but audio]
std::string too_much(const Plan& plan, int voices, double rate_hz, Precision precision);

// What makes room for the sound, fewer voices if so many fit: "-p 3, a lower rate, ...".
std::string ways_to_make_room(int voices, Precision precision);

}  // namespace ressort::session
