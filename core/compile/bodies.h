// core/compile: the stage that compiles the models of a preset's `through`: bodies that the sum of
// all voices passes through.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/compile/compile.h"

namespace ressort::compile {

// Compiles the first body of the preset for one voice, with the other bodies behind it. Nothing if
// the preset has none. Parameters that the body shares with the network start at its values.
// `forms_before`: number of CompileOptions::forms that belong to the voices. Errors have the body's
// file in the message. [any thread but audio]
Result<std::optional<Compiled>> compile_body(const CompileRequest& request, const Network& network,
                                             std::span<const double> start,
                                             std::size_t forms_before);

// Gain from the voices' outputs, all in phase, to an output of the last body.
struct BodyGain {
  double largest = 1.0;                  // at any frequency from 20 Hz
  double mean = 1.0;                     // for white noise
  std::vector<double> response = {1.0};  // see Playing::body_response
};

// Measures the gain by the response to impulses of up to 1.5 s. Takes about a quarter of a second
// for a large body. Then the body rests at its start. 1 for a body without a response. [any thread
// but audio]
BodyGain measure_gain(Compiled& body, const Progress& progress);

// Narrows the ranges of the parameters that the voices share with the body to those of the body.
StabilityCheck within_ranges_of(const Compiled& body, StabilityCheck voices);

// Sends the voices of `voices` through the body, and adds what is known about it to the instrument
// and the plan. `file`: the body's.
void add_body(Compiled& voices, Compiled body, const std::string& file);

}  // namespace ressort::compile
