// core/kernels: finds the eigenvectors of a Program's linear links.
#pragma once

#include <cstdint>
#include <optional>

#include "core/kernels/program.h"
#include "core/model/preset/budget.h"
#include "core/progress.h"

namespace ressort::kernels {

struct Workload;
class Work;

// A stiffness or damping in the eigenvectors: what one coefficient gives to each mode, for masses
// of 1. Links exert what they computed one tick before, with the coefficient of then; oscillators
// pull with the coefficient of now.
struct ModalShare {
  std::uint32_t coefficient = 0;
  bool is_late = false;
  std::uint32_t first = 0;
  std::vector<double> factor;  // of the modes from `first` on; of all others it is 0
};

// A mass that is heard or touched: its position is rest + sum of shape * q.
struct ModalPlace {
  double rest = 0.0;
  std::vector<double> shape;  // [mode]
  // Of crossed modes only, which are placed a sample ahead: where it is with its masses at 0 and
  // what they add, to begin with, and
  struct Mass {
    std::uint32_t node = 0;
    double weight = 1.0;
  };
  double offset = 0.0;
  std::vector<Mass> masses;
  std::vector<double> speed;  // [mode] its change in the last sample
};

// Nonlinear links of one law. Their ends are places, numbered first, or Modes::ends.
struct ModalHold {
  std::uint32_t run = 0;  // of Program::link_runs: the law and its coefficients
  std::vector<std::uint32_t> a;
  std::vector<std::uint32_t> b;  // [link] ends
  // [link] how far the ends give way by the modes that are left out, per force, times the
  // coefficient Modes::give_by; empty where none are
  std::vector<double> give;
};

// An end that is no mass: it follows a position input, or stays.
struct ModalEnd {
  bool follows = false;
  std::uint32_t input = 0;
  std::uint32_t node = 0;
};

// What links and inputs exert at a node, as far as it is linear in what moves: times `scale`, the
// sum of all of these.
struct ModalForce {
  // Springs or dampers of one coefficient: it times (constant + sum of shape * q, or d)
  struct Part {
    std::uint32_t coefficient = 0;
    bool is_damping = false;
    double constant = 0.0;
    std::vector<double> shape;  // [mode]; of crossed modes a damper's is of speeds
  };
  // A position input on springs: weight * (K (x - start) + Z v)
  struct Hand {
    std::uint32_t input = 0;
    std::uint32_t stiffness = 0;  // coefficients
    std::uint32_t damping = 0;
    double start = 0.0;
    double weight = 0.0;
  };
  // What a force input pushes with, or what nonlinear links do at an end as in ModalHold.
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
  std::uint32_t end = 0;  // as in ModalHold, if it is no mass
  bool is_place = false;  // else:
  ModalPlace place;
  bool is_force = false;  // or neither, but:
  ModalForce force;
};

// A force that does not depend on the masses, spread by `shape` over the modes.
struct ModalPush {
  enum class By : std::uint8_t {
    force,     // an input's value
    position,  // an input's position on springs: K (x - start) + Z v, of the tick before
    constant,  // a coefficient, of now
    late,      // a coefficient, of the tick before
  };
  By by = By::force;
  std::uint32_t input = 0;
  std::uint32_t stiffness = 0;  // coefficients; the constant's is the first
  std::uint32_t damping = 0;
  double start = 0.0;
  std::vector<double> shape;  // [mode]
};

// The linear links and the masses in their common eigenvectors, everything else holds on to places
// of them; one voice. With masses of 1/w times the relative mass of each,
//   d += w (push - sum of coefficient * factor * q - the same of damping * d);  q += d
// Crossed modes are those of a body whose damping does not share the eigenvectors of its stiffness:
// q and d are the real and the imaginary part of a number y each, y += pole y + w push, and a place
// is at the real part of the sum of shape * y. Their rows are [part][mode], and nothing turns them.
struct Modes {
  static constexpr std::uint32_t own_mass = 0xffffffffu;
  std::uint32_t modes = 0;
  std::uint32_t inverse_mass = own_mass;  // the coefficient w, or 1
  double reach = 1.0;                     // no mass moves farther than reach * |q|
  bool is_exact = false;      // true to the continuous network instead of the published scheme
  std::uint32_t of = 0;       // modes before some were left out; 0: none were to be
  std::uint32_t give_by = 0;  // the coefficient that ModalHold::give is divided by
  // Shares of an output's peak, or of a place's:
  double left_out = 0.0;  // by those that are not here, at most, of a blow or the start
  double silence = 0.0;   // by those that sleep, at most; 0: none sleeps
  std::vector<double> q;  // [mode] at the start
  std::vector<double> d;
  // [mode][mass] what a mass's displacement or velocity is to a mode's; of crossed modes
  // [displacement, velocity, push][part][mode][mass], a sample later
  std::vector<double> basis;
  bool is_crossed = false;
  std::vector<double> pole;  // [part][mode] less 1, of crossed modes
  std::vector<ModalShare> stiffness;
  std::vector<ModalShare> damping;
  std::vector<ModalPush> pushes;
  std::vector<ModalPlace> places;  // what nonlinear links hold
  std::vector<ModalEnd> ends;      // numbered on from the places
  std::vector<ModalHold> holds;
  std::vector<ModalOutput> outputs;  // [output]
};

// Masses that hang together: beyond, the eigenvectors take too long to find; and all: beyond, the
// shapes take too much memory.
inline constexpr std::size_t most_tied_modes = 1200;
inline constexpr std::size_t most_modes = 4096;

// The modal form, where all linear links share their eigenvectors whatever the parameters become;
// where they do not, but nothing turns them, crossed modes (modal_crossed.h): `is_untuned` says
// that no key and no bend will. Nothing for what has neither, where parameters turn the masses one
// by one or move places on macros, for audio parameters, more passive links than can be solved
// together, and more than most_tied_modes masses. O(n^3): about 20 ms for 300 masses, 0.1 s for
// 600. With a budget of cents or decays, or if `is_exact` says so, true to the continuous network,
// and without what would ring above 0.45 of the rate; with one of silence without the modes that
// are never heard, the others sorted and told to sleep, unless they are crossed or a force is
// heard. [any thread but audio]
std::optional<Modes> modal_form(const Program& program, const model::Budget& budget = {},
                                const Progress& progress = {}, bool is_untuned = false,
                                bool is_exact = false);

// What it will cost at least, before it is known.
double least_modal_ns(const Program& program, const Workload& load);

Work work(const Program& program, const Modes& form, const Workload& load);
std::string description(const Program& program, const Modes& form);
std::uint64_t voice_bytes(const Program& program, const Modes& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
