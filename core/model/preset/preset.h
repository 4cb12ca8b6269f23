// core/model: how a model is played. Parameter values and ranges, gain, voices, and the control
// map: which notes, controllers and OSC names drive which input, and how. Names, not indices.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/curve.h"
#include "core/gesture.h"
#include "core/model/network.h"
#include "core/model/preset/budget.h"
#include "core/result.h"

namespace ressort::model {

inline constexpr double usual_a4_hz = 440.0;

struct ParameterSetting {
  std::string name;
  double value = 0.0;
  double minimum = 0.0;  // the range that controllers, OSC and the console keep to
  double maximum = 0.0;
  SourceLocation location;
  bool operator==(const ParameterSetting&) const = default;
};

enum class ControlSource { note, controller, pressure, osc, audio };

struct ControlSetting {
  ControlSource source = ControlSource::note;
  int number = 0;       // of the controller (0..127) or the audio channel (from 1)
  std::string address;  // of an OSC name, such as "/finger"
  std::string target;   // "in1", or a parameter's name
  Gesture gesture = Gesture::position;
  double low = 0.0;   // what 0 and 1 of the source become: a position, a force, a speed in
  double high = 1.0;  //   units per sample at 44 100 Hz, a parameter's value
  bool exponential = false;
  // `low` and `high` are how deep a finger lies, in swings: how far a loud note moves what it
  // touches; below 0 it is off.
  bool in_swings = false;
  double travel = 0.0;     // how far from its middle the input rests, on either side
  bool has_level = false;  // 0 and 1 of the source are levels of the voice, too
  double low_db = 0.0;
  double high_db = 0.0;
  double longest_ms = 0.0;  // how long an impulse lasts for 0 and for 1; 0: one sample
  double shortest_ms = 0.0;
  int lowest_key = 0;
  int highest_key = 127;
  int turn = 1;  // of notes: its place among `turns` controls that take turns
  int turns = 1;
  SourceLocation location;
  bool operator==(const ControlSetting&) const = default;
};

// Where a morph passes: a preset, or values of the model's parameters.
struct MorphSetting {
  std::string preset;                    // its name; empty: the values
  std::vector<ParameterSetting> values;  // each with no range but itself
  double gain = 1.0;                     // of the values; a preset has its own
  SourceLocation location;
  bool operator==(const MorphSetting&) const = default;
};

struct Preset {
  std::string model;                    // a file's name, beside the preset or in the models' folder
  SourceLocation model_location{1, 1};  // of that name
  std::vector<std::string> with;        // more models, read as one text with it
  std::vector<std::string> fixed;       // labels of what keys leave as stiff as it is
  std::string description;              // one line for a person
  int voices = 1;
  double gain = 1.0;      // output per unit of position
  double damper_s = 0.0;  // T60 of a voice whose key is up; 0: it rings out
  // T60 of a held note, beside what the model loses: keys and seconds, ascending; empty: nothing.
  std::vector<CurvePoint> decay_s;
  std::vector<CurvePoint> keys_db;  // how much louder keys are: keys and dB, ascending; empty: 0
  bool noise = false;               // the outputs shape white noise
  bool keyboard = true;             // a key sets the pitch
  int transpose = 0;                // semitones between a key and the pitch that it sets
  int pitch_mode = 1;               // which of its modes a key tunes, from the lowest
  // Of the sound below that mode, to be made up for: keys and cents, ascending; empty: none.
  std::vector<CurvePoint> flattening_cents;
  std::string tuned_along;  // a parameter that leaves keys in tune wherever it is; empty: none
  SourceLocation tuned_along_location;
  double a4_hz = usual_a4_hz;  // to which everything is tuned
  std::string scale;           // a Scala file beside the preset; empty: 12 equal semitones
  std::string keyboard_map;    // which keys play it
  SourceLocation scale_location;
  SourceLocation keyboard_map_location;
  std::vector<double> keys_hz;  // [key] of both, as whoever reads files has found; empty: without
  unsigned channels = 0xffff;   // MIDI channels that it listens to, the lowest bit is the first
  double velocity = 0.0;        // the curve of keys: -1 soft, 0 as they come, 1 hard
  std::vector<CurvePoint> velocity_points;  // 0..1 and what that becomes; or the curve
  bool mono = false;                        // one voice plays the last of the keys that are down
  bool legato = false;                      // and is not struck again as long as one is
  double glide_s = 0.0;                     // from one pitch to the next
  std::optional<ThirdArgument> third;       // of the model's masses, whatever the model shows
  Budget budget;                            // of errors, for who computes it
  std::vector<ParameterSetting> parameters;
  std::vector<ControlSetting> controls;
  std::string morph_parameter;      // which goes through them, from 1 to as many as there are
  std::vector<MorphSetting> morph;  // empty: the model is played as it is
  bool operator==(const Preset&) const = default;
};

inline constexpr int max_voices = 256;
inline constexpr std::size_t most_morph_stops = 16;
inline constexpr int most_pitch_mode = 16;
inline constexpr std::size_t max_preset_bytes = std::size_t{64} << 10;
inline constexpr std::size_t most_preset_errors = 100;

// A key of the format and what it takes, for people. The reader knows no other list.
struct PresetKey {
  std::string_view table;  // "" for those of the preset itself
  std::string_view key;
  std::string_view value;  // what it takes, and what it is without the key
  std::string_view does;
};
std::span<const PresetKey> preset_keys();

struct ParsedPreset {
  Preset preset;              // whole only if ok()
  std::vector<Error> errors;  // in the order of the lines, each with its line and column
  bool ok() const { return errors.empty(); }
};

// Reads a preset; goes on after an error, so that every problem is told at once. An unknown key, a
// wrong type or a value out of range is an error; never a silent drop. So is an OSC name for which
// `is_reserved` says yes. [any thread but audio]
ParsedPreset parse_preset(std::string_view toml,
                          bool (*is_reserved)(std::string_view address) = nullptr);

// What a model without a preset is played with: notes and the modulation wheel drive its first
// input by the gesture that its links ask for, controllers 16 to 19 lay fingers on the first
// contacts that no key plays, and audio channels drive the inputs that no hand does. `bare`: gain
// 1, audio channel n on input n, for rendering the network alone.
Preset default_preset(const Network& network, bool bare);

// Why no key plays a network with its default preset, and the line that would let one, at the place
// of the first input; nothing where keys do play, or nothing moves.
std::optional<Error> idle_keys(const Network& network, const Preset& preset);

}  // namespace ressort::model
