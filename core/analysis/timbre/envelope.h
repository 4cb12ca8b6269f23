// core/analysis/timbre: the envelope of a sound, computed block by block. [one thread but audio]
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "core/linear_algebra/fourier.h"

namespace ressort::analysis {

// Butterworth low-pass of third order for an envelope.
class EnvelopeFilter {
 public:
  explicit EnvelopeFilter(double rate_hz);
  double next(double magnitude);
  long long delay() const { return delay_; }  // Group delay at 0 Hz, in samples.

 private:
  long long delay_ = 0;
  // Coefficients and states of the first-order and the second-order section, transposed direct form
  // II.
  std::array<double, 3> one_b_{}, one_a_{}, two_b_{}, two_a_{}, one_z_{}, two_z_{};
};

// The magnitude of the analytic signal, |x + i Hilbert x|, through a third-order Butterworth
// low-pass whose delay is compensated. Peeters et al. 2011 use a cutoff of 5 Hz, which turns every
// attack into 0.1 s; the cutoff here is 50 Hz. Below 12 Hz the analytic signal is inexact.
class Envelope {
 public:
  static constexpr double cutoff_hz = 50.0;

  // Calls `sink` once per input sample with a value of at least 0.
  Envelope(double rate_hz, std::function<void(double)> sink);
  void add(std::span<const double> samples);
  void end();  // Flushes the delayed samples.

 private:
  void take(double sample);
  void transform();
  void smooth(double magnitude);

  std::size_t block_;  // Samples: half a window, a quarter of a transform.
  std::function<void(double)> sink_;
  Fourier fourier_;
  std::vector<double> window_;   // [2 blocks] Overlapping windows add up to 1.
  std::vector<double> samples_;  // [3 blocks] The latest samples.
  std::size_t filled_ = 0;       // Filled samples of the newest block.
  std::vector<double> frame_;    // [4 blocks]
  std::vector<std::complex<double>> bins_;
  std::vector<double> turned_;  // [4 blocks] Partial sum of the Hilbert transform.
  long long came_ = 0;
  long long told_ = 0;
  // Index of the next output sample; negative at the start because of the delay.
  long long next_ = 0;
  EnvelopeFilter filter_;
};

}  // namespace ressort::analysis
