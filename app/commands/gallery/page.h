// app/commands: what the gallery found, as a page and as a picture. Pure.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/commands/gallery/sound.h"
#include "app/commands/gallery/spectrogram.h"
#include "app/commands/offline.h"

namespace ressort::commands {

// A note of the phrase, and where its fundamental should be; 0: keys do not set the pitch.
struct ShownNote {
  PhraseNote note;
  double fundamental_hz = 0.0;
};

// Of the phrase: peak, loudness, DC of its last second, stereo. Of one note, struck at
// `note_velocity`, held for `held_s` and let go: all else.
struct PresetFigures {
  double peak_dbfs = silence_db;
  double loudness_lufs = silence_db;
  double dc_dbfs = silence_db;
  std::optional<StereoImage> stereo;
  std::optional<double> attack_ms;
  std::optional<double> held_t60_s;      // while the key is down
  std::optional<double> released_t60_s;  // from its release on
  std::optional<double> pitch_cents;     // of the partial within a semitone of the key, off it
  std::optional<double> loudest_cents;   // of the loudest partial of the first second, off the key
  double cpu_share = 0.0;                // of one core, for one voice
};

struct ShownPreset {
  std::string name;
  std::string description;
  std::string failure;  // why it could not be played; the rest is empty then
  std::vector<ShownNote> notes;
  std::vector<double> peaks_dbfs;   // of the phrase, in equal steps
  std::vector<double> levels_dbfs;  // the same as root mean square
  Spectrogram spectrogram;          // of the phrase
  PresetFigures figures;
};

inline constexpr int note_velocity = 100;
inline constexpr double held_s = 3.0;

// A page that needs nothing but the sounds beside it. `made`: by what and when.
std::string gallery_page(const std::vector<ShownPreset>& presets, const std::string& made);

// All spectrograms, small, in one SVG picture.
std::string gallery_picture(const std::vector<ShownPreset>& presets);

// The figures as people read them, a row for each preset under a head.
std::vector<std::vector<std::string>> gallery_table(const std::vector<ShownPreset>& presets);

}  // namespace ressort::commands
