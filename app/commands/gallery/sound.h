// app/commands: the figures that people compare sounds by. Each is taken from the samples alone:
// nothing here knows how they were made. Pure.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "app/session/sound_file.h"
#include "core/result.h"

namespace ressort::commands {

// A stretch of a sound; what lies outside of the sound is left out.
struct Stretch {
  double from_s = 0.0;
  double to_s = 0.0;
};

inline constexpr double silence_db = -200.0;  // what is less, and nothing, is told as this

double to_dbfs(double amplitude);

// Of the largest sample.
double peak_dbfs(const Sound& sound);

// Integrated loudness of the whole: ITU-R BS.1770-4, EBU R 128. An error where libebur128 has no
// memory or the rate is not for it.
Result<double> loudness_lufs(const Sound& sound);

// The mean, weighted by a Hann window so that partials do not count; of the worst channel.
double dc_dbfs(const Sound& sound, Stretch stretch);

// Of two channels; nothing where there is one, or nothing sounds.
struct StereoImage {
  double correlation = 1.0;   // Pearson's; 1: both are the same
  double mono_loss_db = 0.0;  // the mean power of both channels over that of their mean
};
std::optional<StereoImage> stereo_image(const Sound& sound);

// The level, in dB of the mean square of all channels, of windows of `step_s` one after the other.
std::vector<double> levels_db(const Sound& sound, Stretch stretch, double step_s);

// From the start of the stretch until the level of 5 ms is first within 6 dB of the highest;
// nothing where nothing sounds.
std::optional<double> attack_ms(const Sound& sound, Stretch stretch);

// How long a decay by 60 dB takes: a line through the levels of 10 ms, least squares, from the
// highest down to 40 dB less, or to the end of the stretch. Nothing where it falls by less than
// 3 dB.
std::optional<double> t60_s(const Sound& sound, Stretch stretch);

// The strongest partial within so many cents of a frequency: where the magnitude of the spectrum of
// the stretch under a Blackman-Harris window is highest, refined to 1e-7 of itself. From the
// channel in which it is stronger. Nothing where the highest is at an edge or below -100 dBFS.
struct StrongPartial {
  double frequency_hz = 0.0;
  double dbfs = silence_db;  // of a steady sinusoid
};
std::optional<StrongPartial> partial_near(const Sound& sound, Stretch stretch, double frequency_hz,
                                          double cents);

double cents_between(double from_hz, double to_hz);

}  // namespace ressort::commands
