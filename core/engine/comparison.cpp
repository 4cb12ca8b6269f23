#include "core/engine/comparison.h"

#include <cmath>
#include <numeric>
#include <utility>

namespace ressort::engine {
namespace {

constexpr double compared_s = 0.01;  // before the first decision, and of the running sums
constexpr double most_compared_s = 1.0;
// Correlation at which a voice is inverted. Above it, the softer voice takes at most 0.2 dB.
constexpr double clear_loss = -0.2;

double sign_of(const Voice& voice) {
  return std::copysign(1.0, voice.strength);
}

}  // namespace

Comparison::Comparison(const Playing& playing, double rate_hz, std::size_t lanes)
    : gain_(playing.gain),
      step_(compared_step(rate_hz)),
      response_(playing.body_response.rbegin(), playing.body_response.rend()),
      has_body_(lanes > 1 && response_.size() > 1),
      kept_(std::exp(-static_cast<double>(step_) / (compared_s * rate_hz))),
      least_frames_(static_cast<std::size_t>(compared_s * rate_hz)),
      most_frames_(static_cast<std::size_t>(most_compared_s * rate_hz)),
      kept_sums_(lanes * max_sums),
      sums_(lanes),
      past_(2 * lanes * response_.size()) {}

void Comparison::follow(std::size_t frames, Voices& voices) {
  std::size_t step = 0;
  each_step(frames, [&](std::size_t from, std::size_t to) {
    for (std::size_t lane = 0; lane < voices.awake_end(); ++lane) {
      sums_[lane] += std::exchange(kept_sums_[lane * max_sums + step], 0.0);
    }
    ++step;
    frame_ += to - from;
    if (frame_ == step_) {
      push(voices);
    }
  });
}

// Ends a step: keeps its sums and compares what is heard of each pair of voices.
void Comparison::push(Voices& voices) {
  const std::size_t taps = response_.size();
  frame_ = 0;
  at_ = (at_ + 1) % taps;
  for (std::size_t lane = 0; lane < voices.awake_end(); ++lane) {
    double* const past = past_.data() + 2 * taps * lane;
    past[at_] = past[at_ + taps] = std::exchange(sums_[lane], 0.0);
  }
  if (!voices.is_comparing()) {
    return;
  }
  for (Voice& voice : voices) {
    if (voice.beside == nullptr) {
      continue;
    }
    const std::size_t lane = voices.lane_of(voice);
    double* const past = past_.data() + 2 * taps * lane;
    const double level = gain_ * std::fabs(voice.strength * past[at_]);
    if (voice.compared_frames == 0 && level <= quiet_level * static_cast<double>(step_)) {
      std::fill_n(past, 2 * taps, 0.0);  // sound of the voice that had this lane before
      continue;
    }
    const double mine = heard(lane);
    const double earlier = heard(voices.lane_of(*voice.beside));
    voice.agreement = kept_ * voice.agreement + mine * earlier;
    voice.power = kept_ * voice.power + mine * mine;
    voice.power_beside = kept_ * voice.power_beside + earlier * earlier;
    voice.compared_frames += step_;
  }
}

double Comparison::heard(std::size_t lane) const {
  const std::size_t taps = response_.size();
  const double* const oldest = past_.data() + 2 * taps * lane + at_ + 1;
  return std::transform_reduce(response_.begin(), response_.end(), oldest, 0.0);
}

bool Comparison::takes_from_earlier(const Voice& voice) {
  const double agreement = sign_of(voice) * sign_of(*voice.beside) * voice.agreement;
  return agreement < clear_loss * std::sqrt(voice.power * voice.power_beside);
}

}  // namespace ressort::engine
