// bench: what the machine could do at most, measured, and what a form asks of it.
#pragma once

#include <optional>

#include "core/kernels/isa.h"
#include "core/kernels/program.h"
#include "tests/support/rooms.h"

namespace ressort::bench {

// Multiply-adds (or, without FMA, multiplications with additions) of one core in a nanosecond, from
// registers.
double multiply_adds_per_ns(Isa isa, bool is_double);

// What the form's arithmetic takes for a sample of one voice when nothing touches, whatever it
// costs to fetch the numbers. Nothing where the form does not say.
std::optional<double> multiply_adds(const Program& program);

}  // namespace ressort::bench
