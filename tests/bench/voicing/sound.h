// tests: what a sound measures, by nothing but the sound.
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

double decibels(double ratio);  // 20 log10, at least -200

double peak_of(const Stereo& sound);
bool is_finite(const Stereo& sound);

// Of the louder channel under a Hann window, which keeps what is heard out of it.
double offset_of(const Stereo& sound);

// Integrated loudness after ITU-R BS.1770, gated, by libebur128.
double loudness_lufs(const Stereo& sound);

double correlation_of(const Stereo& sound);
double mono_loss_db(const Stereo& sound);  // of the sum's energy against the channels' mean

// Until the energy of 5 ms comes within 3 dB of the largest of the first second, or of `steady`: of
// the median from half a second on.
double attack_s(const Stereo& sound, bool steady);

// From the slope of Schroeder's backward integral between -5 and -25 dB, continued to -60 dB; the
// noise of a sound that does not decay gives infinity.
double t60_s(const Stereo& sound);

// The centre of gravity of the magnitude spectrum from 20 Hz to 16 kHz.
double centroid_hz(const Stereo& sound);

// What an ear could take for the pitch.
struct Pitch {
  double partial_hz = 0.0;   // the peak nearest to the frequency that was asked for
  double heard_hz = 0.0;     // whose harmonics have the most to say, between 20 Hz and 5 kHz
  double level_db = -200.0;  // of the partial, to the strongest one
};

// By the spectrum under a Hann window, its peaks refined by golden sections to the rounding.
Pitch pitch_of(const Stereo& sound, double wanted_hz);

double cents(double hz, double from_hz);

}  // namespace ressort::voicing
