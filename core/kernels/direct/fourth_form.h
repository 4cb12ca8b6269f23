// core/kernels: whether a Program may be stepped to fourth order.
#pragma once

#include <optional>
#include <span>

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"

namespace ressort::kernels {

// The largest stiffness and damping that a mode can have, per sample and mass, by the edge bound;
// every link counts by its spring and damper, with the parameters as they start or as given.
struct Steepness {
  double stiffness = 0.0;  // K/M
  double damping = 0.0;    // Z/M
  double both = 0.0;       // (K + 6Z)/M
};
Steepness steepness_of(const Program& program);
Steepness steepness_of(const Program& program, std::span<const double> parameters);

// Nothing where nothing moves; where K + 6Z reaches 12M by the edge bound: a mode is pushed out
// instead of in as soon as it does; where a link is not of the plain scheme; where a force is heard
// beside points; with bodies, whose modes need no order. What is stable as published is so in this
// form. O(links). [any thread but audio]
std::optional<Fourth> fourth_form(const Program& program);

// What the registry's row of it asks, of one voice in bytes.
double predicted_ns(const Program& program, const Fourth& form, const Workload& load);
std::string description(const Program& program, const Fourth& form);
std::uint64_t voice_bytes(const Program& program, const Fourth& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
