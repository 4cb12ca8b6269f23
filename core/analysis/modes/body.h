// core/analysis/modes: converts a network into its modes at some places, and the modes at one place
// into a chain of masses and springs.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/analysis/modes/modes.h"
#include "core/model/network.h"
#include "core/result.h"

namespace ressort::analysis {

// A mode as a line of the language's `body`: an independent oscillator of mass `mass` that all
// places excite and hear in proportion to their displacements.
struct PlacedMode {
  double frequency_hz = 0.0;         // Frequency of the damped pole.
  double t60_s = 0.0;                // Infinite if undamped.
  std::vector<double> displacement;  // [place]
};

struct PlacedModes {
  std::string name = "body";
  double mass = 1.0;
  std::vector<std::string> places;
  std::vector<PlacedMode> modes;
  // The largest imaginary part of a displacement, relative to it, that was dropped. With
  // non-proportional damping the places move out of phase, which a mode of a body cannot represent.
  double left_out = 0.0;
};

// Returns a network's modes at its force inputs (in1...) and position outputs (out1...). A mass
// with several of these is one place and has the first name. Modes above 0.45 of the rate and modes
// that no place hears are left out.
PlacedModes placed_modes(const NetworkModes& modes);

// Returns lines of the language: a `body` and its `mode` lines.
std::string body_text(const PlacedModes& modes);

// A chain whose first mass responds like the place. `network` has masses NAME_m0, NAME_m1, ...,
// springs between neighbours, and one spring from the first mass to a ground, at rest.
struct ModalChain {
  Network network;
  double worst_t60_percent = 0.0;  // Worst over all modes.
};

// Makes the chain by Lanczos from the displacements at the place, for the published scheme at
// 44,100 Hz: it has the same frequencies and the same share of each at the place. Dampers are Z = a
// M to the ground and Z = b K between neighbours, fitted to the decays. Modes that do not move the
// place are left out. Fails if no mode moves it, if two such modes have equal frequencies, or if
// the scheme cannot reach a frequency.
Result<ModalChain> chain_of(const PlacedModes& modes, std::string_view place);

}  // namespace ressort::analysis
