// app/session: the cost of a plan on this machine.
#pragma once

#include <functional>
#include <string>

#include "app/rooms.h"
#include "core/compile/compile.h"

namespace ressort::session {

// Returns the CPU time of this thread.
double thread_cpu_ns();

// Measures CPU time of this thread, with denormals flushed: Timings::time on this machine.
double cpu_time_ns(const Program& program, const std::function<void()>& play);

// Sets Part::measured_ns of the plan of a playing engine, by known_ns(): a few milliseconds for
// each part that was not measured before. [any thread but audio]
void measure(Plan& plan, const Engine& engine, const CompileOptions& options, int voices,
             const Timings& timings);

// Returns a warning if one core is too slow for all voices as they are played; empty if it is fast
// enough. An estimate counts contacts as closed all the time, so a plan that it finds too dear is
// measured. [any thread but audio]
std::string overload_warning(const Compiled& compiled, const CompileOptions& options,
                             const Timings& timings);

// Returns ways to lower the load: "-p 3, a lower rate, ...". `voices`: how many fit; 0: none.
std::string ways_to_lower_load(int voices, Precision precision);

}  // namespace ressort::session
