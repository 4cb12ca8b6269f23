#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/kernels/estimates.h"
#include "core/kernels/modal/modal_form.h"
#include "core/lanes.h"
#include "core/laws/law.h"

namespace ressort::kernels {
namespace {

// The rows along the modes: places, other rows, and outputs.
struct Rows {
  double places = 0.0;
  double heard = 0.0;
  double pushed = 0.0;
};

// Returns the work of free motion, in which a block is one sum.
Work modal_work(double modes, const Rows& rows, const Workload& load) {
  constexpr double most_rows = 8.0;  // of one sweep
  const double held = rows.places + rows.pushed;
  Work work;
  work.add(Item::modal_moving_sample, load.moving)
      .add(Item::modal_moving_mode, load.moving * modes)
      .add(Item::modal_line, lines_of(bytes_of_number(load) * modes * (6.0 + held + rows.heard)));
  if (rows.places == 0.0) {
    return work.add(Item::modal_sample, 1.0)
        .add(Item::modal_mode, modes)
        .add(Item::modal_heard, rows.heard)
        .add(Item::modal_output, modes * rows.heard)
        .add(Item::modal_push, modes * rows.pushed);
  }
  return work.add(Item::modal_held_sample, 1.0)
      .add(Item::modal_place, rows.places)
      .add(Item::modal_heard, rows.heard)
      .add(Item::modal_held_output, modes * rows.heard)
      .add(held > most_rows ? Item::modal_wide_mode : Item::modal_held_mode, modes)
      .add(held > most_rows ? Item::modal_wide_row : Item::modal_row, modes * held);
}

double passive_count(const Program& program) {
  double links = 0.0;
  for (const LinkRun& run : program.link_runs) {
    links += run.scheme == Scheme::plain ? 0.0 : run.count;
  }
  return links;
}

// Returns the work of passive links. They are coupled through the modes and solved together,
// directly if their laws are linear where they act. Their forces are added to all modes in the next
// sweep, or for four places at a time. A plectrum acts half of the time, so it counts by half.
void add_solving(const Program& program, double modes, double places, Work& work) {
  constexpr double of_a_straight_link = 28.0;
  constexpr double of_a_link = 110.0;
  constexpr double rows_of_a_sweep = 8.0;
  const double links = passive_count(program);
  double sum = 0.0;
  for (const LinkRun& run : program.link_runs) {
    const LawFacts& law = facts_of(run.law);
    const double each = links == 1.0             ? 1.5 * law.solve_ns
                        : law.is_straight        ? of_a_straight_link
                        : law.zone == Zone::near ? 0.5 * of_a_link
                                                 : of_a_link;
    sum += run.scheme == Scheme::plain ? 0.0 : run.count * each;
  }
  const double shoves = links > 0.0 && places > rows_of_a_sweep ? std::ceil(places / 4.0) : 0.0;
  work.add(Item::modal_passive, sum).add(Item::modal_passive_mode, shoves * modes);
}

std::size_t force_count(const Modes& form) {
  return static_cast<std::size_t>(
      std::count_if(form.outputs.begin(), form.outputs.end(),
                    [](const ModalOutput& output) { return output.is_force; }));
}

std::string in_db(double share) {
  char text[32];
  std::snprintf(text, sizeof text, "%.0f dB", 20.0 * std::log10(std::max(share, 1e-15)));
  return text;
}

}  // namespace

Work work(const Program& program, const Modes& form, const Workload& load) {
  // An output that is a force has two rows, and is computed sample by sample.
  const auto places = static_cast<double>(form.places.size());
  const Rows rows{.places = places + static_cast<double>(2 * force_count(form)),
                  .heard = static_cast<double>(form.outputs.size()),
                  .pushed = static_cast<double>(form.pushes.size())};
  const double modes = (form.is_crossed ? 2.0 : 1.0) * form.modes;
  Work work = modal_work(modes, rows, load);
  add_solving(program, modes, places, work);
  return load.voices * work;
}

double least_modal_ns(const Program& program, const Workload& load) {
  const LinkCount links = links_of(program);
  // Two links at one mass share its place, so each counts as half of one.
  const double places = 0.5 * (links.bent + links.others + passive_count(program));
  const Rows rows{.places = places, .heard = static_cast<double>(program.outputs.size())};
  Work work = modal_work(program.moving, rows, load);
  add_solving(program, program.moving, places, work);
  return load.voices * cost(work, load);
}

std::string description(const Program&, const Modes& form) {
  std::string text = count_of(form.modes, "mode", "modes");
  if (form.modes < form.of) {
    text = std::to_string(form.modes) + " of " + count_of(form.of, "mode", "modes") +
           ", the rest at most " + in_db(form.left_out) + ",";
  }
  text += form.is_crossed ? " of crossed damping in place of the masses, "
                          : " in place of the masses, ";
  if (form.is_exact) {
    text += "true to the continuous network, ";
  }
  text += count_of(form.places.size(), "place", "places") + " where links hold on";
  if (form.silence > 0.0) {
    text += ", asleep when all that sleep are below " + in_db(form.silence);
  }
  return text;
}

std::uint64_t voice_bytes(const Program& program, const Modes& form, std::uint64_t number_bytes) {
  const std::uint64_t rows =
      18 + form.places.size() + form.outputs.size() + form.pushes.size() + 2 * force_count(form);
  std::uint64_t factors = 0;
  for (const auto* shares : {&form.stiffness, &form.damping}) {
    for (const ModalShare& share : *shares) {
      factors += share.factor.size() + widest_bytes / number_bytes;
    }
  }
  const std::uint64_t crossed = form.is_crossed ? 6 + rows + 4 * form.places.size() : 0;
  return node_bytes(program, number_bytes) +
         number_bytes * ((rows + crossed) * form.modes + factors);
}

}  // namespace ressort::kernels
