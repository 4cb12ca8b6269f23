// core/laws: the facts about each force law. Every law is one file in this folder and one row in
// laws.h. All other rooms read these facts; only the loops of the kernels need the laws' templates.
//
// A link connects a to b. Its distance is d = x_a - x_b, in position units; v = v_a - v_b is its
// velocity, in position units per sample. A law computes a force f from both, and the step applies
// F_a -= f and F_b += f. So f > 0 at d > 0 attracts.
//
// Most laws are those of mi.lib since 2020 (Leonard, Villeneuve, Michon), in their current form.
// The file of any other law names its source.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "core/rooms.h"

namespace ressort::laws {

enum class Law : std::uint8_t;  // laws.h has the list

inline constexpr Law linear_law{0};  // the spring, the only law whose force is linear
constexpr bool is_linear(Law law) {
  return law == linear_law;
}

// Scaling of a coefficient with the sample rate and a voice's pitch. With r = 44100 / rate and the
// voice's stiffness factor s, the coefficient is the value of its formula times r^a s^b, for an
// inverse 1 over that value. Laws use the first five units. A factor of both a velocity and another
// argument, such as lambda in K (1 + lambda v), has no unit: take Z = K lambda as the argument.
enum class Unit : std::uint8_t {
  plain,              // distances and thresholds: a = 0, b = 0
  stiffness,          // K: a = 2, b = 1
  damping,            // Z: a = 1, b = 0, so that the decay time is the same at every pitch
  friction,           // Z of a bow: a = 1, b = 1/2, like the string's impedance
  speed,              // velocity scale of a bow: a = 1, b = 1/2
  inverse_mass,       // 1/M: a = 0, b = 0
  inverse_impedance,  // 1/R of a waveguide: a = -1, b = -1/2
  frequency,          // in Hz: a = 0, b = 1/2
  gravity,            // g: a = 2, b = 0
  gravity_per_rate,   // the same, divided by 44100
};

// Meaning of an argument. A law whose arguments are all 0, except `reach` and `shape`, exerts no
// force. Every law has a damping, every law but friction a stiffness, and every law that does not
// act everywhere a reach.
enum class Role : std::uint8_t {
  stiffness,  // force per distance where the law begins to act
  bend,       // growth of the force beyond that, by a power of the distance
  limit,      // the largest stiffness
  damping,    // force per velocity, or any factor of the velocity
  reach,      // distance or speed at which the law begins or ends to act
  shape,      // exponent or profile of the curve
};

struct LawArgument {
  Role role = Role::shape;
  Unit unit = Unit::plain;
  double least = -1.0;  // range of a shape that contains all its different curves
  double most = 1.0;
};

inline constexpr std::size_t most_law_arguments = 5;
inline constexpr std::size_t most_law_words = 4;
inline constexpr std::size_t most_kept_numbers = 6;  // see LawType in laws.h

using LawNumbers = std::array<double, most_law_arguments>;  // values of a law's arguments

// A keyword of the .mdl language for a law. It may omit the first or the last arguments.
struct LawWord {
  std::string_view word;
  int least = 0;  // fewest and most arguments
  int most = 0;
  std::string_view arguments;  // description for messages
  int first = 0;               // index of the law's argument that comes first in the line
  int printed = 0;        // number of arguments up to which the printer uses this word; 0: never
  std::string_view tail;  // printed after the arguments
  // Number of arguments that only MIMS4Max writes, the dialect whose third state argument is a
  // velocity. -1: any number; 0: none.
  int velocity_count = 0;
  std::string_view velocity_says;  // describes such a line in messages
};

// The region where the force may differ from 0; `reach` is the argument of that role.
enum class Zone : std::uint8_t {
  everywhere,
  near,   // |d| < reach
  below,  // d > -reach
  slow,   // |v| < reach
};

struct LawFacts {
  std::string_view name;  // name in FAUST
  std::string_view one;   // name in messages
  std::string_view many;
  std::size_t count = 0;  // number of arguments
  std::array<LawArgument, most_law_arguments> arguments{};
  std::array<LawWord, most_law_words> words{};  // examples use the first; unused ones are empty
  Zone zone = Zone::everywhere;
  bool is_friction = false;  // depends on v alone, like a bow, and has no potential
  bool is_odd = true;        // f(-d, -v) = -f(d, v), so the ends may be exchanged
  // f = K d + Z v + a curved rest, at every distance. The passive form of such a law keeps K d + Z
  // v as published and replaces only the rest by its discrete gradient: the proof of stability
  // covers the linear part, and small vibrations keep their pitch.
  bool contains_spring = false;
  bool is_curved = true;  // in d; false if the force is piecewise linear
  bool is_straight =
      false;              // a spring and a damper wherever it acts; the law has a function `inside`
  bool is_convex = true;  // the force never falls with d or v
  // Rough cost of one discrete gradient, which ranks the kernels: 60 to 140 in closed form, 320 by
  // Newton's method, 1000 by Newton's method with powers.
  double solve_operations = 0.0;
  // FAUST definitions, one after the other. The arguments come first, as coefficients at the sample
  // rate of the program. The quantities are those of discrete_gradient.h.
  //   NAME(arguments, d, v) = the published force
  //   steady_NAME(arguments, now, speed, way) = force, damping
  //     the part of the passive force that does not depend on the solution, and the damping per
  //     unit of the way; `way` is the change of distance in two samples without the link
  //   gradient_NAME(arguments, before, step) = force, slope
  //     the discrete gradient after `step`, or a force that does no less work, with damping that
  //     depends on the velocity; of a friction law, the friction
  //   alone_NAME(arguments, force, damping, before, speed, way, gamma) = force
  //     optional: the solution in closed form. Without it, Newton's method finds the solution,
  //     which needs a gradient that does not fall.
  // The passive form is for links that hold waveguides. There it covers the linear part of a law
  // that contains a spring, too. The definitions may call `discrete`, `between`, `inside` and
  // `risen` (core/model/faust/faust_words.cpp) and the definitions of other laws.
  // A definition begins in column 1 with its name and `(`. All other lines are indented or begin
  // with `with` or `}`. A law may have more definitions, if no other law has their names. FAUST's
  // own words, such as `sum`, cannot be names, nor names of local values.
  std::string_view faust;

