// app/commands: the page and the figures of the gallery. Pure.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/commands/gallery/sound.h"
#include "app/commands/gallery/spectrogram.h"
#include "app/commands/offline.h"
#include "app/plot/plot.h"

namespace ressort::commands {

// A note of the phrase, and its expected fundamental; 0: keys do not set the pitch.
struct ShownNote {
  PhraseNote note;
  double fundamental_hz = 0.0;
};

// The peak and the loudness are of the phrase. All other figures are of one note at
// `note_velocity`, held for `held_s`.
struct PresetFigures {
  double peak_dbfs = silence_db;
  double loudness_lufs = silence_db;
  std::optional<double> attack_ms;
  std::optional<double> held_t60_s;      // while the key is down
  std::optional<double> released_t60_s;  // after its release
  double cpu_share = 0.0;                // fraction of one core, for one voice
};

struct ShownPreset {
  std::string name;
  std::string description;
  std::string failure;  // error message; the rest is empty then
  std::vector<ShownNote> notes;
  std::vector<double> peaks_dbfs;   // peaks of the phrase, in equal steps
  std::vector<double> levels_dbfs;  // RMS, in the same steps
  Spectrogram spectrogram;          // spectrogram of the phrase
  PresetFigures figures;
  std::string drawing;  // its figure, as SVG
};

inline constexpr int note_velocity = 100;
inline constexpr double held_s = 3.0;

// Returns the HTML page, which needs nothing but the sounds beside it. `made`: program and date.
std::string gallery_page(const std::vector<ShownPreset>& presets, const std::string& made);

// The levels and the spectrogram of one preset.
plot::Figure preset_figure(const ShownPreset& preset);

// All spectrograms, small.
plot::Figure gallery_figure(const std::vector<ShownPreset>& presets);

// Returns the figures as a table with a header row and a row per preset.
std::vector<std::vector<std::string>> gallery_table(const std::vector<ShownPreset>& presets);

}  // namespace ressort::commands
