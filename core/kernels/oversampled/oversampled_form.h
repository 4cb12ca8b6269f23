// core/kernels: the tables of a Program that is stepped several times per sample.
#pragma once

#include <memory>

#include "core/kernels/program.h"

namespace ressort::kernels {

struct Workload;

// A Program stepped `times` times per sample, in the form that `fine` has.
struct Oversampled {
  std::shared_ptr<const Program> fine;    // the same at `times` the rate
  std::shared_ptr<const Program> coarse;  // the same in that form, for low keys; null: none
  std::uint32_t times = 1;
};

inline constexpr std::uint32_t most_oversampling = 64;

// Returns the Program at `times` the rate, in the direct form.
Program oversampled_program(const Program& program, std::uint32_t times);

// Makes the tables from such a Program, which keeps its form. `by_key`: only the stability of high
// keys needs the steps, so that a voice whose stiffness is stable at one step takes one.
Oversampled oversampled_form(Program fine, std::uint32_t times, bool by_key = false);

double operations(const Program& program, const Oversampled& form, const Workload& load);
std::string description(const Program& program, const Oversampled& form);
std::uint64_t voice_bytes(const Program& program, const Oversampled& form,
                          std::uint64_t number_bytes);

}  // namespace ressort::kernels
