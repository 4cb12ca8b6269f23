// core/model: exports a network as a FAUST program.
#pragma once

#include <span>
#include <string>

#include "core/model/network.h"
#include "core/model/preset/preset.h"
#include "core/result.h"

namespace ressort::model {

struct FaustOptions {
  std::string name;                           // name of the model
  std::span<const ParameterSetting> sliders;  // [parameter], one for each
  bool rescale = true;  // coefficients follow the sample rate, as in the engine
  std::span<const LawFacts> laws = law_table();  // facts by Law; tests export a law of their own
};

// Returns a complete FAUST program without libraries, which computes the engine's samples.
// `process` has a channel for each input and output up to the highest number in use, and a slider
// for each parameter that no input drives. Fails for a model without outputs, and for waveguides
// that an audio input tunes, whose places move, or where two links move the same mass or place.
// [any thread but audio]
Result<std::string> faust_text(const Network& network, const FaustOptions& options);

// Returns the number of masses and links, with macros expanded. The FAUST compiler's time grows at
// least with its square: it takes ten seconds and 0.5 GB for the number below, and a minute for
// twice as many.
std::size_t faust_elements(const Network& network);
inline constexpr std::size_t comfortable_faust_elements = 2000;

}  // namespace ressort::model
