// core/kernels: the tables of a Program that is stepped several times per sample.
#pragma once

#include <memory>

#include "core/kernels/program.h"

namespace ressort::kernels {

struct Workload;

// A Program stepped `times` times per sample, in the form that `fine` has.
struct Oversampled {
  std::shared_ptr<const Program> fine;  // the same at `times` the rate
  std::uint32_t times = 1;
};

inline constexpr std::uint32_t most_oversampling = 64;

// Returns the Program at `times` the rate, in the direct form.
Program oversampled_program(const Program& program, std::uint32_t times);

// Makes the tables from such a Program, which keeps its form.
Oversampled oversampled_form(Program fine, std::uint32_t times);

double operations(const Program& program, const Oversampled& form, const Workload& load);
std::string description(const Program& program, const Oversampled& form);
std::uint64_t voice_bytes(const Program& program, const Oversampled& form,
                          std::uint64_t number_bytes);

}  // namespace ressort::kernels
