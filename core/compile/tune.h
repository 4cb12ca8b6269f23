// core/compile: the stage that tunes keys: the factor on every stiffness at which the lowest mode,
// as the chosen kernel plays it, has the pitch of a key.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/compile/analyse.h"
#include "core/compile/plan.h"
#include "core/compile/prove.h"

namespace ressort::compile {

struct TunedKeys {
  std::optional<Mode> mode;  // the mode that keys tune, with its sounding frequency
  Pitches pitches;           // pitches with the parameters at their start values; empty: untuned
  std::vector<Pitches>
      by_key;          // [key] the same at its own parameters, near its pitch; may be empty
  Pitches warp;        // see Playing; may be empty
  PitchesAlong along;  // along the one parameter that leaves keys in tune; may be empty
  double highest_factor = 0.0;  // largest stiffness factor that keys may use
  std::vector<double> away;     // the same at equal steps from the box to the limits, as in Margins
  std::vector<std::string> notes;
};

// `curves`: result of voice_curves(). [any thread but audio]
TunedKeys tune(const CompileRequest& request, const Network& network, const Analysis& analysis,
               const Margins& margins, const Planned& planned,
               const std::vector<std::optional<VoiceCurve>>& curves = {});

}  // namespace ressort::compile
