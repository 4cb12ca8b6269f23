// core/analysis/modes: how a network swings whose numbers are not those of the modes that are
// known, without finding these anew. Pure. [one thread but audio]
#pragma once

#include <complex>
#include <optional>
#include <span>
#include <vector>

#include "core/analysis/modes/modes.h"

namespace ressort::analysis {

// One motion, as the mean of all outputs hears it.
struct HeardMode {
  std::complex<double> mu;  // as of NetworkMode
  ModeTone tone;
  std::vector<std::complex<double>> residues;  // [pushed input] as of NetworkMode
};

// Of modes that are known, when these inputs are pushed.
std::vector<HeardMode> heard_modes(const NetworkModes& modes, std::span<const std::size_t> pushed);

class NearbyModes {
 public:
  // Of all modes of a network, with a basis, as `options` found them. O(shapes * springs)
  NearbyModes(NetworkModes modes, std::vector<std::size_t> pushed, ModeOptions options);

  // By frequency, where the system's stiffness and damping have the eigenvectors that are known,
  // whatever their eigenvalues are; else nothing. O(shapes * springs)
  std::optional<std::vector<HeardMode>> exactly(const LinearSystem& system) const;

  // Of any system of these rows, right to first order in how far its numbers are from those of the
  // modes: eigenvalues by the shapes that are known, shapes by what all others add. Nothing where
  // shapes of one frequency cross over into each other, or one begins or ends to swing.
  // O(shapes * springs); the first time O(rows^3)
  std::optional<std::vector<HeardMode>> nearly(const LinearSystem& system);

 private:
  using Complex = std::complex<double>;

  // What a force on a row does to how a port moves in a mode.
  struct Answer {
    Matrix real;  // [row, loud shape]
    Matrix imaginary;
  };
  struct Alike {
    std::size_t loud = 0;   // index into `loud_`
    std::size_t other = 0;  // shape
  };

  bool has_rows_of(const LinearSystem& system) const;
  const double* shape(std::size_t i) const { return &basis_.values[i * basis_.rows()]; }
  std::vector<ModalPort> ports_of(const LinearSystem& system) const;
  HeardMode mode_of(Complex mu, std::span<const Complex> moved) const;
  void prepare();
  Answer answer_of(const ModalPort& port) const;
  Complex apart(Complex mu, std::size_t other) const;  // what a force on another shape meets there
  bool is_alike(Complex mu, std::size_t other) const;

  ModeOptions options_;
  double e_;
  Matrix basis_;
  LinearSystem system_;
  std::vector<std::size_t> pushed_;
  std::vector<double> stiffness_;           // [shape]
  std::vector<double> damping_;             // [shape]
  std::vector<std::optional<Complex>> mu_;  // [shape] of what swings
  std::vector<std::size_t> loud_;           // shapes
  std::vector<Answer> answers_;             // [port] of which the last is what is heard
  std::vector<Alike> alike_;
};

}  // namespace ressort::analysis
