// bench: the machine's peak arithmetic rate, measured, and the arithmetic of a form.
#pragma once

#include <optional>

#include "core/kernels/isa.h"
#include "core/kernels/program.h"
#include "tests/support/rooms.h"

namespace ressort::bench {

// Measures the multiply-adds per ns of one core on registers; without FMA, pairs of a
// multiplication and an addition.
double multiply_adds_per_ns(Isa isa, bool is_double);

// Returns the multiply-adds of the form for a sample of one voice if nothing touches, without
// memory accesses. Nothing for forms whose count is not known.
std::optional<double> multiply_adds(const Program& program);

}  // namespace ressort::bench
