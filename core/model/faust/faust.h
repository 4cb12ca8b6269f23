// core/model: a network as a program in FAUST, to be compiled into plugins, phones and boards.
#pragma once

#include <span>
#include <string>

#include "core/model/network.h"
#include "core/model/preset/preset.h"
#include "core/result.h"

namespace ressort::model {

struct FaustOptions {
  std::string name;                           // of the model, for people
  std::span<const ParameterSetting> sliders;  // one for each of Network::parameters, in their order
  bool rescale = true;                        // numbers follow the sample rate, as in the engine
};

// A whole FAUST program without libraries, which computes what the engine computes, tick by tick:
// process has a channel for each input and output up to the highest number in use, gaps included,
// and a slider for each parameter that no input gives. Refuses a model without outputs, as FAUST
// does, and of waveguides those that an input tunes, places that parameters move, and what holds
// them too many at once or moved from the start. [any thread but audio]
Result<std::string> faust_text(const Network& network, const FaustOptions& options);

// Masses and links together, macros written out. FAUST's own time grows with the square and more:
// ten seconds and half a gigabyte for this many, a minute for twice as many.
std::size_t faust_elements(const Network& network);
inline constexpr std::size_t comfortable_faust_elements = 2000;

}  // namespace ressort::model
