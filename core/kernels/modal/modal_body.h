// core/kernels: the linear part of a Program and its eigenvectors.
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

// A term of a weighted sum over masses or nodes.
struct MassShare {
  std::uint32_t mass = 0;
  double weight = 1.0;
};

// The position of a node as a weighted sum over masses plus a constant.
struct Readout {
  std::vector<MassShare> shares;  // each mass once; empty: it does not move
  double offset = 0.0;
};

// A spring or damper. Its force is proportional to the distance of the sum of its shares from
// `position`.
struct Bar {
  std::vector<MassShare> shares;  // empty: both ends are fixed
  double weight = 1.0;            // factor of its frame's coefficient
  double position = 0.0;
};

// All bars with the same coefficient.
struct Frame {
  std::uint32_t coefficient = 0;
  bool is_late = false;  // links act one sample late
  std::vector<Bar> bars;
  std::vector<MassShare> pull;  // the force on the masses at 0, for a coefficient of 1
  // Once measured: the eigenvalues of the frame, for the modes from `first` on; 0 for all others.
  std::uint32_t first = 0;
  Vector factor;

  // Returns these elements of a vector over all modes.
  Vector part_of(const Vector& modes) const { return modes[std::slice(first, factor.size(), 1)]; }
  void add_to(Vector& modes, const Vector& part) const {
    modes[std::slice(first, factor.size(), 1)] += part;
  }
};

// The linear network: its masses, springs and dampers.
struct LinearBody {
  static constexpr std::uint32_t nowhere = 0xffffffffu;

  std::uint32_t count = 0;                     // masses
  std::vector<bool> is_live;                   // [coefficient] depends on a parameter
  std::vector<double> value;                   // [coefficient] at the start
  std::vector<std::uint32_t> input;            // [node] input that moves it, or nowhere
  std::vector<Readout> readout;                // [node]
  std::vector<std::vector<MassShare>> around;  // [node] itself, or the nodes around a point
  std::uint32_t inverse_mass = 0;  // the coefficient that all masses share, or Modes::own_mass
  Vector root;  // [mass] square root of its inverse mass, relative to that coefficient
  std::vector<Frame> stiffness;
  std::vector<Frame> damping;

  bool moves(std::uint32_t node) const { return !readout[node].shares.empty(); }
  bool is_nothing(std::uint32_t c) const { return !is_live[c] && value[c] == 0.0; }
  // Returns the inverse mass that roots are relative to, at the start.
  double weight() const { return inverse_mass == 0xffffffffu ? 1.0 : value[inverse_mass]; }
  // Returns the share of a force on a node that acts on each mass.
  Vector force_at(std::uint32_t node) const;
};

// The force of links and inputs at a node, with the shapes of its parts as sums over masses. `rest`
// is the position of masses at rest, [mass]; `held` has the ends of nonlinear links, [node].
struct FeltForce {
  ModalForce force;
  std::vector<std::vector<MassShare>> shares;  // [part]
};
FeltForce force_felt(const Program& program, const LinearBody& body, std::uint32_t node,
                     const Vector& rest, const std::map<std::uint32_t, std::uint32_t>& held);

// Extracts the linear network of a Program. Empty if its motion is not a sum of modes: if
// parameters change masses separately or move a point on a macro, if a ground has a velocity, or if
// there are too many frames. The modes of bodies have the numbers of the continuous network if
// `is_exact`, else those of the published scheme. O(links).
std::optional<LinearBody> linear_body(const Program& program, bool is_exact);

// Returns the size of the largest group of masses that linear links connect, whose eigenvectors
// have to be computed. Those of a body are known. O(links) [any thread but audio]
std::uint32_t most_tied_masses(const Program& program);

// Returns the connected groups of masses, which have separate modes. A mode of a body is a group of
// its own. O(masses + bars) [any thread but audio]
std::vector<std::vector<std::uint32_t>> tied_together(const LinearBody& body);

// The common eigenvectors of all frames, as the eigenvectors of a weighted sum of the frames. The
// weights are chosen such that two eigenvalues of the sum are equal only if they are equal in every
// frame. Groups that no bar connects are solved separately. [any thread but audio]
class Eigenmodes {
 public:
  // O(sum of size^3) over the groups.
  Eigenmodes(const LinearBody& body, const Progress& progress);

  // Computes the eigenvalues of each frame. Returns false if a frame does not have these
  // eigenvectors.
  bool measure(std::vector<Frame>& frames, const Progress& progress) const;
  // Returns the force of a measured frame on its modes with all masses at 0.
  Vector pull_of(const Frame& frame) const;

  const std::vector<Vector>& shape() const { return shape_; }  // [mass][mode] orthonormal

 private:
  struct Place {
    std::uint32_t group = 0;
    std::uint32_t index = 0;  // within it
    std::uint32_t first_mode = 0;
  };
  // Returns the groups that a frame acts on.
  std::vector<std::uint32_t> groups_of(const Frame& frame) const;
  void add(Matrix& matrix, const Bar& bar) const;

  const LinearBody& body_;
  std::vector<std::vector<std::uint32_t>> groups_;  // masses
  std::vector<Place> place_;                        // [mass]
  std::vector<Vector> shape_;
};

}  // namespace ressort::kernels
