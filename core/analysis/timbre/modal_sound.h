// core/analysis/timbre: synthesises decaying modes sample by sample. [one thread but audio]
#pragma once

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

#include "core/rooms.h"

namespace ressort::analysis {

// A mode is state e^(pole n), n in samples; its imaginary part is the output.
class ModalSound {
 public:
  struct Motion {
    std::complex<double> pole;                 // Logarithm of its growth per sample.
    std::vector<std::complex<double>> pushed;  // [pulse] Change of its state by a unit pulse.
  };
  // Pulses are force sequences that all start at the first sample.
  ModalSound(std::span<const Motion> motions, std::vector<std::vector<double>> pulses);

  // Computes the next samples. O(motions * samples)
  void next(std::span<double> samples);

  // Computes the magnitude of the analytic signal (the sum of all states) after every `step`
  // samples. While a pulse lasts, O(step) each.
  void next_magnitudes(std::span<double> magnitudes, std::size_t step);

  bool is_pushed() const { return at_ < pulse_end_; }  // True while a pulse acts.

  // Returns an upper estimate of the future envelope without further pulses, over a time of
  // `resolution_s`: amplitudes of modes that can come into phase add up, others add up as energies.
  double most_left(double rate_hz, double resolution_s) const;

 private:
  using Numbers = std::vector<double>;  // [motion]
  struct Turns {                        // Factors of all states, real and imaginary parts.
    Numbers real, imaginary;
  };
  void turn(const Turns& turns);
  void push_and_turn();
  void clear_faint();

  std::vector<std::vector<double>> pulses_;
  std::size_t pulse_end_ = 0;
  std::size_t at_ = 0;
  // Sorted by frequency.
  Turns turns_;  // Per sample.
  Numbers real_, imaginary_;
  std::vector<Turns> pushed_;  // [pulse]
};

}  // namespace ressort::analysis
