// app/commands: one function per command of the program. Each returns the exit code.
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
  std::string name = "IPlayTheTriangle";  // preset or model, or a MIDI file, played by this preset
  std::string audio = "auto";             // jack, alsa, dummy, auto
  std::string midi = "auto";              // auto, alsa, jack, none, or a MIDI file
  AudioOptions device;
  double gain_db = 0.0;
  int voices = 0;
  int threads = 1;                     // including the audio thread
  NoteShare::Part share;               // share of the notes
  std::optional<Precision> precision;  // empty: the preset's
  bool rescale = true;
  std::optional<Method> method;        // empty: the plan's choice
  std::optional<Budget> budget;        // empty: the preset's
  std::optional<ThirdArgument> third;  // empty: as the model shows
  KeyOptions keys;                     // override every preset's
  bool force = false;                  // plays the first model even if it is unstable
  bool no_console = false;
  bool is_paused = false;  // the MIDI file waits for the command `song play`
  std::string script;
  std::string controllers;  // file of the mapping; empty: the user's, if there is one
  OscOptions osc;           // port 0: none
  PanelOptions panel;
  bool exit_on_loss = false;
  bool watch = false;  // reloads the scene when its files change
};

int play(const PlayOptions& options);

// Returns the signals that end the program. SIGHUP is not one of them under nohup.
std::vector<int> ending_signals();
int render_command(const RenderOptions& options, bool is_quiet);
int gallery_command(const GalleryOptions& options);
int describe_command(const DescribeOptions& options);
int shape_command(const ShapeOptions& options);

}  // namespace ressort::commands
