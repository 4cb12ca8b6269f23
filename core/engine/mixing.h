// core/engine: mixes voices into the output channels, and detects voices that leave their bounds.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/engine/bank.h"
#include "core/engine/energy_watch.h"
#include "core/engine/voices.h"

namespace ressort::engine {

// All functions: [audio] wait-free.
class Mixing {
 public:
  Mixing(const Playing& playing, double rate_hz, std::size_t lanes);
  void continue_from(const Mixing& from) { noise_ = from.noise_; }

  // Mixes the voices of a kernel that has stepped, and keeps their peaks and last samples. A voice
  // that leaves its bounds is mixed up to its last sane sample. Then it is frozen, and it fades
  // from the next segment on.
  template <class T>
  void add(Bank<T>& bank, const VoiceGroup& group, const Segment& segment, Voices& voices,
           EnergyWatch& watch);
  // Calls invert(voice) for a new voice that takes from the sound of an earlier voice of its key:
  // the sum of the products of both, over the first 10 ms of its sound, is negative. Two waves of
  // one pitch add up or cancel by chance; the sign of the softer one is free. Both are lowpassed,
  // because the first partials carry the level behind a body. Called after all kernels have been
  // mixed.
  template <class Invert>
  void compare(std::size_t frames, Voices& voices, Invert&& invert);
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

  template <class Sample>
  void keep_row(std::size_t lane, const Voice& voice, std::size_t frames, std::size_t outputs,
                Sample&& sample);

  double gain_;
  std::size_t least_compared_;  // frames
  double lowpass_;              // share of the difference that the lowpass takes per frame
  std::vector<double> rows_;    // [lane][frame] sum of a voice's outputs, while voices are compared
  double bound_;                // largest output before gains; a voice beyond it is unstable
  std::uint64_t noise_ = 0x9e3779b97f4a7c15u;
};

template <class Invert>
void Mixing::compare(std::size_t frames, Voices& voices, Invert&& invert) {
  bool is_comparing = false;
  for (Voice& voice : voices) {
    if (voice.beside == nullptr) {
      continue;
    }
    const double* const mine = rows_.data() + voices.lane_of(voice) * max_block_frames;
    const double* const other = rows_.data() + voices.lane_of(*voice.beside) * max_block_frames;
    const double gain = gain_ * std::fabs(voice.strength);
    for (std::size_t n = 0; n < frames; ++n) {
      voice.lowpassed += lowpass_ * (mine[n] - voice.lowpassed);
      voice.lowpassed_beside += lowpass_ * (other[n] - voice.lowpassed_beside);
      voice.agreement += voice.lowpassed * voice.lowpassed_beside;
      voice.compared_frames +=
          voice.compared_frames > 0 || gain * std::fabs(mine[n]) > quiet_level ? 1 : 0;
    }
    const bool is_certain = voice.compared_frames >= least_compared_;
    if (is_certain && voice.agreement < 0.0) {
      invert(voice);
    }
    const bool goes_on = voice.is_live() && voice.beside->is_live() && !is_certain;
    voice.beside = goes_on ? voice.beside : nullptr;
    is_comparing |= goes_on;
  }
  for (std::size_t at = 0; at < rows_.size(); at += max_block_frames) {
    std::fill_n(rows_.begin() + static_cast<std::ptrdiff_t>(at), frames, 0.0);
  }
  voices.set_comparing(is_comparing);
}

}  // namespace ressort::engine
