// core/model: tunings in the Scala format (huygens-fokker.org/scala). A scale (.scl) lists its
// steps; a keyboard map (.kbm) assigns steps to keys and sets the reference pitch.
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

// The pitch of a step of a scale. Octave 4 is the one at middle C, key 60.
struct ReferencePitch {
  int octave = 4;
  int step = 0;
  double hz = 0.0;
};

// One period of a scale.
struct Scale {
  // cents of every step but the first, which is 0; the last is the period
  std::vector<double> cents;
  std::optional<ReferencePitch> reference;  // of an .ascl file; for use without a keyboard map
};

// The steps of the keys. Keys outside first_key..last_key are tuned as without a scale.
struct KeyboardMap {
  int first_key = 0;
  int last_key = 127;
  int middle_key = 60;     // first key of the map; plays step 0
  int reference_key = 60;  // key of reference_hz
  double reference_hz = 261.6255653005986;
  int octave_steps = 0;  // steps per repetition of the map; 0: the scale's period
  std::vector<std::optional<int>>
      steps;  // nothing: silent key; empty: each key plays the next step
};

// Returns the map without a file: each key plays the next step, and middle C, or the reference of
// the scale, sets the pitch. [any thread]
KeyboardMap usual_map(const Scale& scale);

// Errors have a line and a column. [any thread but audio]
Result<Scale> parse_scale(std::string_view text);
Result<KeyboardMap> parse_keyboard_map(std::string_view text);

// Returns the frequency in Hz of every MIDI key 0..127; 0 for a silent key. Keys outside the map
// are in equal temperament at A = 440 Hz. Keys above 1 MHz or below 1 mHz are silent. Fails if the
// map makes all keys silent. [any thread but audio]
Result<std::vector<double>> key_frequencies(const Scale& scale, const KeyboardMap& map);

}  // namespace ressort::model
