// app/commands: renders to a file with the same block function as the live backends.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "app/control/message.h"
#include "app/session/loader.h"
#include "app/session/sound_file.h"
#include "core/compile/compile.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::commands {

struct RenderOptions {
  std::string name;    // model or preset
  std::string output;  // sound file; the extension selects the format
  double rate_hz = 44100.0;
  // At most one of the next two. Default: the length of the score, or of the input and two seconds
  // of decay, or of the MIDI file and its decay, at most a minute.
  std::optional<double> seconds;
  std::optional<long long> frames;
  std::string input;                   // sound file; channel N drives input N
  std::string score;                   // score file
  std::string midi;                    // Standard MIDI File, in addition to the score
  std::string phrase;                  // text of a score, instead of the default phrase
  std::vector<Setting> parameters;     // set before the first sample
  std::optional<SampleFormat> format;  // empty: the best that the format supports
  std::optional<Precision> precision;  // empty: the preset's
  bool rescale = true;
  std::optional<Method> method;        // empty: the plan's choice
  std::optional<Budget> budget;        // empty: the preset's
  bool is_strict = false;              // treats warnings about the budget as errors
  std::optional<ThirdArgument> third;  // empty: as the model shows
  KeyOptions keys;                     // override the preset's
  bool limit = false;
  bool force = false;  // renders unstable models
  int voices = 0;
  int threads = 0;        // threads for voices; 0: one per core
  Progress loading = {};  // until the first sample; fails with `stopped` if it stops
};

struct Rendered {
  std::string name;
  double rate_hz = 44100.0;
  long long frames = 0;
  int channels = 0;
  double peak = 0.0;
  double rms = 0.0;
  double cpu_s = 0.0;  // CPU time of this thread, without loading
  std::uint64_t resets = 0;
  bool is_proved = false;  // stable
  bool was_interrupted = false;
  std::vector<std::string> warnings;
  std::optional<Error> failure;  // error of the disk; the file is deleted
};

// Renders to the output file. `progress` gets the finished share, 0 before anything is written, and
// returns false to stop; the sound so far is kept. [control]
Result<Rendered> render(const RenderOptions& options, const std::function<bool(double)>& progress);

struct PhraseNote {
  double start_s = 0.0;
  double end_s = 0.0;
  int key = 0;
  int velocity = 0;
};

// Returns the default phrase of presets, which ends with its last note; converts notes to a score.
const std::vector<PhraseNote>& default_phrase();
std::string to_score(const std::vector<PhraseNote>& notes);

}  // namespace ressort::commands
