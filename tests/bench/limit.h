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

// Returns the multiply-adds of the form for one sample of one voice without contacts, not counting
// memory accesses. Returns nothing for forms whose count is unknown.
std::optional<double> multiply_adds(const Program& program);

}  // namespace ressort::bench
