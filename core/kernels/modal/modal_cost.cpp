#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/kernels/modal/modal_form.h"
#include "core/lanes.h"
#include "core/laws/laws.h"

namespace ressort {
namespace {

// What most of a mode's sums take.
double mode_ns(const Workload& load) {
  const double wide = load.isa == Isa::v4 ? 0.85 : load.isa == Isa::v3 ? 1.0 : 2.4;
  return wide * (load.is_double ? 1.0 : 0.5);
}

// Parameters are still most of the time, so that a moving one counts by half; without that no mesh
// whose stiffness can be turned would ever be stepped by its modes.
double modal_ns(double modes, double places, double heard, double pushed, const Workload& load) {
  const double each = mode_ns(load) * modes;
  const double rows = places + pushed;
  const double slope = rows > 8.0 ? 0.23 : 0.09;
  const double bound = 25.0 + 5.0 * places + each * (0.30 + slope * rows);
  const double moving = 0.5 * (bound + 0.45 * each);
  const double still = places > 0.0 ? bound : 6.0 + each * (0.11 + 0.04 * heard + 0.045 * pushed);
  return std::max(still, moving);
}

double passive_count(const Program& program) {
  double links = 0.0;
  for (const LinkRun& run : program.link_runs) {
    links += run.scheme == Scheme::plain ? 0.0 : run.count;
  }
  return links;
}

// Through the modes each passive link pulls at all others: several are solved together, at once if
// they are straight where they act. What they push with is added to all modes along the next sweep,
// if that has room, or four places at a time. A pick passes, so that it counts by half.
double solving_ns(const Program& program, double modes, double places, const Workload& load) {
  constexpr double of_a_straight_link = 28.0;
  constexpr double of_a_link = 110.0;
  constexpr double rows_of_a_sweep = 8.0;
  const double links = passive_count(program);
  double sum = 0.0;
  for (const LinkRun& run : program.link_runs) {
    const LawFacts& law = facts_of(run.law);
    const double each = links == 1.0                  ? 1.5 * law.solve_ns
                        : law.is_straight             ? of_a_straight_link
                        : law.family == Family::pluck ? 0.5 * of_a_link
                                                      : of_a_link;
    sum += run.scheme == Scheme::plain ? 0.0 : run.count * each;
  }
  const double shoves =
      links > 0.0 && places > rows_of_a_sweep ? 0.2 * std::ceil(places / 4.0) : 0.0;
  return sum + shoves * mode_ns(load) * modes;
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

double predicted_ns(const Program& program, const Modes& form, const Workload& load) {
  // A force is heard along two rows of its own, sample by sample, as places are.
  const auto rows = static_cast<double>(form.places.size() + 2 * force_count(form));
  const double modes = (form.is_crossed ? 2.0 : 1.0) * form.modes;
  return load.voices * (solving_ns(program, modes, static_cast<double>(form.places.size()), load) +
                        modal_ns(modes, rows, static_cast<double>(form.outputs.size()),
                                 static_cast<double>(form.pushes.size()), load));
}

double least_modal_ns(const Program& program, const Workload& load) {
  const LinkCount links = links_of(program);
  // Two links at one mass share its place, so each is counted as half of one.
  const double places = 0.5 * (links.bent + links.others + passive_count(program));
  return load.voices *
         (solving_ns(program, program.moving, places, load) +
          modal_ns(program.moving, places, static_cast<double>(program.outputs.size()), 0.0, load));
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

}  // namespace ressort
