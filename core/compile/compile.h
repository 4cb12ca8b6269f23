// core/compile: the only bridge from names to numbers. A Network and a Preset become an Engine.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "core/compile/instrument.h"
#include "core/compile/machine.h"
#include "core/compile/plan.h"
#include "core/compile/schemes.h"
#include "core/compile/stability_check.h"
#include "core/engine/engine.h"
#include "core/model/network.h"
#include "core/model/preset/preset.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::compile {

// A larger network is played as it is written: finding its lowest mode would take too long.
inline constexpr std::size_t most_tuned_masses = 150'000;

struct CompileOptions {
  double rate_hz = 44100.0;
  bool rescale = true;    // numbers are meant at 44 100 Hz: keep pitch and decay at other rates
  bool bare = false;      // no smoothing, no sleep: the network as it is written
  int voices = 0;         // instead of the preset's; 0: the preset's
  NoteShare::Part share;  // of the notes
  Precision precision = Precision::float64;
  std::optional<Method> method;  // instead of the plan's choice, or the bare network's direct form
  std::optional<Budget> budget;  // instead of the preset's
  Isa isa = best_isa();          // no wider than the machine's
  std::uint32_t most_modes = patient_modes;  // of a part, for the plan
  Executor* executor = nullptr;   // outlives the engine, which it helps to step; null: none
  bool find_gain = false;         // so that a forte note peaks at -6 dBFS, instead of the preset's
  bool force = false;             // no range is narrowed to what is stable
  std::vector<Setting> settings;  // values that the bare network's parameters get at once
  std::vector<Setting> reach;     // and those that they will get later: the bare network's ranges
  Progress progress = {};         // a load that it stops fails with `stopped`
  std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max();  // that the engine may take
};

struct Compiled {
  std::unique_ptr<Engine> engine;
  Instrument instrument;
  Plan plan;
  StabilityCheck stability;  // whoever lets it sound has asked this
  Schemes schemes;
  std::optional<Error> strong_bow;  // that one is too strong for its steps, at the model's line
};

// One stage after the other, each a function from what is known to what it finds. Fails, with the
// preset's line, where the preset does not fit (see misfits()); with the model's line where an
// argument of the model is no finite number as it starts; and where memory is short.
// [any thread but audio]
Result<Compiled> compile_network(const Network& network, const Preset& preset,
                                 const CompileOptions& options);

}  // namespace ressort::compile
