// core/compile: how an engine is played, and what it is called from outside.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "core/analysis/linear.h"
#include "core/compile/stability_check.h"
#include "core/engine/engine.h"
#include "core/gesture.h"
#include "core/model/network.h"
#include "core/model/preset/preset.h"

namespace ressort::compile {

struct InputInfo {
  int number = 1;
  bool is_force = false;
  std::vector<Gesture> gestures;  // that the preset has controls for
  std::string attached_to;        // the mass that it moves or pushes
  bool knows(Gesture gesture) const {
    return std::find(gestures.begin(), gestures.end(), gesture) != gestures.end();
  }
};

// An OSC name that the preset gives to one of its controls.
struct CustomInfo {
  std::string address;
  int row = 0;  // Event::index of EventKind::custom
};

// Masses that may be struck by a name: one, or all of a macro, which are named "NAME:1" and so on;
// and places on macros. What was culled is not among them.
struct StruckInfo {
  std::string name;
  std::uint32_t first = 0;  // Event::value2 of EventKind::strike
  std::vector<bool> moves;  // [mass of the macro], those that are not held; empty: one mass
};

// What a running engine is called from outside; indices are those of Event.
struct Instrument {
  std::vector<ParameterInfo> parameters;  // [parameter]
  std::vector<InputInfo> inputs;
  std::vector<CustomInfo> custom;
  std::vector<StruckInfo> struck;  // by their names
  double blow = 0.0;  // the force of a hard strike on a mass, for one sample at 44 100 Hz
  int outputs = 0;
  int audio_inputs = 0;  // the highest audio channel that a control listens to
  int voices = 1;
  double gain = 1.0;       // output per position unit: the preset's, or what was found
  std::size_t masses = 0;  // that move
  std::size_t links = 0;
  int transpose = 0;         // semitones from a key to its pitch
  double a4_hz = 440.0;      // to which its keys are tuned
  std::uint8_t channel = 0;  // the first MIDI channel that it listens to, for who names none
  std::optional<Mode> mode;  // the lowest, by which keys set the pitch; else they do not; its
                             // frequency is that which sounds
  double highest_frequency_hz = 0.0;  // of a key, beyond which it is silent; 0: not tuned
  double stiffness_margin = 0.0;      // every stiffness may grow by this factor; below 1: unproved
  Verdict verdict = Verdict::stable;  // of what is always felt, in all ranges
};

// Hands whose ranges are in swings wait until it is known how far that is: the preset without them,
// to measure it by, and with them in positions, once a loud note swings so far.
bool has_swings(const Preset& preset);
Preset without_swings(Preset preset);
Preset in_positions(Preset preset, const Network& network, double swing);

// All that is known of a network before it sounds.
struct Analysis {
  std::optional<Mode> mode;  // the lowest, where keys set the pitch by it
  Pitches pitches;           // of keys, by that mode as it will be played
  PitchesAlong along;        // the same wherever the parameter is that is to leave keys in tune
  StabilityCheck stability;
  Margins margins;
  std::vector<std::optional<RestBound>> rest_bounds;  // [part]
};

// Of a preset that fits the network; `voices` and `gain` instead of its own. O(inputs * links).
// [any thread but audio]
Playing make_playing(const Network& network, const Preset& preset, const Analysis& analysis,
                     bool bare, int voices, double gain);
Instrument make_instrument(const Network& network, const Preset& preset, const Analysis& analysis,
                           int voices, double gain);
// Of a network as it is written, which the machine was made of.
std::vector<StruckInfo> find_struck(const Network& network, const Machine& machine);
// By which a mass of the network with its macros written out can be struck: its own, its macro's
// with its number, "s:3", a place of a body, "bell:rim", or where a place is when parameters are as
// they start, "s:0.25" and "m:0.5:0.333".
std::string struck_name(const Network& network, std::uint32_t mass);

}  // namespace ressort::compile
