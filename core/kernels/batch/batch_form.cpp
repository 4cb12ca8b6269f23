#include "core/kernels/batch/batch_form.h"
#include "core/kernels/estimates.h"
#include "core/laws/law.h"

#include <algorithm>

namespace ressort::kernels {
namespace {

// Stores the link in `batch` if it is a spring between masses in registers; returns whether it is.
bool hold_spring(const Program& program, const LinkRun& run, Ends ends, Batch& batch) {
  const auto [a, b] = std::minmax(ends.a, ends.b);
  if (!is_linear(run.law) || a >= program.moving || a == b) {
    return false;
  }
  const bool is_pair = b < program.moving;
  BatchSpring& place = is_pair ? batch.pairs[b * (b - 1) / 2 + a] : batch.anchors[a];
  if (place.stiffness != BatchSpring::none) {
    return false;
  }
  place = {.stiffness = run.coefficients[0],
           .damping = run.coefficients[1],
           .node = is_pair ? BatchSpring::none : b};
  return true;
}

void hold_links(const Program& program, Batch& batch) {
  for (std::uint32_t run = 0; run < program.link_runs.size(); ++run) {
    const LinkRun& links = program.link_runs[run];
    if (links.scheme != Scheme::plain) {
      continue;
    }
    for (std::uint32_t i = links.first; i < links.first + links.count; ++i) {
      const Ends ends = program.ends[i];
      if (!hold_spring(program, links, ends, batch)) {
        batch.links.push_back({run, ends.a, ends.b});
      }
    }
  }
}

}  // namespace

std::optional<Batch> batch_form(const Program& program) {
  const auto is_force = [](const OutputSlot& output) { return output.is_force; };
  if (program.moving == 0 || program.moving > most_batch_masses || !program.taps.empty() ||
      std::any_of(program.outputs.begin(), program.outputs.end(), is_force)) {
    return std::nullopt;
  }
  Batch batch;
  if (program.moving <= most_held_masses) {
    hold_links(program, batch);
  }
  return batch;
}

// A single pack has to wait for its own last result, so its operations count about twice. Networks
// of more than most_held_masses masses are stepped in memory.
double operations(const Program& program, const Batch&, const Workload& load) {
  const LinkCount links = links_of(program);
  const double others = links.bent + links.others;
  const double packs = packs_of(load);
  const double passive = packs * passive_operations(program);
  if (program.moving > most_held_masses) {
    const double steps = program.moving + links.springs + others;
    return passive + 16.0 + 2.0 * steps + packs * (5.0 * steps + 10.0 * others);
  }
  if (packs <= 1.0) {
    return passive + 24.0 + 8.0 * program.moving + 22.0 * others;
  }
  return passive + 16.0 + packs * (3.5 * (program.moving + links.springs) + 12.0 * others);
}

std::string description(const Program& program, const Batch&) {
  return std::string(program.moving <= most_held_masses ? "masses in registers"
                                                        : "mass by mass and link by link") +
         ", one voice per lane, many packs at once";
}

std::uint64_t voice_bytes(const Program& program, const Batch&, std::uint64_t number_bytes) {
  return bytes_with_shared_links(program, number_bytes);
}

}  // namespace ressort::kernels
