#include "core/engine/renumbering.h"

#include <algorithm>
#include <tuple>

namespace ressort::engine {
namespace {

// Returns whether two lists have equal length and of() is equal for each pair of elements.
template <class List, class Of>
bool is_same(const List& a, const List& b, Of&& of) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [&](const auto& x, const auto& y) { return of(x) == of(y); });
}

bool is_same(const Program& a, const Program& b) {
  return a.moving == b.moving && a.position == b.position && a.tap_nodes == b.tap_nodes &&
         a.shapes == b.shapes && a.audio_coefficients == b.audio_coefficients &&
         a.mass_runs == b.mass_runs && a.link_runs == b.link_runs && a.ends == b.ends &&
         a.inputs == b.inputs && a.taps == b.taps && a.modes == b.modes &&
         a.waveguides == b.waveguides && a.junctions == b.junctions &&
         a.audio_parameters == b.audio_parameters &&
         is_same(a.outputs, b.outputs,
                 [](const OutputSlot& output) {
                   return std::tuple(output.channel, output.node, output.is_force,
                                     output.derivative);
                 }) &&
         is_same(a.coefficients, b.coefficients,
                 [](const Coefficient& c) { return std::tuple(c.unit, c.is_fixed, c.mode); });
}

// Returns the direction of a change: 1 towards less stability (stiffer, more damped, lighter), -1
// towards more, 0 if neither.
int direction(const Program& a, const Program& b, std::uint32_t c) {
  switch (a.coefficients[c].unit) {
    case Unit::stiffness:
    case Unit::damping:
    case Unit::friction:
    case Unit::inverse_mass:
    case Unit::inverse_impedance: {
      const double before = coefficient_value(a, a.coefficients[c], a.parameters, 1.0);
      const double after = coefficient_value(b, b.coefficients[c], b.parameters, 1.0);
      return before < after ? 1 : before > after ? -1 : 0;
    }
    case Unit::plain:
    case Unit::speed:
    case Unit::frequency:
    case Unit::gravity:
    case Unit::gravity_per_rate:
      return 0;
  }
  return 0;
}

// Returns whether all coefficients change in one direction, so that every state between is as
// stable as one of the two ends. Places on macros must not change, because their effect is unknown.
bool is_one_way(const Machine& a, const Machine& b) {
  bool any_up = false;
  bool any_down = false;
  for (std::size_t p = 0; p < a.parts.size(); ++p) {
    const Program& from = a.parts[p];
    const Program& to = b.parts[p];
    for (std::uint32_t c = 0; c < from.coefficients.size(); ++c) {
      const int here = direction(from, to, c);
      any_up = any_up || here > 0;
      any_down = any_down || here < 0;
    }
    const auto moves = [&](std::uint32_t c) {
      return coefficient_value(from, from.coefficients[c], from.parameters, 1.0) !=
             coefficient_value(to, to.coefficients[c], to.parameters, 1.0);
    };
    if (std::any_of(from.taps.begin(), from.taps.end(),
                    [&](const TapSlot& tap) { return moves(tap.u) || moves(tap.v); }) ||
        std::any_of(from.junctions.begin(), from.junctions.end(),
                    [&](const JunctionSlot& place) { return moves(place.u); })) {
      return false;
    }
  }
  return !(any_up && any_down);
}

bool is_same(const Machine& a, const Machine& b) {
  return a.rate_hz == b.rate_hz && a.rate_ratio == b.rate_ratio && a.channels == b.channels &&
         a.parameters.size() == b.parameters.size() && a.inputs == b.inputs &&
         std::equal(a.parts.begin(), a.parts.end(), b.parts.begin(), b.parts.end(),
                    [](const Program& x, const Program& y) { return is_same(x, y); });
}

}  // namespace

bool can_renumber(const Machine& from, const Machine& to) {
  return is_same(from, to) && is_one_way(from, to);
}

}  // namespace ressort::engine
