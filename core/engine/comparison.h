// core/engine: compares a new voice with an earlier one of its key that rings on, so that the new
// one takes nothing from what is heard.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/engine/voices.h"
#include "core/kernels/kernel.h"

namespace ressort::engine {

// Two waves of one pitch add up or cancel by chance, and the sign of the softer one is free. Both
// are compared as they are heard behind the body: by the convolution with its impulse response, at
// about 5.5 kHz. Two waves of nearly one pitch beat, so that a comparison goes on for a second.
// All functions but the constructor: [audio] wait-free.
class Comparison {
 public:
  Comparison(const Playing& playing, double rate_hz, std::size_t lanes);

  // Behind a body, earlier sound is still heard when a comparison begins.
  bool is_needed(const Voices& voices) const { return has_body_ || voices.is_comparing(); }

  // Adds the outputs of a lane in this segment: `count` numbers in each frame, `stride` apart.
  template <class T>
  void keep(std::size_t lane, std::size_t frames, std::size_t count, std::size_t stride,
            const T* outputs) {
    double* sum = kept_sums_.data() + lane * max_sums;
    each_step(frames, [&](std::size_t from, std::size_t to) {
      *sum++ += sum_of(outputs + from * count * stride, (to - from) * count, stride);
    });
  }

  // Ends a segment. Calls invert(voice) for a new voice when the correlation of both voices over
  // the last 10 ms is clearly negative.
  template <class Invert>
  void advance(std::size_t frames, Voices& voices, Invert&& invert);

 private:
  // of a segment: a step has at least one frame, and the first may have begun before
  static constexpr std::size_t max_sums = max_block_frames + 1;

  // Calls use(from, to) for the frames of every step in a segment.
  template <class Use>
  void each_step(std::size_t frames, Use&& use) const {
    std::size_t to = std::min(frames, step_ - frame_);
    for (std::size_t from = 0; from < frames; from = to, to = std::min(frames, from + step_)) {
      use(from, to);
    }
  }

  // Four partial sums hide the latency of the additions.
  template <class T>
  static double sum_of(const T* y, std::size_t count, std::size_t stride) {
    double sums[4] = {};
    std::size_t i = 0;
    for (; i + 4 <= count; i += 4) {
      for (std::size_t k = 0; k < 4; ++k) {
        sums[k] += static_cast<double>(y[(i + k) * stride]);
      }
    }
    for (; i < count; ++i) {
      sums[0] += static_cast<double>(y[i * stride]);
    }
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
  }

  void follow(std::size_t frames, Voices& voices);
  void push(Voices& voices);
  double heard(std::size_t lane) const;
  static bool takes_from_earlier(const Voice& voice);

  double gain_;
  std::size_t step_;              // frames that are summed
  std::vector<double> response_;  // of the body, at every step; the last one first
  bool has_body_;
  double kept_;               // share of a running sum that each step keeps
  std::size_t least_frames_;  // before the first decision
  std::size_t most_frames_;
  std::vector<double> kept_sums_;  // [lane][step of the segment] of a voice's outputs
  std::vector<double> sums_;       // [lane] of the current step
  std::vector<double> past_;       // [lane][2 * responses] sums of the last steps, twice
  std::size_t frame_ = 0;          // in the current step
  std::size_t at_ = 0;             // the last step in `past_`
};

template <class Invert>
void Comparison::advance(std::size_t frames, Voices& voices, Invert&& invert) {
  follow(frames, voices);
  if (!voices.is_comparing()) {
    return;
  }
  bool goes_on = false;
  for (Voice& voice : voices) {
    if (voice.beside == nullptr) {
      continue;
    }
    if (voice.compared_frames >= least_frames_ && voice.volume_frames == 0 &&
        takes_from_earlier(voice)) {
      invert(voice);
    }
    const bool is_compared = voice.is_live() && voice.beside->is_live() &&
                             voice.beside->key == voice.key && voice.compared_frames < most_frames_;
    voice.beside = is_compared ? voice.beside : nullptr;
    goes_on |= is_compared;
  }
  voices.set_comparing(goes_on);
}

}  // namespace ressort::engine
