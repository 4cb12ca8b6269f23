// core/analysis/timbre: descriptors of a spectrum, of partials and of an envelope, as single
// numbers. Pure. A descriptor that does not exist for a sound is absent; no result is NaN. [any
// thread]
//
// Definitions: Peeters, Giordano, Susini, Misdariis and McAdams 2011, "The Timbre Toolbox", J.
// Acoust. Soc. Am. 130, with frequencies in Hz. a are amplitudes or powers, as the caller supplies
// them, and p = a / sum a. Differences from other programs:
//  spread    is the standard deviation; aubio and zsa give its square, the variance
//  slope     uses p, in 1/Hz; the Toolbox R2021a uses a
//  decrease  is Peeters' sum; Essentia uses the name for a plain regression
//  rolloff   uses 95 % of the energy; librosa and Essentia use 85 %
//  crest     is largest over mean; the Toolbox R2021a uses largest over sum
//  inharmonicity  has the factor 2; Essentia has none
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/rooms.h"

namespace ressort::analysis {

// The kind of values in a spectrum: amplitudes, or their squares.
enum class SpectrumKind { magnitude, power };

struct SpectralShape {
  double centroid_hz = 0.0;        // sum f p
  double spread_hz = 0.0;          // Square root of sum (f - centroid)^2 p.
  std::optional<double> skewness;  // sum (f - centroid)^3 p / spread^3; absent if spread is 0.
  // The same with exponent 4; 3 for a Gaussian. Absent if spread is 0.
  std::optional<double> kurtosis;
  // 1/Hz, slope of the regression line through p; absent for one frequency.
  std::optional<double> slope;
  std::optional<double>
      decrease;  // sum (a_k - a_1)/(k - 1) / sum a_k, k from 2; absent if the denominator is 0.
  double rolloff95_hz = 0.0;  // Lowest f with 95 % of the energy at or below it.
  double flatness = 0.0;      // Geometric over arithmetic mean of a: 0 to 1.
  double crest = 0.0;         // Largest over mean of a: 1 to the number of frequencies.
  double entropy = 0.0;       // -sum p log p / log N: 0 to 1; 0 for one frequency.
};

// Computes the shape of amplitudes or powers at ascending frequencies. Empty for silence, an empty
// spectrum, and values that are below 0 or not finite. O(frequencies)
std::optional<SpectralShape> spectral_shape(std::span<const double> frequencies_hz,
                                            std::span<const double> spectrum, SpectrumKind kind);

// Returns 1 minus the cosine similarity of two spectra of equal length, 0 to 1 (spectral
// variation). Empty if one is silent.
std::optional<double> spectral_flux(std::span<const double> before, std::span<const double> after);

struct Partial {
  double frequency_hz = 0.0;
  double amplitude = 0.0;  // Amplitude, not power, for either kind of spectrum.
};

struct HarmonicShape {
  double inharmonicity = 0.0;           // (2 / f0) sum |f_h - h f0| a_h^2 / sum a_h^2.
  std::optional<double> odd_to_even;    // Energy ratio; absent if there are no even harmonics.
  std::array<double, 3> tristimulus{};  // a_1, a_2 to a_4, and a_5 and above, over the sum of all.
  // Mean of |a_h - mean of it and its neighbours|; the first harmonic counts as it is, and the last
  // has one neighbour. Scales with the sound's level.
  double harmonic_deviation = 0.0;
};

// Computes the shape of partials sorted by harmonic number h from 1; a missing one has amplitude 0.
// Empty if all are silent or f0 is not above 0. O(partials)
std::optional<HarmonicShape> harmonic_shape(std::span<const Partial> partials, double f0_hz);

// Returns the harmonics of f0 in order: for each h the loudest of the partials nearest to h f0, or
// an amplitude of 0 at h f0. O(partials + most)
std::vector<Partial> harmonics_of(std::span<const Partial> partials, double f0_hz,
                                  std::size_t most = 20);

// Returns the share of a frame's energy outside its harmonics, 0 to 1. `energy` is the sum of the
// squares of all its amplitudes. Empty if that is 0.
std::optional<double> noisiness(std::span<const Partial> harmonics, double energy);

struct TemporalShape {
  // log10 of the attack time in s, by the weakest-effort method: thresholds at 10 to 100 % of the
  // largest value; M is the mean effort of the steps from 30 to 60 %. The attack starts after the
  // last step below 40 % and ends before the first step from 50 % whose effort exceeds 3 M.
  // Threshold crossings are interpolated linearly. At least one sample.
  double log_attack_time = 0.0;
  // s, the same in a differentiable form: a step close to 3 M counts in part.
  double smooth_attack_s = 0.0;
  // sum t e / sum e over the whole envelope, from its first sample.
  double temporal_centroid_s = 0.0;
  // Time from the first to the last sample above 40 % of the largest value.
  double effective_duration_s = 0.0;
  // 1/s, slope of the regression line through ln e from the largest value to the last above 40 %;
  // absent for one sample. T60 = -6.91 / slope.
  std::optional<double> decay_slope;
};

// First pass over an envelope, which may be hours long: sums and maximum.
class EnvelopeSums {
 public:
  void add(double value);

  double largest() const { return largest_; }
  std::size_t largest_at() const { return largest_at_; }  // First occurrence.
  double centroid() const { return moment_ / sum_; }      // Samples.

 private:
  std::size_t count_ = 0;
  double sum_ = 0.0;
  double moment_ = 0.0;
  double largest_ = 0.0;
  std::size_t largest_at_ = 0;
};

// Second pass over the same envelope: rise and decay times.
class EnvelopeTimes {
 public:
  explicit EnvelopeTimes(const EnvelopeSums& sums) : sums_(sums) {}
  void add(double value);
  // Empty for silence.
  std::optional<TemporalShape> shape(double rate_hz) const;

 private:
  struct Line {  // Regression sums of y over t, both relative to the largest value.
    double count = 0.0;
    double t = 0.0;
    double y = 0.0;
    double tt = 0.0;
    double ty = 0.0;
  };

  EnvelopeSums sums_;
  std::size_t count_ = 0;
  double attack(double softness) const;  // Samples.

  std::array<double, 10> reached_{};  // [tenth] First crossing, in samples.
  std::size_t tenths_ = 0;            // Number of thresholds crossed.
  double share_ = 0.0;                // Last value, relative to the largest.
  std::optional<std::size_t> first_above_;
  std::size_t last_above_ = 0;
  Line so_far_;
  Line decay_;  // Value of `so_far_` at `last_above_`.
};

// Runs both passes over an envelope in memory. Empty for silence, and for values below 0 or not
// finite.
std::optional<TemporalShape> temporal_shape(std::span<const double> envelope, double rate_hz);

}  // namespace ressort::analysis
