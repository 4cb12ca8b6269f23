// core/kernels: what of a Program is linear, as its modes see it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "core/kernels/program.h"
#include "core/linear_algebra/matrix.h"

namespace ressort {

// A share of a mass, or of any node, in a sum.
struct MassShare {
  std::uint32_t mass = 0;
  double weight = 1.0;
};

// Where a node is: the sum of weight * x over masses, and of what does not move.
struct Readout {
  std::vector<MassShare> shares;  // each mass once; none: it does not move
  double offset = 0.0;
};

// A spring or a damper, that pulls by how far the sum of its shares is from `position`.
struct Bar {
  std::vector<MassShare> shares;  // none: between what does not move
  double weight = 1.0;            // of its frame's coefficient
  double position = 0.0;
};

// All bars that one coefficient stiffens.
struct Frame {
  std::uint32_t coefficient = 0;
  bool is_late = false;  // links exert what they computed one tick before
  std::vector<Bar> bars;
  Vector pull;    // [mass] the force on the masses at 0, for a coefficient of 1
  Vector factor;  // [mode] where the frame's eigenvectors are known
};

struct LinearBody {
  static constexpr std::uint32_t nowhere = 0xffffffffu;

  std::uint32_t count = 0;                     // masses
  std::vector<bool> is_live;                   // [coefficient] does a parameter move it?
  std::vector<double> value;                   // [coefficient] at the start
  std::vector<std::uint32_t> input;            // [node] that moves it, or nowhere
  std::vector<Readout> readout;                // [node]
  std::vector<std::vector<MassShare>> around;  // [node] itself, or the nodes around a place
  std::uint32_t inverse_mass = 0;              // the coefficient that all share, or Modes::own_mass
  Vector root;  // [mass] of its inverse, relative to that coefficient
  std::vector<Frame> stiffness;
  std::vector<Frame> damping;

  bool moves(std::uint32_t node) const { return !readout[node].shares.empty(); }
  bool is_nothing(std::uint32_t c) const { return !is_live[c] && value[c] == 0.0; }
  // The inverse mass that roots are relative to, at the start.
  double weight() const { return inverse_mass == 0xffffffffu ? 1.0 : value[inverse_mass]; }
  // What a force on a node does to each mass.
  Vector force_at(std::uint32_t node) const;
};

// What is exerted at a node by links and inputs, with the parts' shapes as sums over masses. `rest`
// is where masses are that do not move, [mass]; `held` the ends of nonlinear links, [node].
struct FeltForce {
  ModalForce force;
  std::vector<std::vector<MassShare>> shares;  // [part]
};
FeltForce force_felt(const Program& program, const LinearBody& body, std::uint32_t node,
                     const Vector& rest, const std::map<std::uint32_t, std::uint32_t>& held);

// Nothing where no modes can tell how a Program moves: parameters turn its masses one by one or
// move a place on a macro, a ground claims a velocity, there are too many frames of one coefficient
// each. Of a body's modes the numbers are those of the continuous network if the modes are to be
// exact, else those that the published scheme steps. O(links).
std::optional<LinearBody> linear_body(const Program& program, bool is_exact);

// How many masses the most hang together that linear links tie: the eigenvectors of so many are to
// be found. Those of a body are known. O(links) [any thread but audio]
std::uint32_t most_tied_masses(const Program& program);

// [group] masses. What no linear link ties to each other has modes of its own: those of a body are
// its modes already. O(masses + bars) [any thread but audio]
std::vector<std::vector<std::uint32_t>> tied_together(const LinearBody& body);

}  // namespace ressort
