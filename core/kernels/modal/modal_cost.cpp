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

// Counts per voice. Modes that no link holds are stepped for a whole block at once. Held ones are
// swept once a sample, with all their rows.
double modal_operations(double modes, const Rows& rows, const Workload& load) {
  constexpr double most_rows = 8.0;  // rows that are summed in one sweep
  const double lanes = static_cast<double>(vector_bytes(load.isa)) / bytes_of_number(load);
  const double packs = modes / lanes;
  const double held = rows.places + rows.pushed;
  double count = load.moving * (64.0 + 5.0 * packs) +
                 2.0 * lines_of(bytes_of_number(load) * modes * (6.0 + held + rows.heard)) +
                 5.0 * rows.heard;
  if (rows.places == 0.0) {
    return count + 17.0 + packs * (1.0 + 0.5 * rows.heard + 2.0 * rows.pushed);
  }
  count += 85.0 + 15.0 * rows.places + packs * rows.heard;
  return count + packs * (held > most_rows ? 4.0 * held : 2.5 + 1.5 * held);
}

double passive_count(const Program& program) {
  double links = 0.0;
  for (const LinkRun& run : program.link_runs) {
    links += run.scheme == Scheme::plain ? 0.0 : run.count;
  }
  return links;
}

// Through the modes each passive link acts on all others. Several are solved together, directly if
// they are straight where they act. Their forces are added to all modes during the next sweep if it
// has room, or four places at a time. A pick acts only for a moment, so it counts half.
double solving_operations(const Program& program, double packs, double places) {
  constexpr double of_a_straight_link = 110.0;
  constexpr double of_a_link = 440.0;
  constexpr double rows_of_a_sweep = 8.0;
  const double links = passive_count(program);
  double sum = 0.0;
  for (const LinkRun& run : program.link_runs) {
    const LawFacts& law = facts_of(run.law);
    const double each = links == 1.0             ? std::min(1.5 * law.solve_operations, of_a_link)
                        : law.is_straight        ? of_a_straight_link
                        : law.zone == Zone::near ? 0.5 * of_a_link
                                                 : of_a_link;
    sum += run.scheme == Scheme::plain ? 0.0 : run.count * each;
  }
  const double sweeps = links > 0.0 && places > rows_of_a_sweep ? std::ceil(places / 4.0) : 0.0;
  return sum + 4.0 * sweeps * packs;
}

double all_operations(const Program& program, double modes, const Rows& rows, double places,
                      const Workload& load) {
  const double lanes = static_cast<double>(vector_bytes(load.isa)) / bytes_of_number(load);
  return load.voices *
         (modal_operations(modes, rows, load) + solving_operations(program, modes / lanes, places));
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

double operations(const Program& program, const Modes& form, const Workload& load) {
  // A force output needs two more rows, computed in every sample, as those of places are.
  const auto places = static_cast<double>(form.places.size());
  const Rows rows{.places = places + static_cast<double>(2 * force_count(form)),
                  .heard = static_cast<double>(form.outputs.size()),
                  .pushed = static_cast<double>(form.pushes.size())};
  return all_operations(program, (form.is_crossed ? 2.0 : 1.0) * form.modes, rows, places, load);
}

double least_modal_operations(const Program& program, const Workload& load) {
  const LinkCount links = links_of(program);
  // Two links at one mass share its place, so each counts as half of one.
  const double places = 0.5 * (links.bent + links.others + passive_count(program));
  const Rows rows{.places = places, .heard = static_cast<double>(program.outputs.size())};
  return all_operations(program, program.moving, rows, places, load);
}

std::string description(const Program&, const Modes& form) {
  std::string text = count_of(form.modes, "mode", "modes");
  if (form.modes < form.of) {
    text = std::to_string(form.modes) + " of " + count_of(form.of, "mode", "modes") +
           ", the omitted ones at most " + in_db(form.left_out) + ",";
  }
  text += form.is_crossed ? " with non-proportional damping instead of masses, "
                          : " instead of masses, ";
  if (form.is_exact) {
    text += "exact for the continuous network, ";
  }
  text += count_of(form.places.size(), "place", "places") + " with links";
  if (form.silence > 0.0) {
    text += ", modes asleep while together below " + in_db(form.silence);
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
