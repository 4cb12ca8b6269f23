// core/model: the network of a model file, with names and with numbers as written. A value type.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/formula.h"
#include "core/laws/law.h"
#include "core/model/name.h"

namespace ressort::model {

// Position of an element in its text, counted from 1.
struct SourceLocation {
  int line = 0;
  int column = 0;
  bool operator==(const SourceLocation&) const {
    return true;
  }  // equal networks may differ in their layout
};

// A scalar that may change while the network sounds: a player changes it, or, if `audio_input` is
// not 0, that input sets it in every sample. Numbers are per sample at 44 100 Hz (see Network).
struct Parameter {
  std::string name;
  double value = 0.0;
  int audio_input = 0;  // N of @inN
  SourceLocation location;
  bool operator==(const Parameter&) const = default;
};

// Index into Network::arguments. Equal texts share one entry, so a string of a thousand masses has
// only three.
using ArgumentId = std::uint32_t;
inline constexpr ArgumentId no_argument = 0xffffffffu;

enum class MassKind : std::uint8_t {
  mass,        // x[n+1] = 2x[n] - x[n-1] + (F - g)/M
  oscillator,  // the same, with a spring and a damper to a ground at 0
  ground,      // never moves
  position,    // follows an input; without inertia
  point,       // a place on a macro, between its nodes (see Tap); without inertia
  junction,    // a place on a waveguide of an expanded network; its M is the impedance
};

struct Mass {
  Name name;
  MassKind kind = MassKind::mass;
  ArgumentId mass = no_argument;       // M
  ArgumentId stiffness = no_argument;  // K, oscillators only
  ArgumentId damping = no_argument;    // Z, oscillators only
  ArgumentId gravity = no_argument;    // g, a force towards -x
  bool gravity_per_rate = false;       // MIMS4Max divides g by the reference rate, MIMS does not
  double position = 0.0;               // x0
  double third = 0.0;                  // the last state argument; Network::third is its meaning
  std::uint32_t tap = 0;               // index into Network::taps, points only
  // True for an oscillator that is a mode of a body. K and Z are those of the continuous network;
  // the sampled oscillator keeps its frequency and decay at every rate (core/sampled_mode.h).
  bool is_mode = false;
  bool is_fixed = false;      // keys do not change its stiffness
  std::uint32_t drawing = 0;  // 1 + index into Network::drawings; 0 for none
  SourceLocation location;
  bool operator==(const Mass&) const = default;
};

// Returns true for masses and oscillators.
inline bool moves(const Mass& mass) {
  return mass.kind == MassKind::mass || mass.kind == MassKind::oscillator;
}

enum class MacroKind : std::uint8_t {
  string,          // both ends fixed; neighbours linked by K, Z
  chain,           // the same without fixed ends
  stiff_string,    // a string with undamped K2 between every second node, clamped at both ends
  mesh,            // a rectangle, neighbours linked by K, Z
  closed_mesh,     // with its border fixed
  corner_mesh,     // with its corners fixed
  body,            // modes, which are its nodes, and named places (see BodyMode)
  waveguide,       // a string as two travelling waves, with fixed ends
  open_waveguide,  // the same with free ends
  modal_string,    // one to four strings over one bridge as their modes, by pitch and losses
};
inline constexpr std::uint32_t most_unison_strings = 4;

// Many masses in one line of the model. Nodes are numbered row by row. Each moving node has mass M,
// and a damper Zo to 0 if there is air damping.
struct Macro {
  std::string name;
  MacroKind kind = MacroKind::string;
  // Nodes, fixed ones included; rows of a mesh; modes of a body; partials of a modal string.
  std::uint32_t length = 2;
  std::uint32_t width = 1;  // nodes in a row; strings of a modal string
  ArgumentId mass = no_argument;
  ArgumentId stiffness = no_argument;
  ArgumentId second_stiffness = no_argument;  // K2
  ArgumentId damping = no_argument;
  ArgumentId air_damping = no_argument;  // Zo
  // Waveguides only, which have no nodes:
  ArgumentId impedance = no_argument;     // R, force per velocity
  ArgumentId frequency_hz = no_argument;  // frequency of the lowest partial; modal strings too
  ArgumentId t60_s = no_argument;         // T60 of the lowest partial
  ArgumentId brightness = no_argument;    // 0..1
  // Modal strings only. Partial n decays at the rate losses[0] + losses[1] n + losses[2] n^3, 1/s.
  ArgumentId inharmonicity = no_argument;  // B
  std::array<ArgumentId, 3> losses = {no_argument, no_argument, no_argument};
  ArgumentId spread_cents = no_argument;  // from the lowest to the highest string
  ArgumentId bridge_loss = no_argument;   // rate at which the bridge damps one string alone, 1/s
  std::vector<std::string> places;        // names, bodies only
  double position = 0.0;                  // position of every node
  double third = 0.0;                     // see Mass
  std::uint32_t drawing = 0;
  bool is_fixed = false;  // keys do not change its stiffness
  SourceLocation location;
  bool operator==(const Macro&) const = default;
};

// Returns pointers to all arguments of a macro.
template <class OneMacro>
auto arguments_of(OneMacro& macro) {
  return std::array{&macro.mass,         &macro.stiffness,     &macro.second_stiffness,
                    &macro.damping,      &macro.air_damping,   &macro.impedance,
                    &macro.frequency_hz, &macro.t60_s,         &macro.brightness,
                    &macro.losses[0],    &macro.losses[1],     &macro.losses[2],
                    &macro.spread_cents, &macro.inharmonicity, &macro.bridge_loss};
}

// A mode of a body: an oscillator with the body's mass, and the displacement of each place when the
// oscillator moves by 1.
struct BodyMode {
  Name name;
  std::uint32_t macro = 0;
  ArgumentId frequency_hz = no_argument;
  ArgumentId t60_s = no_argument;
  std::vector<double> shape;  // [place]
  SourceLocation location;
  bool operator==(const BodyMode&) const = default;
};
inline bool by_body(const BodyMode& a, const BodyMode& b) {
  return a.macro < b.macro;
}

// A place on a macro, by coordinates from 0 to 1. Its position is interpolated between the nodes
// around it; on a body, between the mode shapes at two named places. A tap on a modal string
// without coordinates is its bridge.
struct Tap {
  std::uint32_t macro = 0;
  ArgumentId u = no_argument;  // along the length; on a body, from its first place to its last
  ArgumentId v = no_argument;  // along the width
  // Nodes of the expanded macro: masses [first, first + length * width).
  std::uint32_t first = 0;
  std::uint32_t length = 0;
  std::uint32_t width = 0;
  // Mode shapes of an expanded body: Network::shapes from `shape` on, [place][mode].
  std::uint32_t places = 0;  // 0: not a body
  std::uint32_t shape = 0;
  bool operator==(const Tap&) const = default;
};

// Position of an element in a drawing; does not affect the sound.
struct Drawing {
  Name group;
  double x = 0.0;
  double y = 0.0;
  bool operator==(const Drawing&) const = default;
};

// A link between two masses, in the order of the text. Its force f acts as F_a -= f, F_b += f.
struct Link {
  Name name;
  Law law{};
  std::uint32_t a = 0;  // indices into Network::masses
  std::uint32_t b = 0;
  std::array<ArgumentId, most_law_arguments> arguments = {no_argument, no_argument, no_argument,
                                                          no_argument, no_argument};
  bool is_fixed = false;  // keys do not change its stiffness
  SourceLocation location;
  bool operator==(const Link&) const = default;
};

// K and Z of a link near rest. Empty for plucks, bows and contacts.
struct LinearPart {
  ArgumentId stiffness = no_argument;
  ArgumentId damping = no_argument;
};
LinearPart linear_part(const Link& link);

// Input N of the model: the position of a mass of kind `position`, or a force on any mass.
struct Input {
  int number = 1;  // N of @inN
  bool is_force = false;
  std::uint32_t mass = 0;
  SourceLocation location;
  bool operator==(const Input&) const = default;
};

// Output N of the model: the position of a mass, its velocity or acceleration, or the force on it,
// times a level. Outputs with the same number are added.
struct Output {
  int number = 1;
  bool is_force = false;
  std::uint8_t derivative = 0;  // of the position: 1 is the velocity, 2 the acceleration
  std::uint32_t mass = 0;
  ArgumentId level = no_argument;  // none: 1
  SourceLocation location;
  bool operator==(const Output&) const = default;
};

// Meaning of the third state argument of `mass` and `osc`, which depends on the dialect.
enum class ThirdArgument : std::uint8_t {
  delayed_position,    // x[-1], one sample before: MIMS and the older FAUST tools
  velocity_per_second  // in position units per second: MIMS4Max
};

// Numbers are dimensionless and per sample at `reference_rate_hz`: M = m/dt^2, K = k, Z = z/dt.
struct Network {
  std::vector<Parameter> parameters;
  std::vector<Formula> arguments;  // distinct arguments of all elements
  std::vector<Drawing> drawings;
  std::vector<Mass> masses;  // grounds and position inputs too, in the order of the text
  std::vector<Macro> macros;
  std::vector<BodyMode> modes;    // sorted by body
  std::vector<Macro> waveguides;  // waveguides of an expanded network; they have no nodes
  std::vector<Tap> taps;
  std::vector<double> shapes;  // mode shapes of expanded bodies; see Tap
  std::vector<Link> links;
  std::vector<Input> inputs;    // sorted by number
  std::vector<Output> outputs;  // sorted by number
  ThirdArgument third = ThirdArgument::delayed_position;
  bool operator==(const Network&) const = default;

