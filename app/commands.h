// app: what the program does, one function for each of its commands. The exit code comes back.
#pragma once

#include <optional>
#include <string>

#include "app/audio.h"
#include "app/offline.h"
#include "app/osc.h"
#include "app/session.h"

namespace ressort {

namespace exit_code {
inline constexpr int done = 0;
inline constexpr int our_failure = 1;
inline constexpr int wrong_use = 2;    // or input that cannot be read
inline constexpr int audio_lost = 75;  // there is no audio, or none any more
}  // namespace exit_code

struct PlayOptions {
  std::string name = "IPlayTheTriangle";
  std::string audio = "auto";  // jack, alsa, dummy, auto
  std::string midi = "auto";   // auto, alsa, jack, none
  AudioOptions device;
  double gain_db = 0.0;
  int voices = 0;
  Precision precision = Precision::float64;
  bool rescale = true;
  bool no_console = false;
  std::string script;
  std::optional<int> osc_port;  // 0: none; without: 9777, or none if that is taken
  std::string osc_bind = "127.0.0.1";
  bool exit_on_loss = false;
};

int play(const PlayOptions& options);
int render_command(const RenderOptions& options, bool is_quiet);
int check(const std::string& name, bool as_json);
int print_model(const std::string& name);

}  // namespace ressort
