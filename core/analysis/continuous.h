// core/analysis: what a linear network means, whatever steps it: M x'' + Z x' + K x = f, solved
// exactly by its modes. Time is counted in samples at 44 100 Hz, as the network's numbers are.
#pragma once

#include <complex>
#include <optional>
#include <span>
#include <vector>

#include "core/model/network.h"

namespace ressort::analysis {

// A partial: e^(pole t).
struct ContinuousMode {
  std::complex<double> pole;  // its imaginary part is not below 0
  double loudness = 0.0;      // as the network starts, against the loudest at the same output
  std::vector<double> shape;  // [mass] a displacement that swings in this mode alone; empty where
                              // the damping is not proportional
  double frequency_hz() const;
  double t60_s() const;
};

// How loud a partial is at an output, and where that output rests.
struct ContinuousOutput {
  struct Term {
    std::complex<double> amplitude;
    std::complex<double> pole;
  };
  std::vector<Term> terms;  // the real parts of amplitude e^(pole t)
  double rest = 0.0;        // what else it does: rest + drift t + fall t^2 / 2
  double drift = 0.0;
  double fall = 0.0;
};

struct Continuous {
  bool is_proportional = true;
  std::vector<ContinuousMode> modes;      // by their frequency; what does not swing is left out
  std::vector<ContinuousOutput> outputs;  // [output of the network]
  std::vector<double> rest;               // [mass] where it comes to rest, if it does
  double energy = 0.0;                    // kinetic, at the start

  // One output, at `step` samples and every `step` on.
  std::vector<double> play(std::size_t output, std::size_t frames, double step) const;
};

inline constexpr std::size_t most_exact_modes = 1200;   // masses, where the damping is proportional
inline constexpr std::size_t most_crossed_modes = 400;  // where it is not

// Of a linear network with no parameter that audio turns, inputs held where they start. Nothing
// where it has too many masses, a mass is not above 0, or its modes do not span all motions: when
// damping is not proportional and exactly critical. O(masses^3). [any thread but audio]
std::optional<Continuous> solve_continuous(const Network& network,
                                           std::span<const double> parameters);

// The factors by which a linear map that takes each column of `before` to that of `after` stretches
// its own vectors: [column][row], both n by n. Nothing where `before` does not span all.
std::vector<std::complex<double>> factors_between(const std::vector<std::vector<double>>& before,
                                                  const std::vector<std::vector<double>>& after);

}  // namespace ressort::analysis
