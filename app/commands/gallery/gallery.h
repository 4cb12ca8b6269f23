// app/commands: plays every preset a phrase and draws what can be heard.
#pragma once

#include <functional>
#include <string>

#include "app/rooms.h"

namespace ressort::commands {

struct GalleryOptions {
  std::string folder;  // for all of it; made where it is not there
  double rate_hz = 44100.0;
  bool is_quiet = false;
};

// Renders all presets that are known, a few at a time, and writes NAME.wav, NAME-note.wav,
// index.html and spectra.svg into the folder, over what has these names. A preset that cannot be
// played is told and shown without a picture. Stops where `goes_on`, which any thread may call,
// says no. The exit code.
int gallery(const GalleryOptions& options, const std::function<bool()>& goes_on);

}  // namespace ressort::commands
