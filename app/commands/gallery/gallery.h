// app/commands: renders all presets and writes a page that compares them.
#pragma once

#include <functional>
#include <string>

#include "app/rooms.h"

namespace ressort::commands {

struct GalleryOptions {
  std::string folder;  // created if it does not exist
  double rate_hz = 44100.0;
  bool is_quiet = false;
};

// Renders all known presets, one per core at a time, and writes NAME.wav, NAME-note.wav, index.html
// and spectra.svg into the folder, replacing existing files. Reports a preset that fails and lists
// it without a figure. `should_continue`, which any thread may call, returns false to stop. Returns
// the exit code.
int gallery(const GalleryOptions& options, const std::function<bool()>& should_continue);

}  // namespace ressort::commands