  // Returns the index of the first argument with this role, or `count`.
  constexpr std::size_t slot(Role role) const {
    std::size_t i = 0;
    while (i < count && arguments[i].role != role) {
      ++i;
    }
    return i;
  }
  constexpr bool has(Role role) const { return slot(role) < count; }
  // Returns true if the argument scales the force. If all of these are 0, the law exerts no force.
  constexpr bool is_strength(std::size_t i) const {
    return i < count && arguments[i].role != Role::reach && arguments[i].role != Role::shape;
  }
  // Returns true if the law has a stiffness and acts at every distance.
  constexpr bool is_spring() const { return zone == Zone::everywhere && !is_friction; }
  // Returns true if the law exerts no force between distant ends.
  constexpr bool can_detach() const { return zone == Zone::near || zone == Zone::below; }
  // Returns true for a contact: it acts while b is below a.
  constexpr bool is_one_sided() const { return zone == Zone::below; }
  // Returns the distance from d to where the law begins to act; not positive where it acts.
  constexpr double gap(const LawNumbers& values, double d) const {
    return zone == Zone::below  ? -values[slot(Role::reach)] - d
           : zone == Zone::near ? (d < 0.0 ? -d : d) - values[slot(Role::reach)]
                                : 0.0;
  }
};

// The largest slopes of a law's force; not all of them occur at the same place.
struct Slopes {
  double stiffness = 0.0;  // |dF/dd| at v = 0
  double damping = 0.0;    // dF/dv that scales like the law's damping
  // dF/dv that scales like a stiffness; the stability proof uses only its share of `pull`
  double stiff_damping = 0.0;
  // dF/dd at v = 0, plus 2 stiff_damping, at one place; the stability proof needs it
  double pull = 0.0;
};

// The facts of all laws, by Law.
std::span<const LawFacts> law_table();

const LawFacts& facts_of(Law law);

// Returns the law of this name, which must exist.
Law law_named(std::string_view name);

// Returns the largest slopes for any arguments from `least` to `most`. Where the slope grows
// without bound, `within` limits |d|; 0 means at rest.
Slopes steepest(Law law, const LawNumbers& least, const LawNumbers& most, double within);

// Returns the smallest stiffness (pull) and damping of a link at any position of its ends. Not
// above 0 for a law that may detach, of which only the signs count.
Slopes gentlest(Law law, const LawNumbers& least);

}  // namespace ressort::laws
