// core/compile: the only bridge from names to numbers. Makes an Engine from a Network and a Preset.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/compile/instrument.h"
#include "core/compile/options.h"
#include "core/compile/plan.h"
#include "core/compile/schemes.h"
#include "core/compile/stability_check.h"
#include "core/engine/engine.h"
#include "core/result.h"

namespace ressort::compile {

// A body that the voices pass through, as compiled. Errors have lines of its file.
struct CompiledBody {
  std::string file;
  StabilityCheck stability;
  std::optional<Error> hazard;      // see Schemes
  std::optional<Error> strong_bow;  // see Compiled
};

struct Compiled {
  std::unique_ptr<Engine> engine;
  Instrument instrument;
  Plan plan;
  StabilityCheck stability;  // the caller decides whether an unstable engine may play
  Schemes schemes;
  std::optional<Error> strong_bow;   // a bow too strong for its time steps, at the model's line
  std::vector<CompiledBody> bodies;  // bodies of the preset's `through`, in their order
};

// Compiles a network in stages (see compile_by_stages() in compile.cpp). Fails with the preset's
// line if the preset does not fit the network, with the model's line if an argument is not finite
// at the start values, and if the engine does not fit into memory. The preset's bodies
// become one engine with it. [any thread but audio]
Result<Compiled> compile_network(const Network& network, const Preset& preset,
                                 const CompileOptions& options);

}  // namespace ressort::compile
