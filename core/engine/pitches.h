// core/engine: tables that translate between frequencies and stiffness factors.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "core/rooms.h"

namespace ressort::engine {

inline constexpr std::size_t key_count = 128;

// [key] frequency in Hz; 0: the key is silent.
using KeyFrequencies = std::array<double, key_count>;

// Returns the frequencies of twelve equal semitones to the octave.
inline KeyFrequencies equal_temperament(double a4_hz, double transpose_semitones) {
  KeyFrequencies hz{};
  for (std::size_t key = 0; key < key_count; ++key) {
    hz[key] = a4_hz * std::exp2((static_cast<double>(key) + transpose_semitones - 69.0) / 12.0);
  }
  return hz;
}

// The factor on every stiffness at which a voice sounds at a given frequency, one entry a semitone
// on the grid of 440 Hz. Values between are interpolated by a cubic polynomial through the
// logarithms of four neighbours. [any thread]
struct Pitches {
  double factor_at(double frequency_hz) const;  // 1 if the table is empty
  double frequency_at(double factor) const;     // inverse, by bisection to rounding
  // Returns the frequency of the table that is nearest to this one.
  double inside(double frequency_hz) const;

  double lowest_hz = 440.0 / 4096.0;
  std::vector<double> factors;  // ascending; empty: no mode is known
};

// The same table at several values of one parameter. The values have equal differences or ratios.
// They form legs of `steps` intervals; the curve may have a kink between two legs, so a cubic
// never crosses a leg's end. [any thread]
struct PitchesAlong {
  static constexpr std::size_t least_steps = 4;

  double factor_at(double frequency_hz, double value) const;
  double value_at(std::size_t index) const;

  std::size_t parameter = 0;
  double start = 1.0;  // the parameter's value at the start
  double lowest = 1.0;
  double highest = 2.0;
  bool by_ratios = false;
  std::size_t legs = 1;
  std::size_t steps = least_steps;  // steps in a leg
  std::vector<Pitches> at;          // empty: keys are tuned at the parameters' initial values
};

}  // namespace ressort::engine
