// core/kernels: which modes a budget lets a part do without, and how long the others are heard.
#pragma once

#include <cstdint>
#include <vector>

#include "core/kernels/modal/modal_form.h"
#include "core/rooms.h"

namespace ressort::kernels {

// The modes of a part, for masses of 1, as they are at the start.
struct Hearing {
  std::vector<double> stiffness;               // [mode] lK
  std::vector<double> damping;                 // [mode] lZ
  std::vector<std::vector<double>> blows;      // [source][mode] what a blow of 1 adds to the speed
  std::vector<std::vector<double>> starts;     // {q, d}, as they are at first
  std::vector<std::vector<double>> listeners;  // [listener][mode] how far a mode of 1 moves it
};

struct Worth {
  std::vector<std::uint32_t> kept;  // modes, those first that are heard the longest
  std::vector<std::uint32_t> left_out;
  // Left out modes move a listener by no more than this share of how far all modes together do: of
  // the peak that one blow brings, or the start. Of blows in any number at any time, of how far all
  // could.
  double share = 0.0;
};

// Leaves out modes while that share, of every pair of a source and a listener, is at most `most`.
// Modes that do not ring stay. A peak is looked for in samples of the motion itself, so that it is
// never taken for more than it is. O(sources * listeners * modes + modes log modes), and at most
// some 1e7 for the peaks.
Worth weigh(const Hearing& hearing, double most);

}  // namespace ressort::kernels
