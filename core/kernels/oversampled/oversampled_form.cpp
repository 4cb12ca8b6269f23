#include "core/kernels/oversampled/oversampled_form.h"

#include <utility>

#include "core/kernels/estimates.h"
#include "core/kernels/registry.h"

namespace ressort::kernels {

Program oversampled_program(const Program& program, std::uint32_t times) {
  Program fine = program;
  fine.form = Form();
  fine.rate_hz *= times;
  fine.rate_ratio /= times;
  for (double& velocity : fine.velocity) {
    velocity /= times;
  }
  return fine;
}

Oversampled oversampled_form(Program fine, std::uint32_t times) {
  return {.fine = std::make_shared<const Program>(std::move(fine)), .times = times};
}

double operations(const Program& program, const Oversampled& form, const Workload& load) {
  const double driven = static_cast<double>(program.inputs.size() + program.outputs.size());
  return form.times * (operations(*form.fine, load) + 4.0 + 2.0 * driven * packs_of(load));
}

std::string description(const Program&, const Oversampled& form) {
  return std::to_string(form.times) + " steps a sample: " + description(*form.fine);
}

std::uint64_t voice_bytes(const Program& program, const Oversampled& form,
                          std::uint64_t number_bytes) {
  constexpr std::uint64_t numbers_of_coefficient = 3;  // beside those of the finer Program's kernel
  return voice_bytes(*form.fine, number_bytes) +
         number_bytes * numbers_of_coefficient * program.coefficients.size();
}

}  // namespace ressort::kernels
