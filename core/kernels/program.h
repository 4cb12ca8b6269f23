// core/kernels: what runs. A Program is constant and shared by all voices; what changes is in the
// kernels. Indices and numbers only; the compile room knows the names.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/formula.h"
#include "core/kernels/form.h"
#include "core/kernels/waveguides/design.h"
#include "core/laws/law.h"
#include "core/rooms.h"

namespace ressort::kernels {

inline constexpr std::uint32_t no_mode = 0xffffffffu;

struct Coefficient {
  std::uint32_t first = 0;  // steps [first, first + count) of Program::steps
  std::uint32_t count = 0;
  Unit unit = Unit::plain;
  bool is_fixed = false;         // whatever the key
  std::uint32_t mode = no_mode;  // index into Program::modes: of the continuous network
};

// A mode of a body: the coefficients of its oscillator, which as a form of the published scheme
// steps them are three other numbers (core/sampled_mode.h).
struct SampledCoefficients {
  std::uint32_t inverse_mass = 0;
  std::uint32_t stiffness = 0;
  std::uint32_t damping = 0;
};

// Consecutive nodes that share their coefficients.
struct MassRun {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
  std::uint32_t inverse_mass = 0;  // coefficients
  std::uint32_t stiffness = 0;     // read only if is_oscillator
  std::uint32_t damping = 0;
  std::uint32_t gravity = 0;  // read only if has_gravity
  bool is_oscillator = false;
  bool has_gravity = false;
  bool is_junction = false;  // places on waveguides
};

// How the force of a link is found.
enum class Scheme : std::uint8_t {
  plain,              // from where its ends are, as published
  discrete_gradient,  // from where they were and will be, so that it gains no energy
};

// Consecutive links that share law, coefficients and scheme.
struct LinkRun {
  Law law{};
  Scheme scheme = Scheme::plain;
  std::uint32_t first = 0;
  std::uint32_t count = 0;
  std::array<std::uint32_t, most_law_arguments> coefficients{};  // of the law's arguments
};

struct Ends {
  std::uint32_t a = 0;  // nodes
  std::uint32_t b = 0;
};

struct InputSlot {
  std::uint32_t input = 0;  // index into Machine::inputs: what drives it
  bool is_force = false;
  std::uint32_t node = 0;
};

struct OutputSlot {
  std::uint32_t channel = 0;  // from 0
  std::uint32_t node = 0;
  bool is_force = false;  // what the links and this tick's inputs exert, at the reference rate
  // What the engine multiplies it by: steps of Program::steps; none: 1. Kernels know nothing of it.
  Coefficient level{};
  std::uint32_t origin = 0;  // index into Network::outputs
};

// A parameter that an audio channel gives for every sample.
struct AudioParameter {
  std::uint32_t parameter = 0;
  int channel = 0;  // from 0
};

// A place on a rectangle of length * width nodes, by coordinates 0..1. It has no inertia: its
// position is interpolated, and what acts on it acts on the nodes around it. On a body it is
// between two of `places`, at each of which all of its modes, the nodes, have a weight.
struct TapSlot {
  std::uint32_t node = 0;  // its own
  // Its nodes in Program::tap_nodes from here on, row by row; where only those around it are there,
  // from where the first one would be, modulo 2^32.
  std::uint32_t first = 0;
  std::uint32_t length = 1;
  std::uint32_t width = 1;
  std::uint32_t u = 0;  // coefficients
  std::uint32_t v = 0;
  std::uint32_t places = 0;  // 0: no body
  std::uint32_t shape = 0;   // Program::shapes from here on, [place][mode]
  bool is_on_body() const { return places > 0; }
};

// A string or a tube as two waves (core/kernels/waveguides).
struct WaveguideSlot {
  bool is_open = false;                 // free at its ends; else held
  std::uint32_t inverse_impedance = 0;  // coefficients
  std::uint32_t frequency = 0;          // Hz
  std::uint32_t t60 = 0;                // seconds
  std::uint32_t brightness = 0;
  FiltersAt filters_at;
  std::uint32_t first = 0;  // its places in Program::junctions
  std::uint32_t count = 0;
};

// A place on a waveguide: a node with an inverse mass, which waves move and not step_masses().
struct JunctionSlot {
  std::uint32_t node = 0;
  std::uint32_t u = 0;  // coefficient: where between its ends, 0..1
};

// A part of a network, which no other part touches. Nodes are numbered: masses that move, run by
// run, and then places on waveguides; then grounds; then position inputs; then places on macros, in
// the order of `taps`.
struct Program {
  Form form;
  double rate_hz = 44100.0;
  double rate_ratio = 1.0;       // r above; 1 where numbers are taken raw
  std::uint32_t moving = 0;      // nodes [0, moving) have inertia, or give way as if they had
  std::vector<double> position;  // [node] at the start
  std::vector<double> velocity;  // [node] per sample of rate_hz
  std::vector<MassRun> mass_runs;
  std::vector<LinkRun> link_runs;
  std::vector<Ends> ends;              // [link]
  std::vector<std::uint32_t> origins;  // [link] where the model has it
  std::vector<std::uint32_t> masses;   // [node] the same
  std::vector<InputSlot> inputs;
  std::vector<TapSlot> taps;
  std::vector<std::uint32_t> tap_nodes;  // nodes
  std::vector<double> shapes;            // of bodies
  std::vector<SampledCoefficients> modes;
  std::vector<WaveguideSlot> waveguides;
  std::vector<JunctionSlot> junctions;
  std::vector<OutputSlot> outputs;
  std::vector<AudioParameter> audio_parameters;
  std::vector<std::uint32_t> audio_coefficients;  // those that depend on an audio parameter
  std::vector<double> parameters;                 // [parameter] at the start
  std::vector<Step> steps;
  std::vector<Coefficient> coefficients;
  std::vector<std::vector<std::uint32_t>> depending;  // [parameter] coefficients
};

// Whether every link's force is found as published.
bool is_plain(const Program& program);

// Of a node that moves; places on waveguides have one, too.
const MassRun& run_of(const Program& program, std::uint32_t node);
// Whether that is a place on a waveguide: the last of those that move.
static inline bool is_junction(const Program& program, std::uint32_t node) {
  return node < program.moving && node >= program.moving - program.junctions.size();
}

// What drives an input, wherever in the network it is.
struct ModelInput {
  int number = 1;  // from 1, as in the model
  bool is_force = false;
  double position = 0.0;  // where it starts; 0 for a force
};

// A whole network: parts that do not touch each other, each a Program with the same parameters.
struct Machine {
  double rate_hz = 44100.0;
  double rate_ratio = 1.0;
  std::vector<double> parameters;  // [parameter] at the start
  std::vector<ModelInput> inputs;  // [input of the model]
  std::uint32_t channels = 0;
  std::vector<Program> parts;
};

// How much larger a coefficient is at a rate lower by r: r^a above.
double rate_factor(Unit unit, double r);

// A coefficient's value for a voice: of a body's mode as the Program's form steps it, or of the
// continuous network. [any thread] wait-free
double coefficient_value(const Program& program, const Coefficient& coefficient,
                         std::span<const double> parameters, double stiffness_factor);
double continuous_value(const Program& program, const Coefficient& coefficient,
                        std::span<const double> parameters, double stiffness_factor);
double sampled_value(const Program& program, const Coefficient& coefficient,
                     std::span<const double> parameters, double stiffness_factor);

}  // namespace ressort::kernels
