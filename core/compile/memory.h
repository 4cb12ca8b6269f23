// core/compile: how much memory an instrument takes.
#pragma once

#include <cstdint>

#include "core/engine/engine.h"

namespace ressort {

// About as many bytes as an engine of this machine, in its forms, takes with so many voices; within
// a factor of two where that is much. O(parts). [any thread]
std::uint64_t engine_bytes(const Machine& machine, int voices, Precision precision);

}  // namespace ressort
