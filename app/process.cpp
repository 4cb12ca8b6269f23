#include "app/process.h"

#include <algorithm>
#include <cmath>

#include "app/denormals.h"

namespace ressort {
namespace {

// The earliest on top of the heap; of equals the one that came first.
template <class Pending>
bool later(const Pending& a, const Pending& b) {
  return a.frame != b.frame ? a.frame > b.frame : a.order > b.order;
}

}  // namespace

Process::Process(double rate_hz, bool limit)
    : rate_hz_(rate_hz),
      limit_(limit),
      limiter_(rate_hz),
      input_(max_channels * chunk_frames),
      sound_(max_channels * chunk_frames),
      fade_sound_(max_channels * chunk_frames),
      mixed_(max_channels * chunk_frames) {
  pending_.reserve(max_events);
  due_.reserve(max_events);
  matching_.reserve(max_events);
  meters.limited.set(1.0);
  set_rate(rate_hz);
}

Process::~Process() {
  delete current_;
  delete fading_;
  delete slot.offer(nullptr);
  delete slot.collect();
}

void Process::set_rate(double rate_hz) {
  rate_hz_ = rate_hz;
  limiter_ = Limiter(rate_hz);
  fade_frames_ = static_cast<std::size_t>(fade_s * rate_hz);
}

void Process::block(std::span<const float* const> inputs, std::span<float* const> outputs,
                    std::size_t frames, std::span<const MidiPacket> midi,
                    std::int64_t time_ns) noexcept {
  run<float>(inputs, outputs, frames, midi, time_ns);
}

void Process::block(std::span<const double* const> inputs, std::span<double* const> outputs,
                    std::size_t frames, std::span<const MidiPacket> midi,
                    std::int64_t time_ns) noexcept {
  run<double>(inputs, outputs, frames, midi, time_ns);
}

template <class Sample>
void Process::run(std::span<const Sample* const> inputs, std::span<Sample* const> outputs,
                  std::size_t frames, std::span<const MidiPacket> midi, std::int64_t time_ns) {
  const DenormalsFlushed flushed;
  clock.write({frame_, time_ns, rate_hz_, static_cast<std::int64_t>(frames)});
  gather(frames, midi, time_ns);
  const std::size_t input_count = std::min(inputs.size(), max_channels);
  const std::size_t output_count = std::min(outputs.size(), max_channels);
  for (std::size_t at = 0; at < frames; at += chunk_frames) {
    const std::size_t n = std::min(chunk_frames, frames - at);
    for (std::size_t c = 0; c < input_count; ++c) {
      double* const samples = input_.data() + c * chunk_frames;
      input_pointers_[c] = inputs[c] != nullptr ? samples : nullptr;
      if (inputs[c] != nullptr) {
        // What is no number would never leave the network again.
        std::transform(inputs[c] + at, inputs[c] + at + n, samples, [](Sample sample) {
          return std::isfinite(sample) ? static_cast<double>(sample) : 0.0;
        });
      }
    }
    collect_due(n);
    play_models(input_count, output_count, n);
    for (std::size_t c = 0; c < output_count; ++c) {
      const double* const samples = mixed_.data() + c * chunk_frames;
      std::transform(samples, samples + n, outputs[c] + at,
                     [](double sample) { return static_cast<Sample>(sample); });
    }
    if (is_recording.is_raised()) {
      record(output_count, n);
    }
    frame_ += static_cast<std::int64_t>(n);
  }
  tell();
}

// Everything that has arrived becomes an event at a frame.
void Process::gather(std::size_t frames, std::span<const MidiPacket> midi, std::int64_t time_ns) {
  for (const MidiPacket& packet : midi) {
    midi_.read(packet.bytes, [&](const Event& event) { schedule(frame_ + packet.frame, event); });
  }
  meters.malformed.set(midi_.malformed());
  drain(from_midi, frames, time_ns);
  drain(from_osc, frames, time_ns);
  drain(from_console, frames, time_ns);
}

void Process::drain(Ring<TimedEvent>& ring, std::size_t frames, std::int64_t time_ns) {
  for (std::size_t n = 0; n < max_events; ++n) {
    const TimedEvent* const first = ring.peek();
    // A bundle that is still on its way waits, so that its events act in one block.
    if (first == nullptr || ring.size() <= first->following) {
      return;
    }
    TimedEvent timed;
    ring.pop(timed);
    std::int64_t frame = frame_;
    if (timed.timing == TimedEvent::When::at_frame) {
      frame = timed.when;
    } else if (timed.timing == TimedEvent::When::at_time) {
      // Constant latency: what happened during the last period is played during this one.
      const double since = static_cast<double>(timed.when - time_ns) * 1e-9 * rate_hz_;
      frame =
          frame_ + std::clamp<std::int64_t>(static_cast<std::int64_t>(frames) + std::llround(since),
                                            0, static_cast<std::int64_t>(frames) - 1);
    }
    if (frame < frame_) {
      meters.late.add(1);
      reports.push({Report::Kind::late, timed.event.model, 0,
                    static_cast<double>(frame_ - frame) / rate_hz_});
    }
    schedule(frame, timed.event);
  }
}

bool Process::schedule(std::int64_t frame, const Event& event) {
  if (pending_.size() >= max_events) {
    meters.dropped.add(1);
    return false;
  }
  pending_.push_back({frame, order_++, event});
  std::push_heap(pending_.begin(), pending_.end(), later<Pending>);
  return true;
}

void Process::collect_due(std::size_t frames) {
  due_.clear();
  const std::int64_t end = frame_ + static_cast<std::int64_t>(frames);
  while (!pending_.empty() && pending_.front().frame < end) {
    std::pop_heap(pending_.begin(), pending_.end(), later<Pending>);
    Event event = pending_.back().event;
    event.frame =
        static_cast<std::uint32_t>(std::max<std::int64_t>(0, pending_.back().frame - frame_));
    due_.push_back(event);
    pending_.pop_back();
  }
}

// A new model is taken at the edge of a chunk, once the last fade is over and its engine is on its
// way out.
void Process::swap_models() {
  if (fading_ != nullptr && fade_left_ == 0 && slot.retire(fading_)) {
    fading_ = nullptr;
  }
  if (fading_ != nullptr) {
    return;
  }
  if (Sounding* const next = slot.take()) {
    fading_ = current_;
    fade_left_ = fading_ == nullptr || goes_on(*next) ? 0 : fade_frames_;
    resets_told_ = fade_left_ == 0 ? resets_told_ : 0;
    beyond_told_ = fade_left_ == 0 ? beyond_told_ : 0;
    current_ = next;
    meters.swaps.add(1);
  }
}

bool Process::goes_on(const Sounding& next) const {
  return next.serial != 0 && next.serial == current_->serial &&
         next.engine->go_on_from(*current_->engine);
}

void Process::play_models(std::size_t input_count, std::size_t output_count, std::size_t frames) {
  swap_models();
  std::array<double*, max_channels> channels;
  for (std::size_t c = 0; c < output_count; ++c) {
    channels[c] = mixed_.data() + c * chunk_frames;
    std::fill(channels[c], channels[c] + frames, 0.0);
  }
  const std::span<double* const> out(channels.data(), output_count);
  // A model with one output is heard on both sides; one with more than the device has is folded.
  const auto add = [&](const std::vector<double>& samples, int count, auto&& gain) {
    if (output_count == 0) {
      return;
    }
    const auto sources = static_cast<std::size_t>(count);
    for (std::size_t k = 0; k < std::max<std::size_t>(sources, sources == 1 ? output_count : 0);
         ++k) {
      const double* const source = samples.data() + (sources == 1 ? 0 : k) * chunk_frames;
      double* const target = out[k % output_count];
      for (std::size_t n = 0; n < frames; ++n) {
        target[n] += gain(n) * source[n];
      }
    }
  };
  const double length = static_cast<double>(std::max<std::size_t>(1, fade_frames_));
  const auto old_gain = [&](std::size_t n) {
    return n < fade_left_ ? static_cast<double>(fade_left_ - n) / length : 0.0;
  };
  const bool is_fading = fading_ != nullptr && fade_left_ > 0;
  if (is_fading) {
    play(*fading_, input_count, fade_sound_, frames);
    add(fade_sound_, fading_->engine->output_count(), old_gain);
  }
  if (current_ != nullptr) {
    play(*current_, input_count, sound_, frames);
    const int count = current_->engine->output_count();
    if (is_fading) {
      add(sound_, count, [&](std::size_t n) { return 1.0 - old_gain(n); });
    } else {
      add(sound_, count, [](std::size_t) { return 1.0; });
    }
  }
  fade_left_ -= std::min(fade_left_, frames);
  if (limit_) {
    limiter_.process(out, frames);
  }
  double peak = 0.0;
  for (const double* const channel : out) {
    for (std::size_t n = 0; n < frames; ++n) {
      peak = std::max(peak, std::fabs(channel[n]));
    }
  }
  if (meters.read.lower()) {
    meters.peak.set(0.0);
    meters.limited.set(1.0);
  }
  meters.peak.raise(peak);
  if (const double reduction = limiter_.take_reduction(); reduction < meters.limited.get()) {
    meters.limited.set(reduction);
  }
}

// Events that name a model act in that model only; notes and controllers act in both, so that a
// note that began before a swap ends where it began.
void Process::play(Sounding& sounding, std::size_t input_count, std::vector<double>& samples,
                   std::size_t frames) {
  matching_.clear();
  const bool is_old = &sounding == fading_;
  for (const Event& event : due_) {
    const bool starts = event.kind == EventKind::note_on;
    if (event.model == sounding.serial || (event.model == 0 && !(is_old && starts))) {
      matching_.push_back(event);
    }
  }
  std::array<double*, max_channels> outputs;
  const auto count = static_cast<std::size_t>(sounding.engine->output_count());
  for (std::size_t c = 0; c < count; ++c) {
    outputs[c] = samples.data() + c * chunk_frames;
  }
  sounding.engine->process(matching_, {input_pointers_.data(), input_count},
                           {outputs.data(), count}, frames);
}

// What others may want to know, after the sound is done.
void Process::tell() {
  meters.frames.set(static_cast<std::uint64_t>(frame_));
  if (current_ == nullptr) {
    return;
  }
  Engine& engine = *current_->engine;
  const EngineMeters now = engine.meters();
  meters.voices.set(now.voices);
  meters.stolen.set(now.stolen);
  meters.beyond.add(now.beyond - beyond_told_);
  beyond_told_ = now.beyond;
  meters.saved.set(now.saved);
  meters.modes.set(now.modes);
  meters.modes_awake.set(now.modes_awake);
  meters.energy.set(now.energy);
  meters.loss.set(now.loss);
  meters.is_driven.set(now.is_driven);
  meters.is_whole.set(now.is_whole);
  if (now.resets != resets_told_) {
    meters.resets.add(now.resets - resets_told_);
    resets_told_ = now.resets;
    reports.push({Report::Kind::reset, current_->serial, 0, 0.0});
  }
  for (const std::uint32_t link : engine.take_creators()) {
    reports.push({Report::Kind::created, current_->serial, 0, static_cast<double>(link)});
  }
  for (const std::uint16_t index : engine.take_changes()) {
    reports.push({Report::Kind::parameter, current_->serial, index, engine.parameter(index)});
  }
}

void Process::record(std::size_t channels, std::size_t frames) {
  if (channels == 0) {
    return;
  }
  const std::size_t most = RecordedChunk::max_samples / channels;
  for (std::size_t at = 0; at < frames; at += most) {
    RecordedChunk piece;
    piece.frames = static_cast<std::uint16_t>(std::min(most, frames - at));
    piece.channels = static_cast<std::uint16_t>(channels);
    std::size_t i = 0;
    for (std::size_t n = 0; n < piece.frames; ++n) {
      for (std::size_t c = 0; c < channels; ++c) {
        piece.samples[i++] = static_cast<float>(mixed_[c * chunk_frames + at + n]);
      }
    }
    if (!recording.push(piece)) {
      meters.record_lost.add(1);
    }
  }
}

}  // namespace ressort
