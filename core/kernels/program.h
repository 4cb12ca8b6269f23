// core/kernels: the network that runs. A Program is constant and shared by all voices; the state is
// in the kernels. It has indices and numbers only. The compile room knows the names.
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
  bool is_fixed = false;         // does not depend on the key
  std::uint32_t mode = no_mode;  // index into Program::modes, if it belongs to a mode of a body
};

// The coefficients of the oscillator that is a mode of a body. A form of the published scheme steps
// it with three other numbers (core/sampled_mode.h).
struct SampledCoefficients {
  std::uint32_t inverse_mass = 0;
  std::uint32_t stiffness = 0;
  std::uint32_t damping = 0;
  bool operator==(const SampledCoefficients&) const = default;
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
  bool operator==(const MassRun&) const = default;
};

// The method that computes the force of a link.
enum class Scheme : std::uint8_t {
  plain,              // explicit: from the positions and velocities of its ends, as published
  discrete_gradient,  // implicit: the change of its potential over the sample (Gonzalez, 1996);
                      // passive
};

// Consecutive links that share law, coefficients and scheme.
struct LinkRun {
  Law law{};
  Scheme scheme = Scheme::plain;
  std::uint32_t first = 0;
  std::uint32_t count = 0;
  // coefficients of the law's arguments
  std::array<std::uint32_t, most_law_arguments> coefficients{};
  bool operator==(const LinkRun&) const = default;
};

struct Ends {
  std::uint32_t a = 0;  // nodes
  std::uint32_t b = 0;
  bool operator==(const Ends&) const = default;
};

struct InputSlot {
  std::uint32_t input = 0;  // index into Machine::inputs
  bool is_force = false;
  std::uint32_t node = 0;
  bool operator==(const InputSlot&) const = default;
};

struct OutputSlot {
  std::uint32_t channel = 0;  // channel, from 0
  std::uint32_t node = 0;
  bool is_force =
      false;  // the force of the links and of this sample's inputs, at the reference rate
  // Derivative of the position that the engine computes: 1 or 2. Kernels ignore it.
  std::uint8_t derivative = 0;
  // Gain that the engine applies, as steps of Program::steps, or 1 without steps. Kernels ignore
  // it.
  Coefficient level{};
  std::uint32_t origin = 0;  // index into Network::outputs
};

// A parameter that an audio channel sets in every sample.
struct AudioParameter {
  std::uint32_t parameter = 0;
  int channel = 0;  // channel, from 0
  bool operator==(const AudioParameter&) const = default;
};

// A point on a rectangle of length * width nodes, by coordinates 0..1. It has no inertia: its
// position is interpolated, and forces on it are distributed to the nodes around it. On a body the
// nodes are the modes, and the point is between two of `places`, at each of which every mode has a
// weight.
struct TapSlot {
  std::uint32_t node = 0;   // node of the point itself
  std::uint32_t first = 0;  // its first node in Program::tap_nodes, row by row
  std::uint32_t length = 1;
  std::uint32_t width = 1;
  std::uint32_t u = 0;  // coefficients
  std::uint32_t v = 0;
  std::uint32_t places = 0;  // 0: not on a body
  std::uint32_t shape = 0;   // first index into Program::shapes, [place][mode]
  bool is_on_body() const { return places > 0; }
  bool operator==(const TapSlot&) const = default;
};

// A string or a tube as two travelling waves (core/kernels/waveguides).
struct WaveguideSlot {
  bool is_open = false;                 // free at its ends instead of fixed
  std::uint32_t inverse_impedance = 0;  // coefficients
  std::uint32_t frequency = 0;          // Hz
  std::uint32_t t60 = 0;                // seconds
  std::uint32_t brightness = 0;
  FiltersAt filters_at;
  std::uint32_t first = 0;  // index of its first place in Program::junctions
  std::uint32_t count = 0;
  bool operator==(const WaveguideSlot&) const = default;
};

