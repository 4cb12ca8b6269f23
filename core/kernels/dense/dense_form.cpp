#include "core/kernels/dense/dense_form.h"

#include <algorithm>

#include "core/kernels/dense/dense.h"
#include "core/laws/laws.h"

namespace ressort::kernels {
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
Work work(const Program& program, const Dense& form, const Workload& load) {
  const double n = program.moving;
  const double voices = load.voices;
  Work work;
  if (form.ports.empty()) {
    return work.add(Item::dense_voice, voices)
        .add(Item::dense_mass, voices * n)
        .add(Item::dense_signal,
             voices * static_cast<double>(program.inputs.size() * program.outputs.size()));
  }
  const double stride = load.is_double ? 4.0 * std::ceil(n / 4.0) : 2.0 * std::ceil(n / 2.0);
  n <= 4.0 ? work.add(Item::dense_small_contact, voices)
           : work.add(Item::dense_contact, voices).add(Item::dense_stride, voices * stride);
  const double more = voices * static_cast<double>(form.ports.size() - 1);
  return n <= 4.0 ? work.add(Item::dense_small_link, more)
                  : work.add(Item::dense_link, more).add(Item::dense_link_mass, more * n);
}

std::string description(const Program&, const Dense& form) {
  return form.ports.empty() ? "blocks of samples by one matrix"
                            : "blocks of samples by one matrix between contacts, " +
                                  count_of(form.ports.size(), "link", "links") + " one by one";
}

std::uint64_t voice_bytes(const Program& program, const Dense&, std::uint64_t number_bytes) {
  return bytes_with_own_links(program, program.ends.size(), number_bytes);
}

}  // namespace ressort::kernels
