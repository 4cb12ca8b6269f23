// core/analysis/timbre: what a frame of sound is like. [one thread but audio]
#pragma once

#include <complex>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/analysis/timbre/descriptors.h"
#include "core/analysis/timbre/window.h"
#include "core/linear_algebra/fourier.h"

namespace ressort::analysis {

struct FrameOptions {
  double rate_hz = 48000.0;
  std::size_t size = 2048;  // samples, from 4 on; nothing is padded
  Window window = Window::hann;
  SpectrumKind kind = SpectrumKind::magnitude;
  std::optional<double> f0_hz = {};  // without it nothing is harmonic
};

struct FrameTimbre {
  double rms = 0.0;                        // of the samples, without a window
  std::optional<SpectralShape> shape;      // nothing of silence
  std::optional<double> flux;              // since the frame before; nothing of the first
  std::optional<HarmonicShape> harmonics;  // of the first 20
  std::optional<double> noisiness;
};

// Frames in the order of their time. From 0 Hz to half the rate every bin counts. Harmonics are
// looked for with a Hann window, whatever the other is: each at the largest bin of a partial, and
// from there by the window's derivative, which is exact for a lone one that decays by itself
// (Auger and Flandrin 1995).
class FrameAnalysis {
 public:
  explicit FrameAnalysis(const FrameOptions& options);

  // Of `size` samples. Those that are no finite numbers make it silent.
  FrameTimbre next(std::span<const double> samples);

  const std::vector<double>& frequencies_hz() const { return frequencies_hz_; }  // [bin]
  // Of the last frame: [bin] amplitude of a sinusoid there, or its square.
  const std::vector<double>& spectrum() const { return spectrum_; }
  // What rises above its neighbours in the last frame, down to 100 dB below the loudest, by
  // frequency.
  std::vector<Partial> partials() const;

 private:
  using Complex = std::complex<double>;
  Complex raw(std::ptrdiff_t bin) const;  // of the frame without a window, on both sides of 0
  Complex windowed(std::size_t bin, Window window) const;

  FrameOptions options_;
  Fourier fourier_;
  std::vector<double> frequencies_hz_;
  std::vector<Complex> bins_;
  std::vector<double> spectrum_;
  std::vector<double> before_;  // the spectrum of the frame before
  bool has_before_ = false;
};

// Cuts what comes, in pieces of any length, into frames that start `hop` samples apart.
class FrameStream {
 public:
  // `sink` gets the first sample's number and the frame; `analysis` still has its spectrum then.
  using Sink =
      std::function<void(std::size_t at, const FrameTimbre& timbre, const FrameAnalysis& analysis)>;
  FrameStream(const FrameOptions& options, std::size_t hop, Sink sink);

  void add(std::span<const double> samples);

 private:
  std::size_t size_;
  std::size_t hop_;
  Sink sink_;
  FrameAnalysis analysis_;
  std::vector<double> samples_;  // from `first_` on
  std::size_t first_ = 0;        // number of samples_[0]
  std::size_t next_ = 0;         // where the next frame starts
};

}  // namespace ressort::analysis
