// core/compile: the inputs of one compilation. Every stage reads them and none changes them.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/compile/machine.h"
#include "core/compile/plan.h"
#include "core/compile/stability_check.h"
#include "core/engine/engine.h"
#include "core/model/network.h"
#include "core/model/preset/preset.h"
#include "core/progress.h"

namespace ressort::compile {

struct CompileOptions {
  double rate_hz = 44100.0;
  bool rescale = true;    // keeps pitch and decay at other rates than the model's 44,100 Hz
  bool bare = false;      // the network as written: no smoothing and no sleep
  int voices = 0;         // replaces the preset's number; 0: the preset's
  NoteShare::Part share;  // share of the notes that this engine plays
  std::optional<Precision> precision;        // replaces the preset's
  std::optional<Method> method;              // replaces the plan's choice
  std::optional<Budget> budget;              // replaces the preset's
  Isa isa = best_isa();                      // no wider than the machine's
  std::uint32_t most_modes = patient_modes;  // masses of a part up to which modes are computed
  // measurements for the plan; null: the same forms on every machine
  const Timings* timings = nullptr;
  std::vector<std::string> forms;  // forms of an earlier plan, which is repeated; see Choice
  Executor* executor = nullptr;    // helper threads; outlives the engine; null: none
  bool find_gain = false;          // choose the gain so that a forte note peaks at -6 dBFS
  bool force = false;              // do not narrow ranges to stable values
  std::vector<Setting> settings;   // initial values of the bare network's parameters
  std::vector<Setting> reach;      // values that its parameters will get later
  Progress progress = {};          // stopping it makes compile_network() fail with `stopped`
  std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max();  // limit of the engine
};

struct CompileRequest {
  const Network& written;  // network with its macros
  const Preset& preset;
  const CompileOptions& options;
  Budget budget = options.budget.value_or(preset.budget);
  Precision precision = options.precision.value_or(preset.precision);
  double rate_ratio = rate_ratio_of(options.rate_hz, options.rescale);
  int voices = options.voices > 0 ? options.voices : preset.voices;

  // Returns whether the output has to be the published scheme to the bit: a bare network by the
  // direct method, without a budget.
  bool is_published() const {
    return options.bare && options.method == Method::direct && !budget.is_physical() &&
           budget.silence_db == -Budget::unlimited;
  }
};

}  // namespace ressort::compile
