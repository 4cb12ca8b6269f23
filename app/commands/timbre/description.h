// app/commands: what a sound or a model is like, frame by frame and as a whole.
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
  std::optional<long long> at;  // the first sample of the one frame that is described
  std::optional<double> f0_hz;  // without it, what is found
};

struct DescribedFrame {
  std::size_t at = 0;  // its first sample
  FigureValues values;
};

struct DescribedMode {
  double frequency_hz = 0.0;
  double t60_s = 0.0;  // infinity: nothing damps it
};

struct Description {
  std::string of;  // what was described, for people
  double rate_hz = 0.0;
  std::size_t channels = 0;  // of which it is the mean; 0: it is in closed form
  long long samples = 0;
  std::optional<double> f0_hz;
  std::vector<DescribedFrame> frames;
  std::optional<TemporalShape> temporal;  // nothing of one frame alone
  std::vector<DescribedMode> modes;       // where it is in closed form, or they were looked for
  // Of the loudest frame: [bin], or of closed forms [line].
  std::vector<double> frequencies_hz;
  std::vector<double> spectrum;  // as `kind` says
  std::size_t loudest = 0;       // its index in `frames`
};

// Gets 0..1 now and then; answers false to stop.
using DescriptionProgress = std::function<bool(double share)>;
inline constexpr const char* description_stopped = "interrupted";

// Of a sound file, the mean of its channels, read block by block, twice. The error says what is
// wrong with it: unreadable, too short for a frame, numbers that are none.
Result<Description> describe_sound(const std::string& path, const DescriptionOptions& options,
                                   const DescriptionProgress& progress);

// Of a linear model: of its modes in closed form, as an impulse at its first input and its first
// output have them. Frames until all is 60 dB below the first, a minute at most. The error says
// that nothing is heard.
Result<Description> describe_modes(const NetworkModes& modes, const DescriptionOptions& options);

// The quartiles over the frames within 60 dB of the loudest; [figure] absent where no frame has it.
struct FigureStatistics {
  FigureValues median;
  FigureValues interquartile_range;
};
FigureStatistics statistics_of(const Description& description);

}  // namespace ressort::commands
