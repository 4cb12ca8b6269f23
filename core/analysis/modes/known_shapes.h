// core/analysis/modes: the modes of a network whose parameters changed, from the shapes that are
// known, without solving the eigenproblem again. Pure. [one thread but audio]
#pragma once

#include <complex>
#include <cstdint>
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

class KnownShapes {
 public:
  // Takes all modes of a network, with a basis, as found with `options`. O(shapes * springs)
  KnownShapes(NetworkModes modes, std::vector<std::size_t> pushed, ModeOptions options);

  // Returns the modes by frequency if the system's stiffness and damping have the known
  // eigenvectors, whatever their eigenvalues; else nothing. O(shapes * springs)
  std::optional<std::vector<HeardMode>> modes_of(const LinearSystem& system) const;

 private:
  std::vector<ModalPort> ports_of(const LinearSystem& system) const;

  ModeOptions options_;
  Matrix basis_;
  std::vector<std::uint32_t> masses_;  // [row]
  std::vector<std::size_t> pushed_;
};

}  // namespace ressort::analysis
