// core/analysis/modes: all that a linear network can sound: its modes, and how loud each is from
// every input at every output.
#pragma once

#include <complex>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/analysis/modes/linear_system.h"
#include "core/analysis/modes/quadratic.h"
#include "core/linear_algebra/matrix.h"
#include "core/model/network.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::analysis {

// Whose modes: those of the published scheme at a rate, which is what plays in the direct form, or
// of the continuous network M x'' + Z x' + K x = f, which plays where modes do.
enum class ModeScheme { published, continuous };

struct NetworkMode {
  double frequency_hz = 0.0;  // of the damped pole
  double t60_s = 0.0;         // infinity where nothing damps it; below 0 where it grows
  // [input * outputs + output] Amplitude of the partial at the output, at the time of an impulse: a
  // force of 1 for one sample at a force input; a position of 1 for one sample at a position input.
  std::vector<double> levels;
  // [the same] The sound of that impulse is the imaginary part of residue * e^(pole_of(mu) n),
  // n from 1 for the sample in which it comes.
  std::vector<std::complex<double>> residues;
  std::complex<double> mu;  // as in quadratic.h
  ComplexVector shape;      // [row of `masses`] displacement, times the root of the mass
};

struct NetworkModes {
  std::vector<NetworkMode> modes;  // by their frequency
  Network network;                 // without macros, every argument a number
  LinearSystem system;             // of it, per step
  std::size_t inputs = 0;
  std::size_t outputs = 0;  // numbers of them: those of one number are one
  ModeScheme scheme = ModeScheme::published;
  double rate_hz = 0.0;  // of the published scheme
  bool is_all = true;    // else these are the lowest
  bool is_proportional = true;
  double residual = 0.0;  // the largest share of a mode's own force that is left over
  double key_factor = 1.0;
  Matrix basis;  // as of Swings, where all shapes are known

  bool is_linear() const { return system.is_linear; }
  // Real displacement of a mass, as a body of M = 1 has it; 0 where it does not move.
  double displacement(std::size_t mode, std::uint32_t row) const {
    return modes[mode].shape[row].real() / system.root[row];
  }
};

struct ModeOptions {
  double rate_hz = Network::reference_rate_hz;
  ModeScheme scheme = ModeScheme::published;
  std::size_t count =
      0;  // of the lowest; 0: all up to most_listed_modes masses, else default_modes
  double key_factor = 1.0;  // on every stiffness that is not fixed, as a key has it
  Progress progress = {};   // a search that it stops fails with `stopped`
};

inline constexpr std::size_t most_listed_modes = 2000;   // masses whose modes are all found
inline constexpr std::size_t most_crossing_modes = 300;  // where damping is not proportional
inline constexpr std::size_t default_modes = 100;        // of larger networks

// What swings in a system, made for the scheme's step, whose springs have these factors on their K
// and Z, by frequency.
struct FoundSwings {
  Swings swings;
  SparseMatrix stiffness;
  SparseMatrix damping;
  bool is_all = true;
};
Result<FoundSwings> find_swings(const LinearSystem& system, const ModeOptions& options,
                                std::span<const double> stiffness_factors = {},
                                std::span<const double> damping_factors = {});

// 1 for the published scheme, 0 for the continuous network: the e of quadratic.h; and how many
// times longer a step is than a sample at 44 100 Hz.
double scheme_e(ModeScheme scheme);
double scheme_step(const ModeOptions& options);

// The logarithm of what a motion grows by in a sample.
std::complex<double> pole_of(std::complex<double> mu, ModeScheme scheme);

// What a motion sounds like.
struct ModeTone {
  double frequency_hz = 0.0;
  double t60_s = 0.0;  // as of NetworkMode
};
ModeTone tone_of(std::complex<double> mu, const ModeOptions& options);
// How a shape changes in a step, of what it is.
std::complex<double> speed_of(std::complex<double> mu, ModeScheme scheme);

// A k below which nothing is sprung, among such numbers: rounding.
double rigid_below(const SparseMatrix& stiffness);

// Of springs, dampers and oscillators; what else there is is open, and springs that stiffen are as
// they are at rest. Motions that do not swing (rigid, or damped beyond swinging) are left out.
// Dense: O(masses^3); the lowest of many: sparse, with shift and invert. Fails where a mass is not
// above 0, a number is not finite, or masses hang together in too many ways. [any thread but audio]
Result<NetworkModes> find_modes(const Network& network, std::span<const double> parameters,
                                const ModeOptions& options);

}  // namespace ressort::analysis
