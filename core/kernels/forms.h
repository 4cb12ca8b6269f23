// core/kernels: the forms in which a Program may be computed, each the tables of one kernel beside
// the Program's own. Pure data, made by the compile room, shared by all voices.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <variant>
#include <vector>

#include "core/rooms.h"

namespace ressort::kernels {

// As it is written, mass by mass and link by link; one voice in each lane. Every Program.
struct Direct {};

// Equal masses in a row, each tied to the next by the same spring; in a stiff one also each to the
// next but one, by a second kind of spring. What holds an end is a ground or a position input.
struct Chain {
  static constexpr std::uint32_t free = 0xffffffffu;

  std::uint32_t first = 0;  // of its masses in Chains::nodes, from one end to the other
  std::uint32_t count = 0;
  std::uint32_t mass_run = 0;   // of the Program, that all of them are in
  std::uint32_t stiffness = 0;  // coefficients of the springs
  std::uint32_t damping = 0;
  std::uint32_t left = free;  // holds the first mass by the same spring
  std::uint32_t right = free;
  bool is_stiff = false;
  std::uint32_t second_stiffness = 0;  // coefficients of the second springs
  std::uint32_t second_damping = 0;
  std::array<std::uint32_t, 2> second_left{free,
                                           free};  // hold the first and the second mass by one
  std::array<std::uint32_t, 2> second_right{free, free};  // ...the last and the last but one
};

// Chains folded into the lanes of packs, one voice; everything else number by number.
struct Chains {
  std::vector<Chain> chains;
  std::vector<std::uint32_t> nodes;  // chain by chain
  std::vector<std::uint32_t> loose;  // nodes that move and are in no chain, ascending
  std::vector<std::uint32_t> links;  // those that are no chain's springs, ascending
};

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

inline constexpr std::uint32_t grid_line = 16;  // slots; as many as the widest pack has lanes

// Slots that are `offsets` away from those they are linked to, all of them.
struct GridSegment {
  std::uint32_t first = 0;            // slots, multiples of grid_line
  std::uint32_t count = 0;            //
  std::vector<std::int32_t> offsets;  // at most most_grid_offsets
};

// Links of one run, whose second ends are `offsets` above their first.
struct GridLinks {
  std::uint32_t run = 0;     // of Program::link_runs
  bool is_reversed = false;  // ...or their first above their second
  std::vector<std::uint32_t> offsets;
  std::vector<std::vector<std::uint8_t>> is_linked;  // [offset][slot - Grid::first] from there
};

// Links that fit into nothing, one by one.
struct GridRest {
  std::uint32_t run = 0;    // of Program::link_runs
  std::uint32_t first = 0;  // of Grid::rest_ends
  std::uint32_t count = 0;
  bool is_excess = false;  // taken away from what the segments do instead
};

// A mass outside the grid.
struct GridLoose {
  std::uint32_t mass_run = 0;  // of Program::mass_runs
  std::uint32_t slot = 0;
};

// A network of rows that are alike, one voice. Every node has a slot; those of the grid lie so that
// what is linked is at the same few offsets everywhere, with empty slots where rows end. An empty
// slot is a mass that stays at 0; a ground may lie in several slots, or in none if it is at 0.
//
// With one kind of spring everywhere (`segments` is not empty), a mass feels how far y = K x + Z v
// is from its own at every offset, less what it feels from the `missing` ones. Otherwise the forces
// of each law in `links` are computed one by one, offset by offset.
struct Grid {
  std::uint32_t slots = 0;
  std::uint32_t first = 0;     // slots [first, first + count) are the grid, multiples of grid_line;
  std::uint32_t count = 0;     // no offset reaches below 0 or beyond the last slot
  std::uint32_t mass_run = 0;  // of Program::mass_runs, for all of the grid
  std::vector<std::uint32_t> slot;    // [node]
  std::vector<double> position;       // [slot] at the start
  std::vector<double> velocity;       // [slot]
  std::vector<std::uint8_t> moves;    // [slot - first] 1 where a mass is, 0 elsewhere
  std::uint32_t spring_run = 0;       // of Program::link_runs, for the segments
  std::vector<GridSegment> segments;  // none overlap
  // [slot - first] how many offsets lead to nobody; fewer, by those that hold it at 0 besides
  std::vector<std::int8_t> missing;
  std::vector<GridLinks> links;
  std::vector<GridRest> rest;
  std::vector<std::array<std::uint32_t, 2>> rest_ends;  // slots
  std::vector<std::uint32_t> ports;                     // slots of rest_ends and of force inputs
  std::vector<GridLoose> loose;
};

inline constexpr std::size_t most_grid_offsets = 8;

// A spring of a Batch, if there is one.
struct BatchSpring {
  static constexpr std::uint32_t none = 0xffffffffu;
  std::uint32_t stiffness = none;  // coefficients
  std::uint32_t damping = none;
  std::uint32_t node = none;  // what has no inertia, that an anchor hangs on
};

// Any other link of a Batch.
struct BatchLink {
  std::uint32_t run = 0;  // of Program::link_runs
  std::uint32_t a = 0;    // nodes
  std::uint32_t b = 0;
};

inline constexpr std::uint32_t most_held_masses = 4;
inline constexpr std::uint32_t most_held_pairs = 6;

// A small body in many voices, several packs of them as one. At most most_held_masses masses stay
// in registers, with the springs between any two of them and one anchor each; the links that are
// none of these follow one by one. More masses are stepped in memory, as they are written.
struct Batch {
  std::array<BatchSpring, most_held_pairs> pairs;     // masses (0, 1), (0, 2), (1, 2), (0, 3)...
  std::array<BatchSpring, most_held_masses> anchors;  // [mass]
  std::vector<BatchLink> links;
};

// A large network on several cores: shards of it (sharded.h), each in a form of its own, stepped by
// a executor at the same time.
struct Shard;
class Executor;
struct Shards {
  std::shared_ptr<const std::vector<Shard>> shards;
  Executor* executor = nullptr;  // outlives the kernels
  std::uint32_t frames = 1;      // samples that they go on without each other
};

struct Program;
// Stepped `times` times a sample at a finer rate (oversampled.h), in the form that it has there.
struct Oversampled {
  std::shared_ptr<const Program> fine;  // the same at `times` the rate
  std::uint32_t times = 1;
};

using Form = std::variant<Direct, Chains, Modes, Grid, Batch, Shards, Oversampled>;

}  // namespace ressort::kernels
