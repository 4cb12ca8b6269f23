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

  bool is_pushed() const { return at_ < pulse_end(); }  // True while a pulse acts.

  // Returns an upper estimate of the future envelope without further pulses, over a time of
  // `resolution_s`: amplitudes of modes that can come into phase add up, others add up as energies.
  double most_left(double rate_hz, double resolution_s) const;

 private:
  static constexpr std::size_t group =
      4;  // Number of modes stepped side by side, because each sample waits for the one before.

  struct Group;
  Group group_at(std::size_t first) const;
  void keep(const Group& group, std::size_t first);
  void push(Group& all, std::size_t first, std::size_t sample) const;
  std::size_t pulse_end() const;

  std::vector<std::vector<double>> pulses_;
  std::size_t at_ = 0;
  // [motion] Sorted by frequency, padded to whole groups.
  std::vector<double> turn_real_, turn_imaginary_;
  std::vector<double> real_, imaginary_;
  std::vector<double> pushed_real_, pushed_imaginary_;  // [pulse * motions + motion]
};

}  // namespace ressort::analysis
