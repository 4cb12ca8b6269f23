// core/analysis/modes: estimates the modes of a network whose parameters are close to those of
// known modes, without solving the eigenproblem again. Pure. [one thread but audio]
#pragma once

#include <complex>
#include <optional>
#include <span>
#include <vector>

#include "core/analysis/modes/modes.h"

namespace ressort::analysis {

// One mode as heard in the mean of all outputs.
struct HeardMode {
  std::complex<double> mu;  // Same as in NetworkMode.
  ModeTone tone;
  std::vector<std::complex<double>> residues;  // [excited input] Same as in NetworkMode.
};

// Returns the known modes as heard when these inputs are excited.
std::vector<HeardMode> heard_modes(const NetworkModes& modes, std::span<const std::size_t> pushed);

class NearbyModes {
 public:
  // Takes all modes of a network, with a basis, as found with `options`. O(shapes * springs)
  NearbyModes(NetworkModes modes, std::vector<std::size_t> pushed, ModeOptions options);

  // Returns the modes by frequency if the system's stiffness and damping have the known
  // eigenvectors, whatever their eigenvalues; else nothing. O(shapes * springs)
  std::optional<std::vector<HeardMode>> exactly(const LinearSystem& system) const;

  // Returns the modes of any system with these rows, correct to first order in the distance of its
  // coefficients: eigenvalues from the known shapes, shapes from the contributions of all others.
  // Empty if degenerate shapes mix, or if a mode starts or stops oscillating. O(shapes * springs);
  // the first call takes O(rows^3).
  std::optional<std::vector<HeardMode>> nearly(const LinearSystem& system);

 private:
  using Complex = std::complex<double>;

  // The effect of a force on a row on the motion of a port in a mode.
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
  // Returns the denominator Q_j for a force on another shape.
  Complex apart(Complex mu, std::size_t other) const;
  bool is_alike(Complex mu, std::size_t other) const;

  ModeOptions options_;
  double e_;
  Matrix basis_;
  LinearSystem system_;
  std::vector<std::size_t> pushed_;
  std::vector<double> stiffness_;           // [shape]
  std::vector<double> damping_;             // [shape]
  std::vector<std::optional<Complex>> mu_;  // [shape] Set for shapes that oscillate.
  std::vector<std::size_t> loud_;           // Indices of shapes.
  std::vector<Answer> answers_;             // [port] The last one is the output.
  std::vector<Alike> alike_;
};

}  // namespace ressort::analysis
