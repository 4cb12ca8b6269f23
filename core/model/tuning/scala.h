// core/model: tunings in the format of Scala (huygens-fokker.org/scala): a scale, .scl, says what
// steps there are; a keyboard map, .kbm, which key plays which of them and at what pitch.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "core/result.h"
#include "core/rooms.h"

namespace ressort::model {

inline constexpr std::size_t max_tuning_bytes = std::size_t{64} << 10;
inline constexpr int max_scale_notes = 1024;
inline constexpr int max_mapped_keys = 1024;

// One period of a scale.
struct Scale {
  std::vector<double> cents;  // of every step above the first, which is 0; the last is the period
};

// Which step a key plays. Keys outside first..last stay as they would be without a scale.
struct KeyboardMap {
  int first_key = 0;
  int last_key = 127;
  int middle_key = 60;     // that the map begins with, and plays step 0 of
  int reference_key = 60;  // of which the frequency is known
  double reference_hz = 261.6255653005986;
  int octave_steps = 0;                   // between one map and the next; 0: a period's
  std::vector<std::optional<int>> steps;  // nothing: that key is silent; empty: every key a step
};

// An error says line, column and what was expected. [any thread but audio]
Result<Scale> parse_scale(std::string_view text);
Result<KeyboardMap> parse_keyboard_map(std::string_view text);

// Hz of every MIDI key 0..127, 0 of one that is silent; keys outside the map are in twelve equal
// semitones around 440 Hz. What nobody could hear, above 1 MHz or below 1 mHz, is silent too. Fails
// where the reference key is. [any thread but audio]
Result<std::vector<double>> key_frequencies(const Scale& scale, const KeyboardMap& map);

}  // namespace ressort::model
