// core/kernels: the tables of the modal kernel, from the eigenvectors of a Program's linear links.
#pragma once

#include <cstdint>
#include <optional>

#include "core/kernels/program.h"
#include "core/model/preset/budget.h"
#include "core/progress.h"

namespace ressort::kernels {

struct Workload;
class Work;

// The share of one coefficient in the stiffness or damping of each mode, for masses of 1. Links act
// one sample late, with the coefficient of the sample before. Oscillators use the current one.
struct ModalShare {
  std::uint32_t coefficient = 0;
  bool is_late = false;
  std::uint32_t first = 0;
  std::vector<double> factor;  // factors of the modes from `first` on; 0 for all others
};

// A mass or point at which something is read or acts. Its position is rest + sum of shape * q.
struct ModalPlace {
  double rest = 0.0;
  std::vector<double> shape;  // [mode]
  // `offset` plus the weighted positions of `masses` is the initial position. Only crossed modes
  // need it, because their initial state is that of the first sample.
  struct Mass {
    std::uint32_t node = 0;
    double weight = 1.0;
  };
  double offset = 0.0;
  std::vector<Mass> masses;
  std::vector<double> speed;  // [mode] velocity; crossed modes only
};

// The nonlinear links of one run. An end is a place or, numbered on from these, one of Modes::ends.
struct ModalHold {
  std::uint32_t run = 0;  // index into Program::link_runs: the law and its coefficients
  std::vector<std::uint32_t> a;
  std::vector<std::uint32_t> b;  // [link] ends
  // [link] static compliance of the ends by the modes that are left out, times the coefficient
  // Modes::give_by; empty if none are left out
  std::vector<double> give;
};

// An end that is not a mass: a position input or a ground.
struct ModalEnd {
  bool follows = false;
  std::uint32_t input = 0;
  std::uint32_t node = 0;
};

// The force of links and inputs at a node, for an output: `scale` times the sum of all parts.
struct ModalForce {
  // Springs or dampers of one coefficient: coefficient * (constant + sum of shape * q, or d).
  struct Part {
    std::uint32_t coefficient = 0;
    bool is_damping = false;
    double constant = 0.0;
    std::vector<double> shape;  // [mode]; with crossed modes a damper has the shape of velocities
  };
  // A position input with springs: weight * (K (x - start) + Z v).
  struct Hand {
    std::uint32_t input = 0;
    std::uint32_t stiffness = 0;  // coefficients
    std::uint32_t damping = 0;
    double start = 0.0;
    double weight = 0.0;
  };
  // A force input, or the force of nonlinear links at an end as in ModalHold.
  struct Weight {
    std::uint32_t of = 0;
    double weight = 0.0;
  };
  double scale = 1.0;
  std::vector<Part> parts;
  std::vector<Hand> hands;
  std::vector<Weight> inputs;
  std::vector<Weight> ends;
};

struct ModalOutput {
  std::uint32_t end = 0;  // as in ModalHold, if neither of the following
  bool is_place = false;  // `place` is read
  ModalPlace place;
  bool is_force = false;  // `force` is read
  ModalForce force;
};

// A force that does not depend on the masses, distributed over the modes by `shape`.
struct ModalPush {
  enum class By : std::uint8_t {
    force,     // a force input
    position,  // a position input with springs: K (x - start) + Z v, of the sample before
    constant,  // a coefficient
    late,      // a coefficient of the sample before
  };
  By by = By::force;
  std::uint32_t input = 0;
  std::uint32_t stiffness = 0;  // coefficients; a constant is the first
  std::uint32_t damping = 0;
  double start = 0.0;
  std::vector<double> shape;  // [mode]
};

// The masses and linear links in their common eigenvectors, for one voice. Everything else acts at
// places. With masses of 1/w times the relative mass of each,
//   d += w (push - sum of coefficient * factor * q - sum of coefficient * factor * d);  q += d
// where the first sum is over `stiffness` and the second over `damping`.
//
// Crossed modes are complex modes, for damping that is not proportional (its matrix is not diagonal
// in the eigenvectors of the stiffness). q and d are then the real and imaginary part of one number
// y with y += pole y + w push, and a place is at the real part of the sum of shape * y. The rows of
// crossed modes are [part][mode], and the coefficients are constant.
struct Modes {
  static constexpr std::uint32_t own_mass = 0xffffffffu;
  std::uint32_t modes = 0;
  std::uint32_t inverse_mass = own_mass;  // the coefficient w, or 1
  double reach = 1.0;                     // no mass is displaced by more than reach * |q|
  bool is_exact = false;      // modes of the continuous network instead of the published scheme
  std::uint32_t of = 0;       // number of modes before some were left out; 0: none were
  std::uint32_t give_by = 0;  // the coefficient that ModalHold::give is divided by
  // Shares of the peak of an output or place:
  double left_out = 0.0;  // bound on the error by modes that are left out
  double silence = 0.0;   // bound on the error by modes that sleep; 0: none sleeps
  std::vector<double> q;  // [mode] at the start
  std::vector<double> d;
  // [mode][mass] contribution of a mass's displacement or velocity to a mode's; of crossed modes
  // [displacement, velocity, push][part][mode][mass], one sample later
  std::vector<double> basis;
  bool is_crossed = false;
  std::vector<double> pole;  // [part][mode] minus 1; crossed modes only
  std::vector<ModalShare> stiffness;
  std::vector<ModalShare> damping;
  std::vector<ModalPush> pushes;
  std::vector<ModalPlace> places;  // ends of nonlinear links
  std::vector<ModalEnd> ends;      // numbered on from the places
  std::vector<ModalHold> holds;
  std::vector<ModalOutput> outputs;  // [output]
  std::vector<std::uint32_t> felt;   // coefficients that act other than by a mode's share
};

// Limits of the masses that are connected, by the time for the eigenvectors, and of all modes, by
// the memory for their shapes.
inline constexpr std::size_t most_tied_modes = 1200;
inline constexpr std::size_t most_modes = 4096;

// Makes the modal form, if all linear links share their eigenvectors for all values of the
// parameters (proportional damping). Otherwise makes crossed modes (modal_crossed.h) if nothing
// changes the coefficients; `is_untuned` means that no key and no bend does. Empty if neither is
// possible, if parameters change masses separately or move points on macros, and for audio
// parameters, too many passive links and more than most_tied_modes masses. O(n^3): about 20 ms for
// 300 masses, 0.1 s for 600.
//
// With a budget of cents or decay, or with `is_exact`, the modes are those of the continuous
// network, without modes above 0.45 of the rate. With a budget of silence, modes that are never
// audible are left out, and the others are sorted and may sleep, unless they are crossed or an
// output is a force. [any thread but audio]
std::optional<Modes> modal_form(const Program& program, const model::Budget& budget = {},
                                const Progress& progress = {}, bool is_untuned = false,
                                bool is_exact = false);

// Returns a lower bound of the operations, before the form is made.
double least_modal_operations(const Program& program, const Workload& load);

double operations(const Program& program, const Modes& form, const Workload& load);
std::string description(const Program& program, const Modes& form);
std::uint64_t voice_bytes(const Program& program, const Modes& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
