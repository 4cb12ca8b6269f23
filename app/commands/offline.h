// app/commands: renders to a file, through the same block function as the live backends.
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
  std::string output;  // a sound file; its ending says which
  double rate_hz = 44100.0;
  std::optional<double> seconds;       // at most one of these; without both: as long as score and
  std::optional<long long> frames;     //   input last, and two seconds to ring out, or as a MIDI
                                       //   file lasts, and until it is silent, a minute at most
  std::string input;                   // a sound file; channel n drives input n
  std::string score;                   // a file of calls
  std::string midi;                    // a Standard MIDI File, beside the score or instead of one
  std::string phrase;                  // a score itself, instead of the default phrase
  std::vector<Setting> parameters;     // set before the first sample
  std::optional<SampleFormat> format;  // without one, the best that the file can hold
  Precision precision = Precision::float64;
  bool rescale = true;
  std::optional<Method> method;        // without one, the plan's choice
  std::optional<Budget> budget;        // instead of the preset's
  bool is_strict = false;              // what only warns is an error
  std::optional<ThirdArgument> third;  // whatever the model shows
  KeyOptions keys;                     // instead of the preset's
  bool limit = false;
  bool force = false;  // even if it is not stable
  int voices = 0;
  int threads = 0;        // for large networks; 0: as many as the machine runs at once
  Progress loading = {};  // until the first sample; what it stops fails with `stopped`
};

struct Rendered {
  std::string name;
  double rate_hz = 44100.0;
  long long frames = 0;
  int channels = 0;
  double peak = 0.0;
  double rms = 0.0;
  double cpu_s = 0.0;  // of this thread, for the sound alone
  std::uint64_t resets = 0;
  bool was_interrupted = false;
  std::vector<std::string> warnings;
  std::optional<Error> failure;  // of the disk; there is no file then
};

// `progress` gets 0..1 now and then, 0 before anything is written, and answers false to stop: what
// is there by then is kept. [control]
Result<Rendered> render(const RenderOptions& options, const std::function<bool(double)>& progress);

struct PhraseNote {
  double start_s = 0.0;
  double end_s = 0.0;
  int key = 0;
  int velocity = 0;
};

// The short phrase that a preset plays when nobody says what to play; its end is that of its last
// note. And notes as a score.
const std::vector<PhraseNote>& default_phrase();
std::string to_score(const std::vector<PhraseNote>& notes);

}  // namespace ressort::commands
