// core/compile: the only bridge from names to numbers. A Network and a Preset become an Engine.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/analysis/interval.h"
#include "core/analysis/linear.h"
#include "core/compile/plan.h"
#include "core/compile/schemes.h"
#include "core/compile/stability_check.h"
#include "core/engine/engine.h"
#include "core/gesture.h"
#include "core/model/network.h"
#include "core/model/preset/preset.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort {

// A larger network is played as it is written: finding its lowest mode would take too long.
inline constexpr std::size_t most_tuned_masses = 150'000;

struct CompileOptions {
  double rate_hz = 44100.0;
  bool rescale = true;  // numbers are meant at 44 100 Hz: keep pitch and decay at other rates
  bool bare = false;    // no smoothing, no sleep: the network as it is written
  int voices = 0;       // instead of the preset's; 0: the preset's
  Precision precision = Precision::float64;
  std::optional<Method> method;  // instead of the plan's choice, or the bare network's direct form
  std::optional<Budget> budget;  // instead of the preset's
  std::vector<std::uint32_t> passive_links;  // of Network::links with its macros written out: to
                                             // be found passively, whatever the budget says
  Isa isa = best_isa();                      // no wider than the machine's
  std::uint32_t most_modes = patient_modes;  // of a part, for the plan
  Executor* executor = nullptr;   // outlives the engine, which it steps large parts of; null: none
  bool find_gain = false;         // so that a forte note peaks at -6 dBFS, instead of the preset's
  bool force = false;             // no range is narrowed to what is stable
  std::vector<Setting> settings;  // values that the bare network's parameters get at once
  std::vector<Setting> reach;     // and those that they will get later: the bare network's ranges
  Progress progress = {};         // a load that it stops fails with `stopped`
  std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max();  // that the engine may take
};

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

// What a running engine is called from outside; indices are those of Event.
struct Instrument {
  std::vector<ParameterInfo> parameters;  // [parameter]
  std::vector<InputInfo> inputs;
  std::vector<CustomInfo> custom;
  int outputs = 0;
  int audio_inputs = 0;  // the highest audio channel that a control listens to
  int voices = 1;
  double gain = 1.0;       // output per position unit: the preset's, or what was found
  std::size_t masses = 0;  // that move
  std::size_t links = 0;
  bool is_tuned = false;              // keys set the pitch
  int transpose = 0;                  // semitones from a key to its pitch
  std::optional<Mode> mode;           // the lowest
  double highest_frequency_hz = 0.0;  // of a key, before it is folded down; 0: not tuned
  double stiffness_margin = 0.0;      // every stiffness may grow by this factor; below 1: unproved
  Verdict verdict = Verdict::stable;  // of what is always felt, in all ranges
};

struct Compiled {
  std::unique_ptr<Engine> engine;
  Instrument instrument;
  Plan plan;
  StabilityCheck stability;         // whoever lets it sound has asked this
  std::vector<LinkScheme> schemes;  // [link] of the network without macros
};

// Where the preset lets the parameters be turned to; those that it does not name stay. As it says,
// not as it was narrowed.
ParameterBox preset_box(const std::vector<ParameterInfo>& parameters, const Preset& preset);

// Fails, with the preset's line, where the preset does not fit (see misfits()); and with the
// model's line where an argument of the model is no finite number as it starts.
// [any thread but audio]
Result<Compiled> compile(const Network& network, const Preset& preset,
                         const CompileOptions& options);

}  // namespace ressort
