// core/analysis/timbre: what decaying motions sound like, sample by sample. [one thread but audio]
#pragma once

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

#include "core/rooms.h"

namespace ressort::analysis {

// A motion is state e^(pole n), n in samples, of which the imaginary part is heard.
class ModalSound {
 public:
  struct Motion {
    std::complex<double> pole;                 // the logarithm of what it grows by in a sample
    std::vector<std::complex<double>> pushed;  // [pulse] what a pulse of 1 adds to its state
  };
  // Pulses are of force, sample by sample from the first on, all at once.
  ModalSound(std::span<const Motion> motions, std::vector<std::vector<double>> pulses);

  // The next samples. O(motions * samples)
  void next(std::span<double> samples);

  // What the analytic signal is like after every `step` more samples: the magnitude of the sum of
  // all states. While something pushes, O(step) each.
  void next_magnitudes(std::span<double> magnitudes, std::size_t step);

  bool is_pushed() const { return at_ < pulse_end(); }  // still

  // The largest that the envelope, over a time of `resolution_s`, may still become without another
  // push: motions as near as that may come to be in phase, others add up as their energies do.
  double most_left(double rate_hz, double resolution_s) const;

 private:
  static constexpr std::size_t group =
      4;  // motions side by side, as each sample waits for the last

  struct Group;
  Group group_at(std::size_t first) const;
  void keep(const Group& group, std::size_t first);
  void push(Group& all, std::size_t first, std::size_t sample) const;
  std::size_t pulse_end() const;

  std::vector<std::vector<double>> pulses_;
  std::size_t at_ = 0;
  // [motion], by frequency, filled up to a whole group.
  std::vector<double> turn_real_, turn_imaginary_;
  std::vector<double> real_, imaginary_;
  std::vector<double> pushed_real_, pushed_imaginary_;  // [pulse * motions + motion]
};

}  // namespace ressort::analysis
