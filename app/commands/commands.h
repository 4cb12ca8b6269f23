// app/commands: what the program does, one function for each of its commands. The exit code comes
// back.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/commands/gallery/gallery.h"
#include "app/commands/offline.h"
#include "app/commands/timbre/describe.h"
#include "app/commands/timbre/shape_model.h"
#include "app/control/osc/server.h"
#include "app/devices/audio.h"
#include "app/exit_code.h"
#include "app/panel/panel.h"
#include "app/session/session.h"

namespace ressort::commands {

struct PlayOptions {
  std::string name = "IPlayTheTriangle";  // or a MIDI file, which this one plays
  std::string audio = "auto";             // jack, alsa, dummy, auto
  std::string midi = "auto";              // auto, alsa, jack, none, or a MIDI file, and then auto
  AudioOptions device;
  double gain_db = 0.0;
  int voices = 0;
  int threads = 1;        // with the audio thread
  NoteShare::Part share;  // of the notes
  Precision precision = Precision::float64;
  bool rescale = true;
  std::optional<Method> method;        // without one, the plan's choice
  std::optional<Budget> budget;        // instead of the preset's
  std::optional<ThirdArgument> third;  // whatever the models show
  KeyOptions keys;                     // instead of every preset's
  bool force = false;                  // play the first model even if it is not stable
  bool no_console = false;
  std::string script;
  OscOptions osc;  // port 0: none
  PanelOptions panel;
  bool exit_on_loss = false;
  bool watch = false;  // what sounds is read again when its files change
};

int play(const PlayOptions& options);

// The signals that end the program. nohup's promise is kept.
std::vector<int> ending_signals();
int render_command(const RenderOptions& options, bool is_quiet);
int gallery_command(const GalleryOptions& options);
int describe_command(const DescribeOptions& options);
int shape_command(const ShapeOptions& options);

}  // namespace ressort::commands
