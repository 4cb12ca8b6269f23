// core/kernels: what of a Program is linear, as its modes see it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "core/kernels/modal/modal_form.h"
#include "core/kernels/program.h"
#include "core/linear_algebra/matrix.h"
#include "core/progress.h"

namespace ressort::kernels {

using linear_algebra::Matrix;
using linear_algebra::Vector;

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
  std::vector<MassShare> pull;  // the force on the masses at 0, for a coefficient of 1
  // Where the frame's eigenvectors are known: of the modes from `first` on; of all others it is 0.
  std::uint32_t first = 0;
  Vector factor;

  // These of all modes.
  Vector part_of(const Vector& modes) const { return modes[std::slice(first, factor.size(), 1)]; }
  void add_to(Vector& modes, const Vector& part) const {
    modes[std::slice(first, factor.size(), 1)] += part;
  }
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

// The eigenvectors of a mixture of all frames in odd shares: where frames share eigenvectors, two
// eigenvalues of it are the same only if they are so in every frame. Masses that no bar ties have
// modes apart, and cost nothing to each other. [any thread but audio]
class Eigenmodes {
 public:
  // O(the sum of size^3) over what is tied together.
  Eigenmodes(const LinearBody& body, const Progress& progress);

  // Fills in each frame's factors. False if an eigenvector is none of a frame's.
  bool measure(std::vector<Frame>& frames, const Progress& progress) const;
  // What a frame, once measured, pulls at its modes where all masses are at 0.
  Vector pull_of(const Frame& frame) const;

  const std::vector<Vector>& shape() const { return shape_; }  // [mass][mode] orthonormal

 private:
  struct Place {
    std::uint32_t group = 0;
    std::uint32_t index = 0;  // within it
    std::uint32_t first_mode = 0;
  };
  // Those that a frame's bars tie.
  std::vector<std::uint32_t> groups_of(const Frame& frame) const;
  void add(Matrix& matrix, const Bar& bar) const;

  const LinearBody& body_;
  std::vector<std::vector<std::uint32_t>> groups_;  // masses
  std::vector<Place> place_;                        // [mass]
  std::vector<Vector> shape_;
};

}  // namespace ressort::kernels
