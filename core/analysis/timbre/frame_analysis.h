// core/analysis/timbre: descriptors of the frames of a sound. [one thread but audio]
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
  std::size_t size = 2048;  // Samples, at least 4; no zero padding.
  Window window = Window::hann;
  SpectrumKind kind = SpectrumKind::magnitude;
  std::optional<double> f0_hz = {};  // Without it no harmonics are computed.
};

struct FrameTimbre {
  double rms = 0.0;                        // RMS of the samples, unwindowed.
  std::optional<SpectralShape> shape;      // Absent for silence.
  std::optional<double> flux;              // Change since the previous frame; absent for the first.
  std::optional<HarmonicShape> harmonics;  // Descriptors of the first 20 harmonics.
  std::optional<double> noisiness;
};

// Analyses frames in order of time. Every bin from 0 Hz to half the rate counts. Harmonics always
// use a Hann window: the peak bin of each partial is refined by the window's derivative, which is
// exact for a single exponentially decaying partial (Auger and Flandrin 1995).
class FrameAnalysis {
 public:
  explicit FrameAnalysis(const FrameOptions& options);

  // Analyses `size` samples. A frame with samples that are not finite counts as silent.
  FrameTimbre next(std::span<const double> samples);

  const std::vector<double>& frequencies_hz() const { return frequencies_hz_; }  // [bin]
  // Spectrum of the last frame: [bin] amplitude of a sinusoid there, or its square.
  const std::vector<double>& spectrum() const { return spectrum_; }
  // Returns the spectral peaks of the last frame, down to 100 dB below the loudest, by frequency.
  std::vector<Partial> partials() const;

 private:
  using Complex = std::complex<double>;
  Complex raw(std::ptrdiff_t bin) const;  // Spectrum of the unwindowed frame, two-sided.
  Complex windowed(std::size_t bin, Window window) const;

  FrameOptions options_;
  Fourier fourier_;
  std::vector<double> frequencies_hz_;
  std::vector<Complex> bins_;
  std::vector<double> spectrum_;
  std::vector<double> before_;  // Spectrum of the previous frame.
  bool has_before_ = false;
};

// Cuts a stream of chunks of any length into frames that start `hop` samples apart.
class FrameStream {
 public:
  // Receives the index of the first sample and the frame; `analysis` still holds its spectrum.
  using Sink =
      std::function<void(std::size_t at, const FrameTimbre& timbre, const FrameAnalysis& analysis)>;
  FrameStream(const FrameOptions& options, std::size_t hop, Sink sink);

  void add(std::span<const double> samples);

 private:
  std::size_t size_;
  std::size_t hop_;
  Sink sink_;
  FrameAnalysis analysis_;
  std::vector<double> samples_;  // Samples from `first_` on.
  std::size_t first_ = 0;        // Index of samples_[0] in the stream.
  std::size_t next_ = 0;         // Start of the next frame.
};

}  // namespace ressort::analysis
