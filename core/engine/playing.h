// core/engine: how an engine plays a Machine, as the compile room decides it. Plain data.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/curve.h"
#include "core/engine/midi/channels.h"
#include "core/engine/midi/note_share.h"
#include "core/engine/pitches.h"
#include "core/gesture.h"
#include "core/lfo.h"

namespace ressort::engine {

enum class Source : std::uint8_t { note, controller, pressure, custom, audio, release, lfo };

// One row of the control map: a source drives an input or a parameter by a gesture.
struct Control {
  Source source = Source::note;
  static constexpr std::uint16_t pitch = 0;  // targets of an LFO
  static constexpr std::uint16_t level = 1;
  static constexpr std::uint16_t first_parameter = 2;
  std::uint16_t number = 0;  // controller 0..127, audio channel from 0, or index of the LFO
  std::uint8_t lowest_key = 0;
  std::uint8_t highest_key = 127;
  std::uint8_t turn = 0;   // position in a round robin of notes, from 0
  std::uint8_t turns = 1;  // number of controls in the round robin
  Gesture gesture = Gesture::position;
  std::uint16_t target = 0;         // index into Machine::inputs or Machine::parameters
  bool throws = false;              // strikes a mass that no spring holds, such as a hammer
  GestureSettings settings;         // for a sound without a key, those of middle C
  std::vector<KeySettings> by_key;  // settings at some keys, ascending; empty: all keys alike

  // [audio] wait-free, O(keys)
  GestureSettings settings_on(double key) const {
    return by_key.empty() ? settings : settings_at(by_key, key);
  }
};

struct PlayedLfo {
  Lfo lfo;
  bool is_scaled = false;        // a controller, the pressure or the note's level scales its depth
  Source by = Source::pressure;  // Source::note: the energy that belongs to the note's level
  std::uint16_t number = 0;      // controller
};

// Greatest random differences from note to note.
struct Variation {
  double strength = 0.0;  // relative
  double timing_s = 0.0;  // notes start up to this late
};

enum class Tuning : std::uint8_t {
  fixed,     // every key plays the model at its written pitch
  keyboard,  // a key's voice has that key's frequency
};

// The range of a parameter in which the network is stable.
struct Limits {
  double lowest = -std::numeric_limits<double>::infinity();
  double highest = std::numeric_limits<double>::infinity();
};

// Bounds on the motion of an undriven part. With an energy E, measured from its rest position, an
// output stays within sqrt(2 E c / s) for ever. c is the output's compliance with every stiffness
// at the minimum that the box of parameters allows, s the voice's stiffness factor.
struct RestBound {
  struct Reach {
    std::uint32_t link = 0;   // a contact or a pluck
    double compliance = 0.0;  // compliance of the distance of its ends
  };
  std::vector<double> compliances;  // [output]
  std::vector<Reach> reaches;
  std::vector<Limits> box;  // [parameter]
};

// Maps MIDI velocity to strength: a power, or straight lines between points if there are any.
struct VelocityCurve {
  std::vector<CurvePoint> points;  // velocity 0..1 and strength, both ascending
  double exponent = 1.0;

  // [audio] wait-free, O(points)
  double operator()(double velocity) const {
    const double v = std::clamp(velocity, 0.0, 1.0);
    if (points.empty()) {
      return exponent == 1.0 ? velocity : std::pow(v, exponent);
    }
    return value_at(points, v);
  }
};

// Returns the number of samples that are summed where voices are compared, at about 5.5 kHz.
inline std::size_t compared_step(double rate_hz) {
  constexpr double compared_hz = 5512.5;
  return static_cast<std::size_t>(std::max(1.0, std::round(rate_hz / compared_hz)));
}

struct Playing {
  int voices = 1;
  double gain = 1.0;            // output per unit of position
  double body_gain = 1.0;       // from the outputs to what is heard, at the loudest frequency
  double mean_body_gain = 1.0;  // the same for white noise
  // Response of what is heard to an impulse of the outputs, each the sum of compared_step()
  // samples.
  std::vector<double> body_response = {1.0};
  bool bare = false;                    // the network alone: no ramps, no smoothing, no sleep
  double damper_s = 0.0;                // T60 of a released voice; 0: it rings freely
  std::vector<CurvePoint> damper_keys;  // the same by key; replaces `damper_s`
  std::vector<CurvePoint> keys_db;      // gain by key; empty: 0 dB
  bool noise = false;                   // the outputs modulate white noise
  Tuning tuning = Tuning::fixed;
  double transpose = 0.0;  // semitones, already included in keys_hz
  KeyFrequencies keys_hz = equal_temperament(440.0, 0.0);
  VelocityCurve velocity;
  ChannelMask channels = midi_channels;  // MIDI channels to listen to
  // Parameter that is added to a blow's amount for its length.
  std::optional<std::size_t> hardness;
  bool mono = false;      // one note per channel, that of the latest held key
  bool legato = false;    // a key pressed while another is held is not struck
  double glide_s = 0.0;   // portamento time, linear in cents
  NoteShare::Part share;  // the notes that this engine plays, of several engines
  Pitches pitches;        // pitches of the lowest mode
  // [key] the same at its own parameters, near its pitch; may be empty
  std::vector<Pitches> key_pitches;
  // Factor on the stiffness of a voice that takes one step a sample, at which its lowest mode has
  // the pitch that it has at several; empty if all voices take the same steps.
  Pitches warp;
  PitchesAlong along;           // replaces `pitches` where a parameter must leave keys in tune
  double highest_factor = 1.0;  // greatest stiffness factor that is proved stable
  std::vector<Limits> home;     // [parameter] range in which highest_factor holds; empty: anywhere
  std::vector<double> away;     // highest_factor at equal steps from `home` to `limits`
  std::vector<Control> controls;
  std::vector<PlayedLfo> lfos;
  Variation variation;
  std::vector<Limits> limits;  // [parameter] hard limits for events and audio; empty: none
  // [parameter] the curve of a parameter whose value differs from voice to voice; empty: none does
  std::vector<std::optional<VoiceCurve>> curves;
  std::vector<std::optional<RestBound>> rest_bounds;  // [part]; nullopt or missing: never frozen

  // Returns the T60 of a released voice on this key.
  double damper_on(double key) const {
    return damper_keys.empty() ? damper_s : value_at(damper_keys, key);
  }
  // Returns the curve of a parameter; null if all voices share its value.
  const VoiceCurve* curve_of(std::size_t parameter) const {
    return parameter < curves.size() && curves[parameter] ? &*curves[parameter] : nullptr;
  }
  // Returns whether an LFO moves a parameter.
  bool swings_parameters() const {
    return std::any_of(controls.begin(), controls.end(), [](const Control& control) {
      return control.source == Source::lfo && control.target >= Control::first_parameter;
    });
  }
  // Returns the level that is heard per unit of position.
  double heard_gain() const { return gain * body_gain; }

  double gain_of_loudest_key() const {
    double most_db = 0.0;
    for (const CurvePoint& point : keys_db) {
      most_db = std::max(most_db, point[1]);
    }
    return heard_gain() * std::pow(10.0, most_db / 20.0);
  }
};

}  // namespace ressort::engine
