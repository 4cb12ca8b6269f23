#include "core/kernels/dense/dense_form.h"

#include <algorithm>

#include "core/kernels/dense/dense.h"
#include "core/laws/laws.h"

namespace ressort {
namespace {

bool is_driven(const Program& program, std::uint32_t node) {
  return std::any_of(program.inputs.begin(), program.inputs.end(),
                     [&](const InputSlot& input) { return !input.is_force && input.node == node; });
}

// Whether a spring to it pulls although everything else is at 0.
bool pulls(const Program& program, std::uint32_t node) {
  return node >= program.moving && !is_driven(program, node) &&
         (program.position[node] != 0.0 || program.velocity[node] != 0.0);
}

bool fits(const Program& program) {
  return program.moving > 0 && program.moving <= most_dense_masses && program.taps.empty() &&
         program.audio_coefficients.empty() && !program.outputs.empty() &&
         std::all_of(program.outputs.begin(), program.outputs.end(), [&](const OutputSlot& output) {
           return !output.is_force && output.node < program.moving;
         });
}

}  // namespace

std::optional<Dense> dense_form(const Program& program) {
  if (!is_plain(program) || !fits(program)) {
    return std::nullopt;
  }
  Dense form;
  form.has_constant = std::any_of(program.mass_runs.begin(), program.mass_runs.end(),
                                  [](const MassRun& run) { return run.has_gravity; });
  for (std::uint32_t r = 0; r < program.link_runs.size(); ++r) {
    const LinkRun& run = program.link_runs[r];
    for (std::uint32_t link = run.first; link < run.first + run.count; ++link) {
      const auto [a, b] = program.ends[link];
      if (a == b || (a >= program.moving && b >= program.moving)) {
        continue;  // moves nothing
      }
      if (run.law != Law::spring) {
        form.ports.push_back({r, link});
        continue;
      }
      form.springs.push_back({a, b, run.coefficients[0], run.coefficients[1]});
      form.has_constant |= pulls(program, a) || pulls(program, b);
    }
  }
  return form;
}

// A force that sounds all the time costs more than the body; a body in contact is stepped sample by
// sample.
double predicted_ns(const Program& program, const Dense& form, const Workload& load) {
  const double n = program.moving;
  const double slow = is_wide(load) ? 1.0 : 1.8;
  const double half = load.is_double ? 1.0 : 0.6;
  const double signals = static_cast<double>(program.inputs.size() * program.outputs.size());
  if (form.ports.empty()) {
    return load.voices * slow * (0.95 + half * 0.12 * n + 3.0 * signals);
  }
  const double stride = load.is_double ? 4.0 * std::ceil(n / 4.0) : 2.0 * std::ceil(n / 2.0);
  const double one = n <= 4.0 ? 8.0 : load.is_double ? 2.8 * stride - 5.7 : 1.3 * stride + 2.0;
  return load.voices * slow * (one + 5.0 * static_cast<double>(form.ports.size() - 1));
}

std::string description(const Program&, const Dense& form) {
  return form.ports.empty() ? "blocks of samples by one matrix"
                            : "blocks of samples by one matrix between contacts, " +
                                  count_of(form.ports.size(), "link", "links") + " one by one";
}

std::uint64_t voice_bytes(const Program& program, const Dense&, std::uint64_t number_bytes) {
  return bytes_with_own_links(program, program.ends.size(), number_bytes);
}

}  // namespace ressort
