// core/analysis/modes: a network as its modes at some places, and a place of such modes as a chain
// of masses and springs.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/analysis/modes/modes.h"
#include "core/model/network.h"
#include "core/result.h"

namespace ressort::analysis {

// Modes as a `body` of the language has them: each swings alone as a mass of `mass` that all places
// push and hear by their displacements.
struct PlacedMode {
  double frequency_hz = 0.0;         // of the damped pole
  double t60_s = 0.0;                // infinity: nothing damps it
  std::vector<double> displacement;  // [place]
};

struct PlacedModes {
  std::string name = "body";
  double mass = 1.0;
  std::vector<std::string> places;
  std::vector<PlacedMode> modes;
  // The largest imaginary share of a displacement that had to be left out: where damping is not
  // proportional places swing at different times, and a mode of a body cannot.
  double left_out = 0.0;
};

// A network's modes at its force inputs (in1...) and position outputs (out1...); a mass that is
// several of these is one place, of the first name. Modes above 0.45 of the rate, and those that no
// place hears, are left out.
PlacedModes placed_modes(const NetworkModes& modes);

// Lines of the language: a `body` and its `mode` lines.
std::string body_text(const PlacedModes& modes);

// A chain whose first mass answers as the place does: `network` has masses NAME_m0, NAME_m1...,
// springs between neighbours and one from the first to a ground, at rest.
struct ModalChain {
  Network network;
  double worst_t60_percent = 0.0;  // of all modes
};

// By Lanczos from the place's displacements, as published at 44 100 Hz: the same frequencies and
// the same share of each at the place. Dampers are Z = a M to the ground and Z = b K between
// neighbours, the nearest to the modes' decays. Modes that the place does not move are left out.
// Fails where it moves none, where two that it moves have one frequency, or a frequency is none of
// the scheme's.
Result<ModalChain> chain_of(const PlacedModes& modes, std::string_view place);

}  // namespace ressort::analysis
