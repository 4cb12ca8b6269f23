// app/commands: timbre figures of a sound or a model, per frame and as a whole.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "app/session/timbre/timbre_figures.h"
#include "core/analysis/modes/modes.h"
#include "core/analysis/timbre/descriptors.h"
#include "core/analysis/timbre/frame_analysis.h"
#include "core/result.h"

namespace ressort::commands {

struct DescriptionOptions {
  std::size_t frame = 2048;  // samples
  std::size_t hop = 512;
  Window window = Window::hann;
  SpectrumKind kind = SpectrumKind::magnitude;
  std::optional<long long> at;  // first sample of the only frame; empty: all frames
  std::optional<double> f0_hz;  // empty: estimated
};

struct DescribedFrame {
  std::size_t at = 0;  // first sample
  FigureValues values;
};

struct DescribedMode {
  double frequency_hz = 0.0;
  double t60_s = 0.0;  // infinity: undamped
};

struct Description {
  std::string of;  // name, for people
  double rate_hz = 0.0;
  std::size_t channels = 0;  // number of averaged channels; 0: closed form
  long long samples = 0;
  std::optional<double> f0_hz;
  std::vector<DescribedFrame> frames;
  std::optional<TemporalShape> temporal;  // empty if there is only one frame
  std::vector<DescribedMode> modes;       // modes, in closed form or on request
  // Spectrum of the loudest frame, [bin], or [line] in closed form.
  std::vector<double> frequencies_hz;
  std::vector<double> spectrum;  // magnitude or power
  std::size_t loudest = 0;       // index of the loudest frame
};

// Gets the finished share; returns false to stop.
using DescriptionProgress = std::function<bool(double share)>;
inline constexpr const char* description_stopped = "interrupted";

// Analyses the mean of the channels of a sound file in two passes. Fails if the file is unreadable,
// shorter than a frame, or has samples that are not numbers.
Result<Description> describe_sound(const std::string& path, const DescriptionOptions& options,
                                   const DescriptionProgress& progress);

// Analyses a linear model in closed form: its response at the first output to an impulse at the
// first input, until it has decayed by 60 dB, at most a minute. Fails if the response is silent.
Result<Description> describe_modes(const NetworkModes& modes, const DescriptionOptions& options);

// Computes quartiles over the frames within 60 dB of the loudest; empty for figures that no frame
// has.
struct FigureStatistics {
  FigureValues median;
  FigureValues interquartile_range;
};
FigureStatistics statistics_of(const Description& description);

}  // namespace ressort::commands
