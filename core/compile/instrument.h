// core/compile: the names and ranges of an engine's parameters, inputs and masses, and the tables
// by which it is played.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "core/analysis/linear.h"
#include "core/compile/stability_check.h"
#include "core/engine/engine.h"
#include "core/gesture.h"
#include "core/knob_range.h"
#include "core/model/network.h"
#include "core/model/preset/preset.h"

namespace ressort::compile {

struct Proof;
struct TunedKeys;

struct InputInfo {
  int number = 1;
  bool is_force = false;
  std::vector<Gesture> gestures;  // gestures of the preset's controls
  std::string attached_to;        // name of the mass that it moves or pushes
  bool knows(Gesture gesture) const {
    return std::ranges::find(gestures, gesture) != gestures.end();
  }
};

// An OSC address that the preset gives to one of its controls.
struct CustomInfo {
  std::string address;
  int row = 0;  // Event::index of EventKind::custom
};

// A controller to which the preset gives a name. The position of the knob, 0 to 1, is that of its
// parameter in the knob's range, whatever has set the parameter.
struct KnobInfo {
  std::string name;                      // "Bow pressure"
  std::string word;                      // the same in addresses and commands: "bow-pressure"
  std::string help;                      // one line; may be empty
  int controller = 0;                    // -1: none, only messages move it
  std::optional<std::size_t> parameter;  // nothing: the knob moves inputs only
  KnobRange range;                       // of the parameter
  double rest = 0.0;                     // position of a knob without a parameter until it moves

  std::string address() const { return "/control/" + word; }
};

// Masses that can be struck by name: a mass, a place on a macro, or all nodes of a macro, which are
// named "NAME:1" and so on. Culled masses are not listed.
struct StruckInfo {
  std::string name;
  std::uint32_t first = 0;  // Event::value2 of EventKind::strike
  std::vector<bool> moves;  // [node of the macro] whether it is free; empty: one mass
};

// The interface of a running engine. Indices are those of Event.
struct Instrument {
  std::vector<ParameterInfo> parameters;  // [parameter]
  std::vector<InputInfo> inputs;
  std::vector<CustomInfo> custom;
  std::vector<KnobInfo> knobs;     // brightness, ring, touch, the wheel and space first
  std::vector<StruckInfo> struck;  // sorted by name
  double blow = 0.0;  // force of a hard strike on a mass during one sample at 44,100 Hz
  int outputs = 0;
  int audio_inputs = 0;  // highest audio channel of a control or parameter
  int voices = 1;
  double gain = 1.0;       // output per unit of position: the preset's, or the one found
  std::size_t masses = 0;  // moving masses
  std::size_t links = 0;
  int transpose = 0;         // semitones from a key to its pitch
  double a4_hz = 440.0;      // pitch of A4
  std::uint8_t channel = 0;  // first MIDI channel of the preset
  std::optional<Mode> mode;  // lowest mode, with its sounding frequency; nothing: keys are untuned
  double highest_frequency_hz = 0.0;  // higher keys are silent; 0: untuned
  double stiffness_margin = 0.0;      // proved factor on every stiffness; below 1: unproved
  Verdict verdict = Verdict::stable;  // verdict on everything but contacts, over all ranges
};

// Returns whether the ranges of any control are in swings, multiples of the displacement of a loud
// note, which has to be measured first.
bool has_swings(const Preset& preset);
// Returns the preset without these controls, at gain 1, to measure the swing with.
Preset without_swings(Preset preset);
// Returns the preset with these ranges as positions. `swing`: peak displacement of a loud note.
Preset in_positions(Preset preset, const Network& network, double swing);

// Returns the frequencies of the preset's keys, transposed.
KeyFrequencies key_frequencies(const Preset& preset);

// Returns the curves of the parameters whose values differ from voice to voice, [parameter], within
// the proved ranges. The curve of a parameter that only an LFO moves is constant. Empty if there
// are none. [any thread but audio]
std::vector<std::optional<VoiceCurve>> voice_curves(const Network& network, const Preset& preset,
                                                    const StabilityCheck& stability);

// Collects the results of the stages for the engine. O(inputs * links). [any thread but audio]
Playing make_playing(const Network& network, const Preset& preset, const Proof& proof,
                     const TunedKeys& keys, bool bare, int voices, double gain);
Instrument make_instrument(const Network& network, const Preset& preset, const Proof& proof,
                           const TunedKeys& keys, int voices, double gain);
// Returns the masses that can be struck. `network`: as written, with its macros.
std::vector<StruckInfo> find_struck(const Network& network, const Machine& machine);
// Returns the name by which a mass of the expanded network is struck: its own; its macro's with the
// node's number, "s:3"; the place of a body, "bell:rim"; or its place on a macro with the
// parameters at their start, "s:0.25" or "m:0.5:0.333".
std::string struck_name(const Network& network, std::uint32_t mass);

}  // namespace ressort::compile
