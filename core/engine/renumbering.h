// core/engine: whether a running engine can continue with other numbers in its model.
#pragma once

#include "core/kernels/program.h"

namespace ressort::engine {

// Returns whether an engine of one Machine can be renumbered to the other: they differ in
// coefficient values, initial velocities and forms only, and all values between the two are stable.
// [any thread]
bool can_renumber(const Machine& from, const Machine& to);

}  // namespace ressort::engine
