// core/model: presets. A preset describes how a model is played: parameter values and ranges, gain,
// voices, and the controls that map notes, controllers and OSC names to inputs and parameters. It
// contains names, not indices.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/curve.h"
#include "core/gesture.h"
#include "core/lfo.h"
#include "core/model/network.h"
#include "core/model/preset/budget.h"
#include "core/precision.h"
#include "core/result.h"

namespace ressort::model {

inline constexpr double usual_a4_hz = 440.0;
inline constexpr int most_transpose = 96;  // semitones, up or down

struct ParameterSetting {
  std::string name;
  double value = 0.0;
  double minimum = 0.0;  // range for controllers, OSC and the console
  double maximum = 0.0;
  SourceLocation location;
  // Curves that make the value differ from voice to voice; empty: all voices share it.
  std::vector<CurvePoint> keys = {};      // key and value, ascending
  std::vector<CurvePoint> velocity = {};  // velocity 0..127 and factor or offset, ascending
  std::optional<double> keys_at = {};     // knob's value at which `keys` holds; nullopt: `value`
  bool has_curve() const { return !keys.empty() || !velocity.empty(); }
  bool operator==(const ParameterSetting&) const = default;
};

enum class ControlSource { note, controller, pressure, osc, audio, release, lfo };

// A key and two numbers, such as the low and the high end of a range.
using KeyPair = std::array<double, 3>;

struct ControlSetting {
  ControlSource source = ControlSource::note;
  int number = 0;       // controller (0..127), audio channel (from 1), or index of the LFO
  std::string address;  // OSC name, such as "/finger", or the name of the LFO
  std::string target;   // "in1" or a parameter's name; for an LFO "pitch" or "level"
  std::string name;     // name of the controller for the player, such as "Bow pressure"
  std::string help;     // one line
  Gesture gesture = Gesture::position;
  double low = 0.0;   // values for 0 and 1 of the source: a position, a force, a velocity in
  double high = 1.0;  //   units per sample at 44 100 Hz, or a parameter's value
  bool exponential = false;
  // True if `low` and `high` are depths of a finger in swings, the amplitude with which a loud note
  // moves the mass under it; below 0 the finger is off.
  bool in_swings = false;
  double travel = 0.0;     // distance of the resting input from its middle, on either side
  bool has_level = false;  // 0 and 1 of the source also set the level of the voice
  double low_db = 0.0;
  double high_db = 0.0;
  // Duration of an impulse for 0 and for 1, 0 is one sample; T60 of noise.
  double longest_ms = 0.0;
  double shortest_ms = 0.0;
  double low_hz = 20.0;  // band of noise
  double high_hz = 20000.0;
  double noise = 0.0;  // rms of the fluctuation of a bow's speed, as a share of the speed
  // The same numbers by key, ascending; empty: on all keys alike. The numbers above are then those
  // of middle C. The third number of `travel_keys` is not used.
  std::vector<KeyPair> range_keys = {};
  std::vector<KeyPair> travel_keys = {};
  std::vector<KeyPair> level_keys = {};
  std::vector<KeyPair> length_keys = {};
  bool follows_pitch = true;  // speeds, forces and durations scale with the key's pitch
  int lowest_key = 0;
  int highest_key = 127;
  int turn = 1;  // place of a note's control among `turns` round-robin controls
  int turns = 1;
  SourceLocation location;
  bool operator==(const ControlSetting&) const = default;
};

// Returns a controller's name as one word, for addresses and commands: "bow-pressure".
std::string word_of(std::string_view name);

// Returns the keys at which a number of the control is given, ascending, and the control with the
// numbers of one key. [any thread but audio]
std::vector<double> curve_keys(const ControlSetting& control);
ControlSetting on_key(ControlSetting control, double key);
struct LfoSetting {
  std::string name;
  Lfo lfo;
  // Scales the depth: a controller, the pressure, or for `note` the energy of the note's level.
  std::optional<ControlSource> by;
  int number = 0;  // of the controller
  bool operator==(const LfoSetting&) const = default;
};

// A stop of a morph: a preset, or values of the model's parameters.
struct MorphSetting {
  std::string preset;                    // name; empty: use `values`
  std::vector<ParameterSetting> values;  // values with empty ranges
  double gain = 1.0;                     // gain for `values`; a preset has its own
  SourceLocation location;
  bool operator==(const MorphSetting&) const = default;
};

// A model that the sum of all voices passes through, such as a soundboard.
struct BodyModel {
  std::string file;  // path, for messages
  Network network;
  std::string name() const { return file.substr(file.rfind('/') + 1); }
  bool operator==(const BodyModel&) const = default;
};

struct Preset {
  std::string model;                    // file name, next to the preset or in the models' folder
  SourceLocation model_location{1, 1};  // location of `model`
  std::vector<std::string> with;        // more models, appended to its text
  std::vector<std::string> through;     // models that the sum of all voices passes through
  SourceLocation through_location;
  std::vector<BodyModel> bodies;   // the same, read by the loader
  std::vector<std::string> fixed;  // labels of elements whose stiffness keys do not change
  std::string description;         // one line
  int voices = 1;
  double gain = 1.0;                    // output per unit of position
  double damper_s = 0.0;                // T60 after note-off; 0: no damper
  std::vector<CurvePoint> damper_keys;  // the same by key; replaces `damper_s`, then of middle C
  std::vector<CurvePoint> keys_db;      // gain by key: keys and dB, ascending; empty: 0
  bool noise = false;                   // the outputs modulate white noise
  bool keyboard = true;                 // keys set the pitch
  int transpose = 0;                    // semitones
  // Flattening of the sound against the lowest mode, which keys compensate: keys and cents,
  // ascending.
  std::vector<CurvePoint> flattening_cents;
  std::string tuned_along;  // parameter along which keys stay in tune; empty: none
  SourceLocation tuned_along_location;
  std::string hardness;  // parameter that is added to the amount of a blow for its length
  SourceLocation hardness_location;
  double a4_hz = usual_a4_hz;  // reference pitch
  std::string scale;           // Scala file next to the preset; empty: equal temperament
  std::string keyboard_map;    // Scala keyboard map
  SourceLocation scale_location;
  SourceLocation keyboard_map_location;
  std::vector<double> keys_hz;  // [key] frequencies from both files, set by the loader; or empty
  unsigned channels = 0xffff;   // MIDI channels, bit 0 is channel 1
  double velocity = 0.0;        // velocity curve: -1 soft, 0 linear, 1 hard
  std::vector<CurvePoint> velocity_points;  // input and output, 0 to 1; replaces the curve
  bool mono = false;                        // one voice, last-note priority
  bool legato = false;                      // no retrigger while a key is held
  double glide_s = 0.0;                     // glide time between notes
  std::optional<ThirdArgument> third;       // meaning of the state argument; overrides the model
  Budget budget;                            // error budget
  Precision precision = Precision::float64;
  std::vector<ParameterSetting> parameters;
  std::vector<LfoSetting> lfos;
  std::vector<ControlSetting> controls;
  double varied_strength = 0.0;     // greatest relative difference of strength from note to note
  double varied_ms = 0.0;           // greatest delay of a note
  std::string morph_parameter;      // goes from 1 to the number of stops
  std::vector<MorphSetting> morph;  // empty: no morph
  bool operator==(const Preset&) const = default;
};

inline constexpr int max_voices = 256;
inline constexpr std::size_t most_morph_stops = 16;
inline constexpr std::size_t most_lfos = 8;
inline constexpr std::size_t most_bodies = 8;  // models of `through`
inline constexpr std::size_t max_preset_bytes = std::size_t{64} << 10;
inline constexpr std::size_t most_preset_errors = 100;

// A key of the preset format, with its description. The reader uses this list, too.
struct PresetKey {
  std::string_view table;  // "" for the preset itself
  std::string_view key;
  std::string_view value;  // the accepted values, and the default
  std::string_view does;
};
std::span<const PresetKey> preset_keys();

// Returns a parameter's curves in words, as "keys 21: 5e-05, 108: 0.004"; "" if it has none.
std::string curve_text(const Preset& preset, std::string_view parameter);

struct ParsedPreset {
  Preset preset;              // complete only if ok()
  std::vector<Error> errors;  // in the order of the lines
  bool ok() const { return errors.empty(); }
};

// Reads a preset. Continues after an error, to report all of them. Unknown keys, wrong types,
// values out of range, and OSC names for which `is_reserved` returns true are errors. [any thread
// but audio]
ParsedPreset parse_preset(std::string_view toml,
                          bool (*is_reserved)(std::string_view address) = nullptr);

// Returns the preset of a model that has none. Notes and the modulation wheel play the first input
// with a gesture that suits its links; controllers 16 to 19 place fingers at the first contacts
// that no key plays; audio channels drive the other inputs. `bare` is for rendering the network
// alone: gain 1, audio channel n on input n.
Preset default_preset(const Network& network, bool bare);

// Returns a message if no key plays a network with its default preset: the reason, and a line for
// the model that would change this, at the position of the first input.
std::optional<Error> idle_keys(const Network& network, const Preset& preset);

}  // namespace ressort::model
