// core/analysis: the continuous network M x'' + Z x' + K x = f that a linear model describes,
// solved exactly by its modes: the reference solution for every discretisation. Time is in samples
// at 44,100 Hz, as in the network's coefficients.
#pragma once

#include <complex>
#include <optional>
#include <span>
#include <vector>

#include "core/model/network.h"

namespace ressort::analysis {

// An output as a sum of partials e^(pole t), and its rest position.
struct ContinuousOutput {
  struct Term {
    std::complex<double> amplitude;
    std::complex<double> pole;  // The imaginary part is at least 0.
  };
  // Returns the output at samples `step`, 2 `step`, ...
  std::vector<double> play(std::size_t frames, double step) const;

  std::vector<Term> terms;  // The real parts of amplitude e^(pole t).
  double rest = 0.0;        // Non-oscillating part: rest + drift t + fall t^2 / 2.
  double drift = 0.0;
  double fall = 0.0;
};

// Largest number of masses with proportional damping.
inline constexpr std::size_t most_exact_modes = 1200;
inline constexpr std::size_t most_crossed_modes = 400;  // The same for non-proportional damping.

// Solves a linear network without parameters at audio rate, with its inputs held at their start.
// Returns [output of the network]; empty if it has too many masses, if a mass is not above 0, or if
// its damping is not proportional and some motions do not oscillate. O(masses^3). [any thread but
// audio]
std::optional<std::vector<ContinuousOutput>> solve_continuous(const Network& network,
                                                              std::span<const double> parameters);

}  // namespace ressort::analysis
