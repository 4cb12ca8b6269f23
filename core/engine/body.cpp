#include "core/engine/body.h"

#include <algorithm>
#include <utility>

#include "core/kernels/kernel.h"

namespace ressort::engine {

Body::Body(std::unique_ptr<Engine> engine, std::vector<SharedParameter> shared,
           std::size_t channels)
    : engine_(std::move(engine)), shared_(std::move(shared)), sound_(channels * max_block_frames) {
  for (const SharedParameter& parameter : shared_) {
    sent_.push_back(engine_->parameter(parameter.of_body));
  }
  events_.reserve(shared_.size() + 1);
  for (std::size_t c = 0; c < channels; ++c) {
    voices_.push_back(sound_.data() + c * max_block_frames);
    heard_by_body_.push_back(voices_.back());
  }
}

Segment Body::start(const Segment& segment) {
  const std::size_t frames = std::min(segment.frames, max_block_frames);
  for (double* const channel : voices_) {
    std::fill(channel, channel + frames, 0.0);
  }
  const std::size_t count = std::min(segment.inputs.size(), most_channels);
  for (std::size_t c = 0; c < count; ++c) {
    inputs_[c] = segment.inputs[c] != nullptr ? segment.inputs[c] + segment.at : nullptr;
  }
  return {.inputs = {inputs_.data(), count}, .outputs = voices_, .at = 0, .frames = frames};
}

void Body::play(const Segment& segment, std::size_t frames, std::span<const double> parameters) {
  events_.clear();
  for (std::size_t i = 0; i < shared_.size(); ++i) {
    const double value = parameters[shared_[i].index];
    if (value != sent_[i]) {
      sent_[i] = value;
      events_.push_back(
          {.kind = EventKind::parameter, .index = shared_[i].of_body, .value = value});
    }
  }
  if (std::exchange(is_muted_, false)) {
    events_.push_back({.kind = EventKind::panic});
  }
  const std::size_t count = std::min(segment.outputs.size(), most_channels);
  for (std::size_t c = 0; c < count; ++c) {
    outputs_[c] = segment.outputs[c] + segment.at;
  }
  engine_->process(events_, heard_by_body_, {outputs_.data(), count}, frames);
}

void Body::continue_from(const Body& from) {
  engine_->continue_from(*from.engine_);
  sent_ = from.sent_;
  is_muted_ = from.is_muted_;
}

void Body::renumber_from(const Body& from) {
  engine_->renumber_from(*from.engine_);
  for (std::size_t i = 0; i < shared_.size(); ++i) {
    sent_[i] = engine_->parameter(shared_[i].of_body);
  }
  is_muted_ = from.is_muted_;
}

void Body::add_to(EngineMeters& meters) const {
  const EngineMeters own = engine_->meters();
  meters.voices = std::max(meters.voices, own.voices);  // a ringing body counts as one voice
  meters.resets += own.resets;
  meters.beyond += own.beyond;
  meters.modes += own.modes;
  meters.modes_awake += own.modes_awake;
  meters.energy += own.energy;
  meters.loss += own.loss;
  meters.is_driven = meters.is_driven || own.is_driven;
  meters.is_whole = meters.is_whole && own.is_whole;
}

}  // namespace ressort::engine
