// core/laws: what is known about a force law, as plain facts. Every law is one file here, and one
// line in laws.h; all other rooms ask these facts, and none has a list of laws of its own.
//
// For a link from a to b: d = x_a - x_b, and v = the same difference of the velocities, both in
// position units and position units per sample. A law gives f; the step applies F_a -= f and
// F_b += f, so a positive f for a positive d attracts.
//
// The laws are those of mi.lib since 2020 (Leonard, Villeneuve, Michon), in their current form.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "core/rooms.h"

namespace ressort::laws {

enum class Law : std::uint8_t;  // its list is in laws.h; the first is the spring

// How a number follows the sample rate and a voice's pitch. With r = 44100 / rate and s the
// voice's stiffness factor, a coefficient is its formula's value times r^a s^b.
enum class Unit : std::uint8_t {
  plain,              // distances and thresholds: a = 0, b = 0
  stiffness,          // K: a = 2, b = 1
  damping,            // Z: a = 1, b = 0, so that a decay stays what it is at every pitch
  friction,           // Z of a bow: a = 1, b = 1/2, as the string's impedance
  speed,              // a bow's velocity scale: a = 1, b = 1/2
  inverse_mass,       // 1/M: a = 0, b = 0
  inverse_impedance,  // 1/R of a waveguide: a = -1, b = -1/2
  frequency,          // in Hz: a = 0, b = 1/2
  gravity,            // g: a = 2, b = 0
  gravity_per_rate,   // the same, divided by 44100
};

// What an argument does. Where all but `reach` and `shape` are 0, the law exerts nothing.
enum class Role : std::uint8_t {
  stiffness,  // force by distance, where the law begins to act
  bend,       // how its force grows beyond that, by a power of the distance
  limit,      // the stiffness that it grows to at most
  damping,    // force by velocity
  reach,      // the distance or the speed that it acts over
  shape,      // which curve it follows
};

struct LawArgument {
  Role role = Role::shape;
  Unit unit = Unit::plain;
  double least = -1.0;  // of a shape: between these all its curves are
  double most = 1.0;
};

inline constexpr std::size_t most_law_arguments = 5;
inline constexpr std::size_t most_law_words = 4;

using LawNumbers = std::array<double, most_law_arguments>;  // values of a law's arguments

// A keyword of the .mdl language for a law; it may leave out the first or the last arguments.
struct LawWord {
  std::string_view word;
  int least = 0;  // arguments
  int most = 0;
  std::string_view arguments;  // as a person writes them
  int first = 0;               // which of the law's arguments the word's first is
  int printed = 0;             // printed if the link has no others than so many; 0: never printed
  std::string_view tail;       // printed after the arguments
  // The dialect whose third state argument is a velocity, MIMS4Max, alone writes so many; -1: any
  // number of them; 0: none.
  int velocity_count = 0;
  std::string_view velocity_says;  // what a line with so many does
};

// What a musician calls it.
enum class Family : std::uint8_t { spring, pluck, bow, contact };
std::string_view family_name(Family family);

// Where the force is not 0 by itself, `reach` being the argument of that role.
enum class Zone : std::uint8_t {
  everywhere,
  near,   // |d| < reach
  below,  // d > -reach
  slow,   // |v| < reach
};

struct LawFacts {
  std::string_view name;  // as in FAUST
  Family family = Family::spring;
  std::string_view one;  // in messages
  std::string_view many;
  std::size_t count = 0;  // of the arguments
  std::array<LawArgument, most_law_arguments> arguments{};
  std::array<LawWord, most_law_words> words{};  // the first is that of examples; the rest empty
  Zone zone = Zone::everywhere;
  bool is_odd = true;  // f(-d, -v) = -f(d, v), so that the ends may be exchanged
  // f = K d + Z v + what is curved, wherever the ends are. Of such a law that part is found as
  // published even where the rest is found by its discrete gradient: what is always felt is the
  // matter of the stability proof, and the pitch of small vibrations stays what it was.
  bool contains_spring = false;
  bool is_curved = true;     // in d; else it is made of straight pieces
  bool is_straight = false;  // a spring and a damper wherever it acts: `inside` has what it exerts
  bool is_convex = true;     // its force never falls; not a hill's, nor friction that slips
  double solve_ns = 0.0;     // measured: one discrete gradient takes so long
  std::string_view faust;    // its definition

  // Which argument has a role: the first, or `count` if none has.
  constexpr std::size_t slot(Role role) const {
    std::size_t i = 0;
    while (i < count && arguments[i].role != role) {
      ++i;
    }
    return i;
  }
  constexpr bool has(Role role) const { return slot(role) < count; }
  // An argument that makes a force; without all of these there is none.
  constexpr bool is_strength(std::size_t i) const {
    return i < count && arguments[i].role != Role::reach && arguments[i].role != Role::shape;
  }
  // Comes and goes with the distance: between far ends there is nothing.
  constexpr bool lets_go() const { return zone == Zone::near || zone == Zone::below; }
  // How far d is from where the law begins to act; not positive where it acts.
  constexpr double gap(const LawNumbers& values, double d) const {
    return zone == Zone::below  ? -values[slot(Role::reach)] - d
           : zone == Zone::near ? (d < 0.0 ? -d : d) - values[slot(Role::reach)]
                                : 0.0;
  }
};

// How steep a law is; each the greatest, but not all at one place.
struct Slopes {
  double stiffness = 0.0;      // |dF/dd|
  double damping = 0.0;        // dF/dv that scales as the law's damping does
  double stiff_damping = 0.0;  // dF/dv that scales as a stiffness
  double pull = 0.0;           // dF/dd + 2 stiff_damping at one place: what stability weighs
};

// [Law]
std::span<const LawFacts> law_table();

const LawFacts& facts_of(Law law);

// For any arguments from `least` to `most`. Of what grows without bound, the slope up to |d| =
// `within`; 0 is at rest.
Slopes steepest(Law law, const LawNumbers& least, const LawNumbers& most, double within);

// The stiffness (pull) and the damping that a link surely has wherever its ends are. Not above 0
// where it may let go.
Slopes gentlest(Law law, const LawNumbers& least);

}  // namespace ressort::laws
