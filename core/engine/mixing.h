// core/engine: mixes voices into the output channels, and detects voices that leave their bounds.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/engine/bank.h"
#include "core/engine/comparison.h"
#include "core/engine/energy_watch.h"
#include "core/engine/voices.h"

namespace ressort::engine {

// All functions: [audio] wait-free.
class Mixing {
 public:
  explicit Mixing(const Playing& playing);
  void continue_from(const Mixing& from) { noise_ = from.noise_; }

  // Mixes the voices of a kernel that has stepped, and keeps their peaks and last samples. A voice
  // that leaves its bounds is mixed up to its last sane sample. Then it is frozen, and it fades
  // from the next segment on.
  template <class T>
  void add(Bank<T>& bank, const VoiceGroup& group, const Segment& segment, Voices& voices,
           EnergyWatch& watch, Comparison& comparison);
  // Mixes the frozen voices of a kernel.
  void add_frozen(const Program& program, const VoiceGroup& group, const Segment& segment,
                  const Voices& voices, const EnergyWatch& watch) const;
  // Multiplies the outputs by white noise. If they are silent, it only skips these numbers.
  void make_noise(const Segment& segment, MakeNoise make, bool is_silent);

 private:
  template <class Sample>
  std::size_t count_sane_frames(std::size_t frames, std::size_t outputs, Sample&& sample) const;
  template <class Sample>
  void add_one(const Program& program, const Voice& voice, const Segment& segment, std::size_t from,
               std::size_t to, Sample&& sample) const;
  template <class T>
  static void keep_last(Bank<T>& bank, const VoiceGroup& group, std::size_t frames,
                        bool is_any_unstable, const Voices& voices, const EnergyWatch& watch);
  void add_constant(const Program& program, const Voice& voice, const Segment& segment,
                    std::size_t from, const double* outputs) const;

  double gain_;
  double bound_;  // largest output before gains; a voice beyond it is unstable
  std::uint64_t noise_ = 0x9e3779b97f4a7c15u;
};

}  // namespace ressort::engine
