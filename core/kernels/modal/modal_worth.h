// core/kernels: chooses the modes that a budget of silence leaves out, and sorts the others by the
// time for which they are audible.
#pragma once

#include <cstdint>
#include <vector>

#include "core/kernels/modal/modal_form.h"
#include "core/rooms.h"

namespace ressort::kernels {

// The modes of a part at the start, for masses of 1, and what excites and reads them.
struct ModalResponse {
  std::vector<double> stiffness;            // [mode] lK
  std::vector<double> damping;              // [mode] lZ
  std::vector<std::vector<double>> blows;   // [source][mode] velocity after a unit impulse
  std::vector<std::vector<double>> starts;  // {q, d} at the start
  std::vector<std::vector<double>>
      listeners;  // [listener][mode] displacement per displacement of a mode
};

struct ModeSelection {
  std::vector<std::uint32_t> kept;  // modes, those that are audible longest first
  std::vector<std::uint32_t> left_out;
  // Bound on the error of a listener by the modes that are left out. For one impulse and for the
  // initial state it is relative to the peak of all modes together. For any sequence of impulses it
  // is relative to the largest possible displacement.
  double share = 0.0;
};

// Leaves out modes while that bound, for every pair of a source and a listener, is at most `most`.
// Modes that do not ring are kept. Peaks are the largest of some samples of the motion, so they are
// never overestimated. O(sources * listeners * modes + modes log modes), plus at most about 1e7
// operations for the peaks.
ModeSelection select_modes(const ModalResponse& hearing, double most);

}  // namespace ressort::kernels
