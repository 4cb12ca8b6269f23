// core/analysis/modes: the modes of a linear network and their level from every input to every
// output.
#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <vector>

#include "core/analysis/modes/linear_system.h"
#include "core/analysis/modes/quadratic.h"
#include "core/linear_algebra/matrix.h"
#include "core/model/network.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::analysis {

// The scheme whose modes are meant: the published scheme at a rate, which the direct form plays, or
// the continuous network M x'' + Z x' + K x = f, which the exact modal form plays.
enum class ModeScheme { published, continuous };

struct NetworkMode {
  double frequency_hz = 0.0;  // Frequency of the damped pole.
  double t60_s = 0.0;         // Infinite if undamped; negative if the mode grows.
  // [input * outputs + output] Amplitude of the partial at the output, at the time of an impulse: a
  // unit force for one sample at a force input, or a unit position for one sample at a position
  // input.
  std::vector<double> levels;
  // [input * outputs + output] The response to that impulse is the imaginary part of residue *
  // e^(pole_of(mu) n), with n = 1 in the sample of the impulse.
  std::vector<std::complex<double>> residues;
  std::complex<double> mu;  // Defined in quadratic.h.
  ComplexVector shape;      // [row of `masses`] Displacement times the square root of the mass.
};

struct NetworkModes {
  std::vector<NetworkMode> modes;  // Sorted by frequency.
  Network network;                 // The network without macros, every argument a number.
  LinearSystem system;             // The linear system of `network`, per step.
  std::size_t inputs = 0;
  std::size_t outputs = 0;  // Counted by number: outputs of equal number are one.
  ModeScheme scheme = ModeScheme::published;
  double rate_hz = 0.0;  // Rate of the published scheme.
  bool is_all = true;    // False if only the lowest modes were found.
  bool is_proportional = true;
  double residual = 0.0;  // Largest residual of a mode, relative to its force.
  double key_factor = 1.0;
  Matrix basis;  // The basis of Swings, if all shapes are known.

  bool is_linear() const { return system.is_linear; }
  // Returns the real displacement of a mass, as in a body with M = 1; 0 if it does not move.
  double displacement(std::size_t mode, std::uint32_t row) const {
    return modes[mode].shape[row].real() / system.root[row];
  }
};

struct ModeOptions {
  double rate_hz = Network::reference_rate_hz;
  ModeScheme scheme = ModeScheme::published;
  std::size_t count =
      0;  // Number of lowest modes; 0: all of up to most_listed_modes masses, else default_modes.
  double key_factor = 1.0;  // Factor of a key on every stiffness that is not fixed.
  Progress progress = {};   // A search that it stops fails with `stopped`.
};

// Largest number of masses for which all modes are found.
inline constexpr std::size_t most_listed_modes = 2000;
inline constexpr std::size_t most_crossing_modes = 300;  // The same for non-proportional damping.
inline constexpr std::size_t default_modes = 100;  // Number of modes found for larger networks.

// The oscillating modes of a system, made for the scheme's step, with these factors on the K and Z
// of its springs; sorted by frequency.
struct FoundSwings {
  Swings swings;
  SparseMatrix stiffness;
  SparseMatrix damping;
  bool is_all = true;
};
Result<FoundSwings> find_swings(const LinearSystem& system, const ModeOptions& options,
                                std::span<const double> stiffness_factors = {},
                                std::span<const double> damping_factors = {});

// scheme_e() returns the e of quadratic.h, 1 for the published scheme and 0 for the continuous
// network. scheme_step() returns the length of a step in samples at 44,100 Hz.
double scheme_e(ModeScheme scheme);
double scheme_step(const ModeOptions& options);

// Returns the logarithm of the growth of a motion per sample.
std::complex<double> pole_of(std::complex<double> mu, ModeScheme scheme);

// Frequency and decay of a motion.
struct ModeTone {
  double frequency_hz = 0.0;
  double t60_s = 0.0;  // Same conventions as NetworkMode.
};
ModeTone tone_of(std::complex<double> mu, const ModeOptions& options);
// Returns the ratio of a shape's change per step to the shape.
std::complex<double> speed_of(std::complex<double> mu, ModeScheme scheme);

// Returns the k below which an eigenvalue of such a matrix is rounding error.
double rigid_below(const SparseMatrix& stiffness);

// Finds the modes of springs, dampers and oscillators. All other links are open, and stiffening
// springs have their stiffness at rest. Motions that do not oscillate (rigid or overdamped) are
// left out. Dense: O(masses^3); for the lowest of many: sparse, by shift-and-invert. Fails if a
// mass is not above 0, a number is not finite, or the links are too dense. [any thread but audio]
Result<NetworkModes> find_modes(const Network& network, std::span<const double> parameters,
                                const ModeOptions& options);

}  // namespace ressort::analysis