// A place on a waveguide: a node with an inverse mass that the waves move.
struct JunctionSlot {
  std::uint32_t node = 0;
  std::uint32_t u = 0;  // coefficient: position between the ends, 0..1
  bool operator==(const JunctionSlot&) const = default;
};

// A connected part of a network. The nodes are numbered in this order: moving masses, run by run;
// places on waveguides; grounds; position inputs; points on macros, in the order of `taps`.
struct Program {
  Form form;
  double rate_hz = 44100.0;
  double rate_ratio = 1.0;       // 44100 Hz / rate_hz; 1 with --no-rescale
  std::uint32_t moving = 0;      // nodes [0, moving) have inertia: masses and places on waveguides
  std::vector<double> position;  // [node] at the start
  std::vector<double> velocity;  // [node] per sample of rate_hz
  std::vector<MassRun> mass_runs;
  std::vector<LinkRun> link_runs;
  std::vector<Ends> ends;              // [link]
  std::vector<std::uint32_t> origins;  // [link] index in the model
  std::vector<std::uint32_t> masses;   // [node] index in the model
  std::vector<InputSlot> inputs;
  std::vector<TapSlot> taps;
  std::vector<std::uint32_t> tap_nodes;  // nodes
  std::vector<double> shapes;            // mode shapes of bodies
  std::vector<SampledCoefficients> modes;
  std::vector<WaveguideSlot> waveguides;
  std::vector<JunctionSlot> junctions;
  std::vector<OutputSlot> outputs;
  std::vector<AudioParameter> audio_parameters;
  std::vector<std::uint32_t> audio_coefficients;  // coefficients that depend on an audio parameter
  std::vector<double> parameters;                 // [parameter] at the start
  std::vector<Step> steps;
  std::vector<Coefficient> coefficients;
  std::vector<std::vector<std::uint32_t>> depending;  // [parameter] coefficients
};

// Returns whether all links have the plain scheme.
bool is_plain(const Program& program);

// Returns the run of a moving node, which may be a place on a waveguide.
const MassRun& run_of(const Program& program, std::uint32_t node);
// Returns whether the node is a place on a waveguide. These are the last moving nodes.
static inline bool is_junction(const Program& program, std::uint32_t node) {
  return node < program.moving && node >= program.moving - program.junctions.size();
}

// An input of the model, which may drive several parts.
struct ModelInput {
  int number = 1;  // number in the model, from 1
  bool is_force = false;
  double position = 0.0;  // position at the start; 0 for a force
  bool operator==(const ModelInput&) const = default;
};

// A whole network: its connected parts, each a Program with the same parameters.
struct Machine {
  double rate_hz = 44100.0;
  double rate_ratio = 1.0;
  std::vector<double> parameters;  // [parameter] at the start
  std::vector<ModelInput> inputs;  // [input of the model]
  std::uint32_t channels = 0;
  std::vector<Program> parts;
};

// Returns the factor of a coefficient at a sample rate that is lower by r.
double rate_factor(Unit unit, double r);

// Return the value of a coefficient for a voice: as the Program's form needs it, of the continuous
// network, or of the published scheme. They differ for modes of bodies only. [any thread] wait-free
double coefficient_value(const Program& program, const Coefficient& coefficient,
                         std::span<const double> parameters, double stiffness_factor);
double continuous_value(const Program& program, const Coefficient& coefficient,
                        std::span<const double> parameters, double stiffness_factor);
double sampled_value(const Program& program, const Coefficient& coefficient,
                     std::span<const double> parameters, double stiffness_factor);

// The two steps of continuous_value(): what the parameters give, and what the stiffness factor
// makes of it. [any thread] wait-free
double untuned_value(const Program& program, const Coefficient& coefficient,
                     std::span<const double> parameters);
double tuned_value(const Program& program, const Coefficient& coefficient, double untuned,
                   double stiffness_factor);

}  // namespace ressort::kernels
