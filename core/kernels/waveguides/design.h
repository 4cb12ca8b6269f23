// core/kernels: the numbers of one waveguide, so that its lowest partial has exactly the pitch and
// the decay asked for. A pure calculation.
//
// A wave goes round in N whole samples, through a first-order allpass and a loss:
//
//   L(z) = z^-N (c + z^-1)/(1 + c z^-1) g (1 - a)/(1 - a z^-1)
//
// c and a are solved so that L(z) = 1 at the pole z = e^(-ln 1000/(T60 rate)) e^(2 pi j hz/rate),
// by closed forms on the unit circle and Newton's method at the pole itself. The loss never
// exceeds g <= 1, so that the loop is passive whatever is attached to it.
//
// Sources: Jaffe and Smith, Computer Music Journal 7(2), 1983 (allpass); Karjalainen, Välimäki and
// Tolonen, Computer Music Journal 22(3), 1998 (one-pole loss).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/rooms.h"
#include "core/waveguide_places.h"

namespace ressort::kernels {

struct WaveguideNumbers {
  double frequency_hz = 0.0;
  double t60_s = 0.0;
  // 1: all partials decay alike; 0: the lowest loses nothing that does not grow with the square of
  // the frequency, as far as one pole does so.
  double brightness = 1.0;
};

struct WaveguideDesign {
  std::uint32_t samples = 0;  // N
  double period = 0.0;        // of the lowest partial, in samples
  double allpass = 0.0;       // c
  double pole = 0.0;          // a
  double gain = 1.0;          // g
};

inline constexpr double least_t60_periods = 3.0;  // a faster decay is no tone

// How high a waveguide may be at rate_hz, if there are to be so many samples in the loop.
double highest_waveguide_hz(std::uint32_t least_samples, double rate_hz);

// At rate_hz, with N in [least_samples, most_samples]: a frequency that would need fewer or more
// becomes the highest or the lowest that does not. T60 counts as least_t60_periods at least; what
// is no number counts as the least. [any thread] wait-free
WaveguideDesign design_waveguide(const WaveguideNumbers& numbers, std::uint32_t least_samples,
                                 std::uint32_t most_samples, double rate_hz);

// Where places at coordinates `u`, 0..1 from end to end, are: after how many samples from the
// filters, 1..N, a wave passes each to the left and to the right, [place, 2]. Every delay is the
// nearest sample that is its own. `order` is room for their order. [any thread] wait-free
void find_places(const WaveguideDesign& design, const FiltersAt& filters, std::span<const double> u,
                 std::span<std::uint32_t> order, std::span<std::uint32_t> delays);

}  // namespace ressort::kernels