  static constexpr double reference_rate_hz = 44100.0;

  ArgumentId add(Formula formula) {
    arguments.push_back(std::move(formula));
    return static_cast<ArgumentId>(arguments.size() - 1);
  }
  ArgumentId add(double number) { return add(Formula{{.op = Op::number, .value = number}}); }
};

// Returns the canonical form of a network, which is the same for equal networks. Masses come first
// in the order of the text, then position inputs by number, then points, one for each end that uses
// one. Inputs and outputs are sorted by number. Formulas, drawings and taps are numbered in the
// order of their first use by masses, macros, points and links; duplicates and unused ones are
// removed. O(n) in time and memory. [any thread but audio]
Network canonical(Network network);

// Returns which parameters an argument depends on: [parameter].
std::vector<bool> used_parameters(const Network& network);

// Returns an argument's value with these parameters; 0 for no_argument.
double argument_value(const Network& network, ArgumentId argument,
                      std::span<const double> parameters);

// Returns the level of an output.
double level_value(const Network& network, const Output& output,
                   std::span<const double> parameters);

// Returns the parameters' values in the text.
std::vector<double> parameter_values(const Network& network);

// Returns the velocity of a mass at the start, per sample.
double initial_velocity(const Network& network, const Mass& mass);

// Returns true if all moving masses start at 0, at rest. Both meanings of the third argument then
// agree.
bool rests_at_zero(const Network& network);

// Returns the number of moving masses outside of macros.
std::size_t moving_count(const Network& network);

// Return the highest channel number in use; 0 for none.
int input_count(const Network& network);
int output_count(const Network& network);

}  // namespace ressort::model
