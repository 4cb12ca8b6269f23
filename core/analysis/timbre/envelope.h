// core/analysis/timbre: the envelope of a sound, block by block. [one thread but audio]
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "core/linear_algebra/fourier.h"

namespace ressort::analysis {

// The low-pass of an envelope: Butterworth, of the third order.
class EnvelopeFilter {
 public:
  explicit EnvelopeFilter(double rate_hz);
  double next(double magnitude);
  long long delay() const { return delay_; }  // samples, at 0 Hz

 private:
  long long delay_ = 0;
  // Coefficients and states of its two parts, direct form II transposed.
  std::array<double, 3> one_b_{}, one_a_{}, two_b_{}, two_a_{}, one_z_{}, two_z_{};
};

// The magnitude of the analytic signal, |x + i Hilbert x|, through a Butterworth low-pass of the
// third order whose delay is taken back. Peeters et al. 2011 end it at 5 Hz, which makes of every
// attack one of 0.1 s; here it ends at 50 Hz. Below 12 Hz the analytic signal is inexact.
class Envelope {
 public:
  static constexpr double cutoff_hz = 50.0;

  // `sink` gets as many numbers as samples come, each at least 0.
  Envelope(double rate_hz, std::function<void(double)> sink);
  void add(std::span<const double> samples);
  void end();  // what is still on its way

 private:
  void take(double sample);
  void transform();
  void smooth(double magnitude);

  std::size_t block_;  // samples; half a window, and a fourth of a transform
  std::function<void(double)> sink_;
  Fourier fourier_;
  std::vector<double> window_;   // [2 blocks] of which neighbours add up to 1
  std::vector<double> samples_;  // [3 blocks] the last that came
  std::size_t filled_ = 0;       // of the newest block
  std::vector<double> frame_;    // [4 blocks]
  std::vector<std::complex<double>> bins_;
  std::vector<double> turned_;  // [4 blocks] the Hilbert transform as far as it is added up
  long long came_ = 0;
  long long told_ = 0;
  long long next_ = 0;  // which sample the next magnitude is of; it starts before the first
  EnvelopeFilter filter_;
};

}  // namespace ressort::analysis
