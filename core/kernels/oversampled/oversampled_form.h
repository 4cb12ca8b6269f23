// core/kernels: a Program stepped several times a sample, and its tables.
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

inline constexpr std::uint32_t most_oversampling = 32;

// The same numbers at `times` the rate, in the direct form.
Program oversampled_program(const Program& program, std::uint32_t times);

// Stepped so many times a sample in the form that the finer Program has.
Oversampled oversampled_form(Program fine, std::uint32_t times);

double predicted_ns(const Program& program, const Oversampled& form, const Workload& load);
std::string description(const Program& program, const Oversampled& form);
std::uint64_t voice_bytes(const Program& program, const Oversampled& form,
                          std::uint64_t number_bytes);

}  // namespace ressort::kernels
