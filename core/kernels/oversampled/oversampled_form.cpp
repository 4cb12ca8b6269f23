#include "core/kernels/oversampled/oversampled_form.h"

#include <utility>

#include "core/kernels/estimates.h"
#include "core/kernels/registry.h"

namespace ressort::kernels {

namespace {

Program at_rate(Program program, double times) {
  program.rate_hz *= times;
  program.rate_ratio /= times;
  for (double& velocity : program.velocity) {
    velocity /= times;
  }
  return program;
}

}  // namespace

Program oversampled_program(const Program& program, std::uint32_t times) {
  Program fine = at_rate(program, times);
  fine.form = Form();
  return fine;
}

Oversampled oversampled_form(Program fine, std::uint32_t times, bool by_key) {
  Oversampled form{.times = times};
  if (by_key) {
    form.coarse = std::make_shared<const Program>(at_rate(fine, 1.0 / times));
  }
  form.fine = std::make_shared<const Program>(std::move(fine));
  return form;
}

double operations(const Program& program, const Oversampled& form, const Workload& load) {
  const double driven = static_cast<double>(program.inputs.size() + program.outputs.size());
  return form.times * (operations(*form.fine, load) + 4.0 + 2.0 * driven * packs_of(load));
}

std::string description(const Program&, const Oversampled& form) {
  return std::string(form.coarse ? "low keys 1, high keys " : "") + std::to_string(form.times) +
         " steps a sample: " + description(*form.fine);
}

std::uint64_t voice_bytes(const Program& program, const Oversampled& form,
                          std::uint64_t number_bytes) {
  constexpr std::uint64_t numbers_of_coefficient = 3;  // beside those of the finer Program's kernel
  return (form.coarse ? 2 : 1) * voice_bytes(*form.fine, number_bytes) +
         number_bytes * numbers_of_coefficient * program.coefficients.size();
}

}  // namespace ressort::kernels
