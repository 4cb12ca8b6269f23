// core/analysis/timbre: what a spectrum, a row of partials and an envelope are like, as single
// numbers. Pure; what a sound does not have is absent, and nothing is ever NaN. [any thread]
//
// Definitions: Peeters, Giordano, Susini, Misdariis and McAdams 2011, "The Timbre Toolbox",
// J. Acoust. Soc. Am. 130, with frequencies in Hz. a are amplitudes or powers as the caller has
// them, p = a / sum a. Where others differ:
//   spread    the standard deviation; aubio and zsa tell its square, the variance
//   slope     of p, in 1/Hz; the Toolbox R2021a takes that of a
//   decrease  Peeters' sum; Essentia calls a plain regression so
//   rolloff   95 % of the energy; librosa and Essentia have 85 %
//   crest     largest over mean; the Toolbox R2021a has largest over sum
//   inharmonicity  with the factor 2; Essentia has none
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/rooms.h"

namespace ressort::analysis {

// What the numbers of a spectrum are: amplitudes, or their squares.
enum class SpectrumKind { magnitude, power };

struct SpectralShape {
  double centroid_hz = 0.0;        // sum f p
  double spread_hz = 0.0;          // root of sum (f - centroid)^2 p
  std::optional<double> skewness;  // sum (f - centroid)^3 p / spread^3; none where spread is 0
  std::optional<double> kurtosis;  // with 4 for 3: 3 of a bell curve; none where spread is 0
  std::optional<double> slope;     // 1/Hz, of the line through p; none of one frequency
  std::optional<double>
      decrease;               // sum (a_k - a_1)/(k - 1) / sum a_k, k from 2; none where that is 0
  double rolloff95_hz = 0.0;  // the least f below and at which 95 % of the energy is
  double flatness = 0.0;      // geometric over arithmetic mean of a: 0 to 1
  double crest = 0.0;         // largest over mean of a: 1 to the number of frequencies
  double entropy = 0.0;       // - sum p log p / log N: 0 to 1; 0 of one frequency
};

// Of amplitudes or powers at ascending frequencies. Nothing of silence, of an empty spectrum, and
// of numbers that are below 0 or not finite. O(frequencies)
std::optional<SpectralShape> spectral_shape(std::span<const double> frequencies_hz,
                                            std::span<const double> spectrum, SpectrumKind kind);

// How much two spectra of one length differ in shape: 1 less the cosine between them, 0 to 1
// (spectral variation). Nothing where one is silent.
std::optional<double> spectral_flux(std::span<const double> before, std::span<const double> after);

struct Partial {
  double frequency_hz = 0.0;
  double amplitude = 0.0;  // not its power, whatever the spectrum was
};

struct HarmonicShape {
  double inharmonicity = 0.0;           // (2 / f0) sum |f_h - h f0| a_h^2 / sum a_h^2
  std::optional<double> odd_to_even;    // of energy; none where there are no even ones
  std::array<double, 3> tristimulus{};  // a_1, a_2 to a_4, a_5 and above, over the sum of all
  // Mean of |a_h - the mean of it and its neighbours|, of which the first counts as it is and the
  // last has one: as loud as the sound is.
  double harmonic_deviation = 0.0;
};

// Of partials in the order of their number h, from 1: one that is missing has an amplitude of 0.
// Nothing where all are silent, or f0 is not above 0. O(partials)
std::optional<HarmonicShape> harmonic_shape(std::span<const Partial> partials, double f0_hz);

// The harmonics of f0 among these partials, in the order of their number: of those nearest to
// h f0 the loudest, and one of amplitude 0 at h f0 where there is none. O(partials + most)
std::vector<Partial> harmonics_of(std::span<const Partial> partials, double f0_hz,
                                  std::size_t most = 20);

// The share of a frame's energy that is in none of its harmonics, 0 to 1. `energy` is the sum of
// the squares of all its amplitudes. Nothing where it is 0.
std::optional<double> noisiness(std::span<const Partial> harmonics, double energy);

struct TemporalShape {
  // log10 of the attack in s, by the weakest effort: thresholds of 10 to 100 % of the largest, the
  // mean effort M that of the steps from 30 to 60 %. It starts after the last step below 40 %, and
  // ends before the first from 50 %, that takes more than 3 M. Thresholds are crossed between
  // samples, on a line. At least one sample.
  double log_attack_time = 0.0;
  // s, the same in a form that has a slope: a step that takes nearly 3 M counts in part.
  double smooth_attack_s = 0.0;
  double temporal_centroid_s = 0.0;   // sum t e / sum e, of all of it, from its first sample
  double effective_duration_s = 0.0;  // from the first to the last above 40 % of the largest
  // 1/s, of the line through ln e from the largest to the last above 40 %; none of one sample.
  // T60 is -6.91 / it.
  std::optional<double> decay_slope;
};

// The first pass over an envelope, which may be of hours: what all of it comes to.
class EnvelopeSums {
 public:
  void add(double value);

  double largest() const { return largest_; }
  std::size_t largest_at() const { return largest_at_; }  // the first
  double centroid() const { return moment_ / sum_; }      // in samples

 private:
  std::size_t count_ = 0;
  double sum_ = 0.0;
  double moment_ = 0.0;
  double largest_ = 0.0;
  std::size_t largest_at_ = 0;
};

// The second one, over the same numbers: when it rises and falls.
class EnvelopeTimes {
 public:
  explicit EnvelopeTimes(const EnvelopeSums& sums) : sums_(sums) {}
  void add(double value);
  // Nothing of silence.
  std::optional<TemporalShape> shape(double rate_hz) const;

 private:
  struct Line {  // of y over t, both from the largest on
    double count = 0.0;
    double t = 0.0;
    double y = 0.0;
    double tt = 0.0;
    double ty = 0.0;
  };

  EnvelopeSums sums_;
  std::size_t count_ = 0;
  double attack(double softness) const;  // in samples

  std::array<double, 10> reached_{};  // [tenth] when for the first time, in samples
  std::size_t tenths_ = 0;            // so many have been
  double share_ = 0.0;                // of the largest, the last
  std::optional<std::size_t> first_above_;
  std::size_t last_above_ = 0;
  Line so_far_;
  Line decay_;  // what `so_far_` was at `last_above_`
};

// Both, of an envelope in memory. Nothing of silence, and of numbers below 0 or not finite.
std::optional<TemporalShape> temporal_shape(std::span<const double> envelope, double rate_hz);

}  // namespace ressort::analysis
