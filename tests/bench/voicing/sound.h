// tests: measurements of a sound, from its samples only.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace ressort::voicing {

// Two channels at full scale 1, before any limiter.
struct Stereo {
  std::array<std::vector<double>, 2> channels;
  double rate_hz = 48000.0;
  std::size_t size() const { return channels[0].size(); }
  std::vector<double> sum() const;  // (left + right) / 2
  Stereo part(double from_s, double to_s) const;
};

inline constexpr std::size_t block_frames = 256;
inline constexpr double silence_db = -60.0;
inline constexpr double most_offset_db = -60.0;

double decibels(double ratio);  // 20 log10, at least -200

double peak_of(const Stereo& sound);
bool is_finite(const Stereo& sound);

// Returns the DC offset of the louder channel, under a Hann window, which suppresses audible
// frequencies.
double offset_of(const Stereo& sound);

// Integrated loudness by ITU-R BS.1770, gated, computed by libebur128.
double loudness_lufs(const Stereo& sound);

double correlation_of(const Stereo& sound);
// Ratio of the energy of the mono sum to the mean of the channels.
double mono_loss_db(const Stereo& sound);

// Returns the time until the energy of 5 ms comes within 3 dB of the maximum of the first second,
// or, if `steady`, of the median from half a second on.
double attack_s(const Stereo& sound, bool steady);

// Returns the T60 from the slope of Schroeder's backward integral between -5 and -25 dB,
// extrapolated to -60 dB. A steady noise gives infinity.
double t60_s(const Stereo& sound);

// Spectral centroid of the magnitudes from 20 Hz to 16 kHz.
double centroid_hz(const Stereo& sound);

// Frequencies that a listener could hear as the pitch.
struct Pitch {
  double partial_hz = 0.0;   // the peak nearest to the requested frequency
  double heard_hz = 0.0;     // the frequency with the strongest harmonics, between 20 Hz and 5 kHz
  double level_db = -200.0;  // level of the partial relative to the strongest one
};

// Finds the pitch from the spectrum under a Hann window. Golden-section search refines the peaks to
// rounding precision.
Pitch pitch_of(const Stereo& sound, double wanted_hz);

// Passes both channels through a band around a frequency: a Gaussian with a standard deviation of
// `width` of it, without a phase shift.
Stereo band_around(const Stereo& sound, double hz, double width);

// Returns the pitch by YIN (de Cheveigne and Kawahara 2002) between two frequencies: the first dip
// of the normalised difference function below 0.1, else its lowest point. Multiples of the period
// sharpen the result.
double yin_hz(const Stereo& sound, double lowest_hz, double highest_hz);

// Deviation of a sound's partials from a key, and the stiffness of the string that they fit.
struct PartialsPitch {
  double cents = 0.0;
  double stiffness = 0.0;  // B: partial n is at n sqrt(1 + B n^2), of a harmonic sound 0
  int strongest = 1;
};

// Returns how far partial n of a stiff string is above n times the first (Fletcher 1964).
double stretch_cents(int n, double stiffness);

// Measures the first eight partials, weighted by their powers. A partial lies within half a
// semitone of its harmonic. Tuning devices for pianos do the same: they find B from the partials of
// the string, and subtract its stretch from every partial.
PartialsPitch partials_pitch(const Stereo& sound, double wanted_hz);

double cents(double hz, double from_hz);

}  // namespace ressort::voicing
