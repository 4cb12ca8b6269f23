// app: what a kernel costs on this machine, now.
#pragma once

#include "core/compile/compile.h"

namespace ressort {

// Fills Part::measured_ns: each part's kernels for all voices, at rest and undisturbed, the fastest
// of a few blocks. Takes a few milliseconds in all. [any thread but audio]
void measure(Plan& plan, const Engine& engine, const CompileOptions& options, int voices);

}  // namespace ressort
