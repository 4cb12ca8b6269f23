#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/kernels/modal/modal_form.h"

namespace ressort {
namespace {

// Parameters are still most of the time, so that a moving one counts by half; without that no mesh
// whose stiffness can be turned would ever be stepped by its modes.
double modal_ns(double modes, double places, double heard, double pushed, const Workload& load) {
  const double wide = load.isa == Isa::v4 ? 0.85 : load.isa == Isa::v3 ? 1.0 : 2.4;
  const double each = wide * (load.is_double ? 1.0 : 0.5) * modes;
  const double rows = places + pushed;
  const double slope = rows > 8.0 ? 0.23 : 0.09;
  const double bound = 25.0 + 5.0 * places + each * (0.30 + slope * rows);
  const double moving = 0.5 * (bound + 0.45 * each);
  const double still = places > 0.0 ? bound : 6.0 + each * (0.11 + 0.04 * heard + 0.045 * pushed);
  return std::max(still, moving);
}

std::string in_db(double share) {
  char text[32];
  std::snprintf(text, sizeof text, "%.0f dB", 20.0 * std::log10(std::max(share, 1e-15)));
  return text;
}

}  // namespace

double predicted_ns(const Program&, const Modes& form, const Workload& load) {
  return load.voices * modal_ns(form.modes, static_cast<double>(form.places.size()),
                                static_cast<double>(form.outputs.size()),
                                static_cast<double>(form.pushes.size()), load);
}

double least_modal_ns(const Program& program, const Workload& load) {
  const LinkCount links = links_of(program);
  // Two links at one mass share its place, so each is counted as half of one.
  return load.voices * modal_ns(program.moving, 0.5 * (links.bent + links.others),
                                static_cast<double>(program.outputs.size()), 0.0, load);
}

std::string description(const Program&, const Modes& form) {
  std::string text = count_of(form.modes, "mode", "modes");
  if (form.modes < form.of) {
    text = std::to_string(form.modes) + " of " + count_of(form.of, "mode", "modes") +
           ", the rest at most " + in_db(form.left_out) + ",";
  }
  text += " in place of the masses, ";
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
  const std::uint64_t rows = 18 + form.places.size() + form.outputs.size() + form.pushes.size() +
                             form.stiffness.size() + form.damping.size();
  return node_bytes(program, number_bytes) + number_bytes * rows * form.modes;
}

}  // namespace ressort
