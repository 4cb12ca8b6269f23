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

// A partial e^(pole t).
struct ContinuousMode {
  std::complex<double> pole;  // The imaginary part is at least 0.
  // Amplitude from the initial state, relative to the loudest at the same output.
  double loudness = 0.0;
  // [mass] Displacement in this mode; empty if the damping is not proportional.
  std::vector<double> shape;
  double frequency_hz() const;
  double t60_s() const;
};

// The amplitudes of the partials at an output, and its rest position.
struct ContinuousOutput {
  struct Term {
    std::complex<double> amplitude;
    std::complex<double> pole;
  };
  std::vector<Term> terms;  // The real parts of amplitude e^(pole t).
  double rest = 0.0;        // Non-oscillating part: rest + drift t + fall t^2 / 2.
  double drift = 0.0;
  double fall = 0.0;
};

struct Continuous {
  bool is_proportional = true;
  std::vector<ContinuousMode> modes;  // Sorted by frequency; non-oscillating motions are left out.
  std::vector<ContinuousOutput> outputs;  // [output of the network]
  std::vector<double> rest;               // [mass] Rest position, if it comes to rest.
  double energy = 0.0;                    // Kinetic energy at the start.

  // Returns one output at samples `step`, 2 `step`, ...
  std::vector<double> play(std::size_t output, std::size_t frames, double step) const;
};

// Largest number of masses with proportional damping.
inline constexpr std::size_t most_exact_modes = 1200;
inline constexpr std::size_t most_crossed_modes = 400;  // The same for non-proportional damping.

// Solves a linear network without parameters at audio rate, with its inputs held at their start.
// Empty if it has too many masses, if a mass is not above 0, or if its modes do not span all
// motions (non-proportional and exactly critical damping). O(masses^3). [any thread but audio]
std::optional<Continuous> solve_continuous(const Network& network,
                                           std::span<const double> parameters);

}  // namespace ressort::analysis
