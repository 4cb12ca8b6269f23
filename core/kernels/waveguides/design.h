// core/kernels: designs the filters of one waveguide such that its lowest partial has exactly the
// requested pitch and decay. A pure calculation.
//
// The loop has N samples of delay, a first-order allpass and a loss filter:
//
//  L(z) = z^-N (c + z^-1)/(1 + c z^-1) g (1 - a)/(1 - a z^-1)
//
// c and a solve L(z) = 1 at the pole z = e^(-ln 1000/(T60 rate)) e^(2 pi j hz/rate): in closed form
// on the unit circle, then by Newton's method at the pole itself. The loss never exceeds g <= 1, so
// the loop is passive whatever is attached to it.
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
  // 1: all partials decay alike. 0: the loss grows with the square of the frequency from 0, as far
  // as a one-pole filter allows.
  double brightness = 1.0;
};

struct WaveguideDesign {
  std::uint32_t samples = 0;  // N.
  double period = 0.0;        // Period of the lowest partial in samples.
  double allpass = 0.0;       // c.
  double pole = 0.0;          // a.
  double gain = 1.0;          // g.
};

inline constexpr double least_t60_periods = 3.0;  // Shortest T60; a faster decay has no pitch.

// Returns the highest frequency of a waveguide at rate_hz with at least so many samples in the
// loop.
double highest_waveguide_hz(std::uint32_t least_samples, double rate_hz);

// Designs a waveguide at rate_hz with N in [least_samples, most_samples]. A frequency outside the
// corresponding range is clamped, as is a T60 below least_t60_periods; NaN counts as the lowest
// value. [any thread] wait-free
WaveguideDesign design_waveguide(const WaveguideNumbers& numbers, std::uint32_t least_samples,
                                 std::uint32_t most_samples, double rate_hz);

// Finds the delays of places at the coordinates `u`, 0..1 from end to end: the number of samples,
// 1..N, after the filters at which the left- and right-going waves pass each: [place, 2]. Every
// delay is the nearest free sample. `order` is work memory. [any thread] wait-free
void find_places(const WaveguideDesign& design, const FiltersAt& filters, std::span<const double> u,
                 std::span<std::uint32_t> order, std::span<std::uint32_t> delays);

}  // namespace ressort::kernels
