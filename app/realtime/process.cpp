#include "app/realtime/process.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "app/realtime/denormals.h"

namespace ressort::realtime {
namespace {

// Heap order: the earliest event on top; of two events at one frame, the one that arrived first.
template <class Pending>
bool later(const Pending& a, const Pending& b) {
  return a.frame != b.frame ? a.frame > b.frame : a.order > b.order;
}

// Every frame with an event cuts a chunk in two, and each cut may retune all voices. On average,
// cuts are at least this many frames apart.
constexpr std::size_t frames_per_moment = 8;
// The shortest chunk still has room for a strummed chord.
constexpr std::size_t least_moments = 16;

bool is_controller(const Event& event, int number) {
  return event.kind == EventKind::controller && event.index == number;
}

bool is_panic(const Event& event) {
  return event.kind == EventKind::panic || is_controller(event, 120);
}

bool ends_sound(const Event& event) {
  return is_panic(event) || event.kind == EventKind::note_off || is_controller(event, 64) ||
         is_controller(event, 66) || is_controller(event, 121) || is_controller(event, 123);
}

}  // namespace

Process::Process(double rate_hz, bool limit, Clock clock_ns)
    : rate_hz_(rate_hz),
      limit_(limit),
      clock_ns_(clock_ns),
      dc_blocker_(rate_hz),
      limiter_(rate_hz),
      input_(max_channels * chunk_frames),
      sound_(max_channels * chunk_frames),
      fade_sound_(max_channels * chunk_frames),
      mixed_(max_channels * chunk_frames) {
  now_.reserve(from_osc.capacity() + from_console.capacity() + from_midi.capacity() +
               from_session.capacity() + max_now + max_endings);
  pending_.reserve(max_ahead);
  due_.reserve(now_.capacity() + max_ahead);
  matching_.reserve(due_.capacity());
  set_rate(rate_hz);
}

Process::~Process() {
  delete current_;
  delete fading_;
  delete waiting_;
  delete slot.offer(nullptr);
  delete slot.collect();
}

void Process::set_rate(double rate_hz) {
  rate_hz_ = rate_hz;
  kept_rate_hz_ = 0.0;
  load_.forget();
  dc_blocker_ = DcBlocker(rate_hz);
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
  const std::int64_t start_ns = clock_ns_ != nullptr ? clock_ns_() : 0;
  const DenormalsFlushed flushed;
  clock.write({frame_, time_ns, rate_hz_, static_cast<std::int64_t>(frames)});
  if (controllers.take()) {
    mapper_.use(controllers.reading());
  }
  const std::size_t input_count = std::min(inputs.size(), max_channels);
  const std::size_t output_count = std::min(outputs.size(), max_channels);
  if (frames > 0) {
    log_period(frames, output_count);
    collect_events(frames, midi, time_ns);
  }
  for (std::size_t at = 0; at < frames; at += chunk_frames) {
    const std::size_t n = std::min(chunk_frames, frames - at);
    for (std::size_t c = 0; c < input_count; ++c) {
      double* const samples = input_.data() + c * chunk_frames;
      input_pointers_[c] = inputs[c] != nullptr ? samples : nullptr;
      if (inputs[c] != nullptr) {
        // A NaN or infinity would stay in the network forever.
        std::transform(inputs[c] + at, inputs[c] + at + n, samples, [](Sample sample) {
          return std::isfinite(sample) ? static_cast<double>(sample) : 0.0;
        });
      }
    }
    collect_due(n);
    play_models(input_count, output_count, n);
    if (const SampleTape* const played = tape.get()) {
      play(*played, output_count, n);
    }
    for (std::size_t c = 0; c < output_count; ++c) {
      const double* const samples = mixed_.data() + c * chunk_frames;
      std::transform(samples, samples + n, outputs[c] + at,
                     [](double sample) { return static_cast<Sample>(sample); });
    }
    if (const bool records = is_recording.is_raised(), listens = is_listening.is_raised();
        records || listens) {
      record(output_count, n, records, listens);
    }
    if (frame_ < looked_until_) {
      keep_output(output_count, n);
    }
    frame_ += static_cast<std::int64_t>(n);
  }
  follow_present_values();
  midi_out_ = mapper_.messages();
  for (const MidiBytes& message : midi_out_) {
    has_midi_out.is_raised() ? to_controllers.push(message) : false;
  }
  write_motion();
  publish_meters();
  if (clock_ns_ != nullptr && !has_time.is_raised()) {
    limit_load(1e-9 * static_cast<double>(clock_ns_() - start_ns), frames);
  }
}

bool Process::send(Ring<TimedEvent>& ring, std::span<const TimedEvent> events) {
  const bool ends =
      std::ranges::any_of(events, [](const TimedEvent& timed) { return ends_sound(timed.event); });
  const std::size_t spare =
      (ends ? 0 : max_endings) + (&ring == &from_osc ? ahead_.free() : std::size_t{0});
  const bool has_room = ring.push_all(events, spare);
  dropped.add(has_room ? 0 : events.size());
  return has_room;
}

bool Process::send_ahead(std::span<const TimedEvent> events) {
  // Only this thread takes permits, so the ring has the places.
  const bool has_room = ahead_.take(events.size()) && from_osc.push_all(events);
  dropped.add(has_room ? 0 : events.size());
  return has_room;
}

bool Process::schedule(std::int64_t frame, const Event& event) {
  keeps_every_frame_ = true;  // offline: there is no deadline
  if (!ahead_.take(1)) {
    dropped.add(1);
    return false;
  }
  add_pending(frame, event);
  return true;
}

Meters Process::meters() const {
  Meters now = board.read();
  now.dropped = dropped.get();
  now.strangers = strangers.get();
  now.xruns = xruns.get();
  return now;
}

// Converts everything that has arrived into events at frames.
void Process::collect_events(std::size_t frames, std::span<const MidiPacket> midi,
                             std::int64_t time_ns) {
  now_.clear();
  next_now_ = 0;
  const double beats_per_s = transport_.beats_per_s;
  if (std::exchange(known_transport_tempo_, beats_per_s) != beats_per_s) {
    add_now(frame_, {.kind = EventKind::tempo, .value = beats_per_s});
  }
  song_clock_.follow(transport_, frame_, static_cast<double>(frames) / rate_hz_);
  // The session first, so that an answer from another source overrides it.
  read_ring(from_session, frames, time_ns);
  read_ring(from_osc, frames, time_ns);
  read_ring(from_console, frames, time_ns);
  read_ring(from_midi, frames, time_ns);
  const std::size_t before = now_.size();
  const auto last = static_cast<std::int64_t>(frames) - 1;
  for (const MidiPacket& packet : midi) {
    midi_.read(packet.bytes, [&](const Event& event) {
      if (now_.size() - before < max_now + (ends_sound(event) ? max_endings : 0)) {
        add_now(frame_ + std::min<std::int64_t>(packet.frame, last), event);
      } else {
        dropped.add(1);
      }
    });
  }
  meters_.malformed = midi_.malformed();
  const auto earlier = [](const Pending& a, const Pending& b) { return later(b, a); };
  if (!std::is_sorted(now_.begin(), now_.end(), earlier)) {
    std::ranges::sort(now_, earlier);
  }
}

void Process::read_ring(Ring<TimedEvent>& ring, std::size_t frames, std::int64_t time_ns) {
  TimedEvent timed;
  // Later arrivals belong to the next block.
  for (std::size_t left = ring.size(); left > 0 && ring.pop(timed); --left) {
    if (timed.timing == TimedEvent::When::at_frame && timed.when >= frame_) {
      add_pending(timed.when, timed.event);
    } else if (timed.timing == TimedEvent::When::at_frame) {
      meters_.late_s = static_cast<double>(frame_ - timed.when) / rate_hz_;
      ++meters_.late;
      ahead_.give_back(1);
      add_now(frame_, timed.event);
    } else if (timed.timing == TimedEvent::When::at_time) {
      // Constant latency: an event of the last period plays at the same offset in this one.
      const double since = static_cast<double>(timed.when - time_ns) * 1e-9 * rate_hz_;
      const auto block = static_cast<std::int64_t>(frames);
      add_now(frame_ + std::clamp<std::int64_t>(block + std::llround(since), 0, block - 1),
              timed.event);
    } else {
      add_now(frame_, timed.event);
    }
  }
}

// Adds an event of this block.
void Process::add_now(std::int64_t frame, const Event& event) {
  now_.push_back({frame, order_++, event});
  if (is_panic(event)) {
    discard_after(frame);
  }
}

// Adds an event for a later frame. Its permit was taken already.
void Process::add_pending(std::int64_t frame, const Event& event) {
  latest_ = std::max(latest_, frame);
  pending_.push_back({frame, order_++, event});
  std::push_heap(pending_.begin(), pending_.end(), later<Pending>);
}

void Process::discard_after(std::int64_t frame) {
  if (latest_ <= frame || is_repeating_) {
    return;  // nothing is left to discard, as in a flood of panics
  }
  latest_ = frame;
  ahead_.give_back(
      std::erase_if(pending_, [&](const Pending& pending) { return pending.frame > frame; }));
  std::make_heap(pending_.begin(), pending_.end(), later<Pending>);
}

void Process::collect_due(std::size_t frames) {
  due_.clear();
  follow_present_values();
  const std::int64_t end = frame_ + static_cast<std::int64_t>(frames);
  const std::size_t most_moments = keeps_every_frame_ || has_time.is_raised()
                                       ? frames
                                       : std::max(least_moments, frames / frames_per_moment);
  std::size_t moments = 0;
  const auto collect = [&](const Pending& next) {
    Event event = next.event;
    count_event(event);
    if (!follow_tempo(event, next.frame) || !map_controller(event, next.frame)) {
      return;
    }
    event.frame = static_cast<std::uint32_t>(std::max<std::int64_t>(0, next.frame - frame_));
    if (due_.empty() || event.frame != due_.back().frame) {
      // The rest of a flood acts at the last cut: early, but complete and in order.
      event.frame = ++moments <= most_moments ? event.frame : due_.back().frame;
    }
    if (event.kind == EventKind::controller && current_ != nullptr &&
        current_->engine->listens_to(event.channel)) {
      reports.push({Report::Kind::controller, current_->serial, event.index, event.value});
    }
    due_.push_back(event);
    log_record({.frame = frame_ + event.frame, .event = event});
    follow_banks(event);
  };
  const auto is_due = [&](const Pending& next) { return next.frame < end; };
  while (true) {
    const bool has_now = next_now_ < now_.size() && is_due(now_[next_now_]);
    const bool has_ahead = !pending_.empty() && is_due(pending_.front());
    if (has_ahead && (!has_now || pending_.front().frame <= now_[next_now_].frame)) {
      const Pending next = pending_.front();
      std::pop_heap(pending_.begin(), pending_.end(), later<Pending>);
      pending_.pop_back();
      ahead_.give_back(1);
      collect(next);
      if (is_panic(next.event)) {
        discard_after(next.frame);
      }
    } else if (has_now) {
      collect(now_[next_now_++]);
    } else {
      return;
    }
  }
}

// Follows bank changes here, because models come and go. A program change is reported to the
// worker, which loads the preset.
void Process::follow_banks(const Event& event) {
  constexpr int bank_coarse = 0;
  constexpr int bank_fine = 32;
  int& bank = banks_[event.channel % banks_.size()];
  const auto bits = static_cast<int>(std::lround(127.0 * std::clamp(event.value, 0.0, 1.0)));
  if (is_controller(event, bank_coarse)) {
    bank = bits << 7 | (bank & 0x7f);
  } else if (is_controller(event, bank_fine)) {
    bank = (bank & 0x3f80) | bits;
  } else if (event.kind == EventKind::program && current_ != nullptr &&
             current_->engine->listens_to(event.channel)) {
    reports.push({Report::Kind::program, current_->serial, 0, 128.0 * bank + event.index});
  }
}

// Counts notes for the meters, and reports controllers to the one who learns them.
void Process::count_event(const Event& event) {
  if (event.kind == EventKind::note_on) {
    meters_.last_notes[meters_.notes++ % meters_.last_notes.size()] = {
        static_cast<std::uint8_t>(event.index),
        static_cast<std::uint8_t>(std::clamp(std::lround(127.0 * event.value), 1L, 127L))};
  } else if (event.kind == EventKind::controller && event.model == 0 &&
             hears_controllers.is_raised()) {
    reports.push({Report::Kind::heard, event.channel, event.index, event.value});
  }
}

// Follows a MIDI clock, and converts a tick to a tempo. Returns false if the event is to be
// ignored.
bool Process::follow_tempo(Event& event, std::int64_t frame) {
  constexpr double least_change = 1e-4;  // relative; frames round the ticks' times
  if (event.kind == EventKind::clock) {
    if (!song_clock_.follow(event, frame)) {
      return false;
    }
    event.kind = EventKind::tempo;
    event.value = tick_clock_.add(frame, rate_hz_);
    if (std::fabs(event.value - tempo_) <= least_change * tempo_) {
      return false;
    }
  }
  if (event.kind == EventKind::tempo && event.value > 0.0) {
    tempo_ = event.value;
    meters_.tempo = 60.0 * tempo_;
  }
  return event.kind != EventKind::tempo || event.value > 0.0;
}

// Replaces a mapped controller by its target. Returns false if the event is not for the engines.
bool Process::map_controller(Event& event, std::int64_t frame) {
  switch (mapper_.map(event)) {
    case ControllerMapper::Result::action:
      reports.push({.kind = Report::Kind::action, .index = event.index});
      return false;
    case ControllerMapper::Result::nothing:
      return false;
    case ControllerMapper::Result::mapped:
      if (event.kind == EventKind::parameter) {
        reports.push({Report::Kind::parameter, event.model, event.index, event.value});
      } else if (event.kind == EventKind::panic) {
        discard_after(frame);
      }
      break;
    case ControllerMapper::Result::passes:
      break;
  }
  mapper_.follow(event);
  return true;
}

void Process::follow_present_values() {
  mapper_.begin_chunk(current_ != nullptr ? current_->engine.get() : nullptr,
                      current_ != nullptr ? current_->serial : 0);
}

// Takes a new engine at the start of a chunk, once the last crossfade is over and its engine is
// retired. A ringing engine fades when yet another model comes, but not for a new form of the
// current model.
void Process::swap_models() {
  if (rings_ && !is_ringing()) {
    rings_ = false;
    fade_left_ = fade_frames_;
  }
  if (fading_ != nullptr && !rings_ && fade_left_ == 0 && slot.retire(fading_)) {
    fading_ = nullptr;
  }
  if (rings_ && slot.is_offered() && slot.has_room()) {
    PlayingEngine* const next = take_next_engine();
    if (continues_current(*next)) {
      slot.retire(std::exchange(current_, next));
      ++meters_.swaps;
    } else {
      waiting_ = next;
      rings_ = false;
      fade_left_ = fade_frames_;
    }
  }
  if (fading_ != nullptr) {
    return;
  }
  PlayingEngine* const next =
      waiting_ != nullptr ? std::exchange(waiting_, nullptr) : take_next_engine();
  if (next == nullptr) {
    return;
  }
  fading_ = current_;
  const bool is_first = fading_ == nullptr;
  const bool is_same = !is_first && continues_current(*next);
  if (!is_first && !is_same) {
    next->engine->adopt_channels(*fading_->engine);
    ended_ = meters_;
    load_.restart();
  }
  is_alone_ = next->lets_ring;
  rings_ = is_alone_ && !is_first && !is_same;
  rings_until_ = frame_ + static_cast<std::int64_t>(longest_ring_s * rate_hz_);
  fade_left_ = is_first || is_same || rings_ ? 0 : fade_frames_;
  current_ = next;
  ++meters_.swaps;
}

bool Process::is_ringing() const {
  return fading_->engine->meters().voices > 0 && frame_ < rings_until_;
}

bool Process::continues_current(const PlayingEngine& next) const {
  return next.serial != 0 && next.serial == current_->serial &&
         (next.has_new_numbers ? next.engine->renumber_from(*current_->engine)
                               : next.engine->continue_from(*current_->engine));
}

void Process::play_models(std::size_t input_count, std::size_t output_count, std::size_t frames) {
  swap_models();
  std::array<double*, max_channels> channels;
  for (std::size_t c = 0; c < output_count; ++c) {
    channels[c] = mixed_.data() + c * chunk_frames;
    std::fill(channels[c], channels[c] + frames, 0.0);
  }
  const std::span<double* const> out(channels.data(), output_count);
  // A mono model plays on all outputs. A model with more outputs than the device is folded.
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
    return rings_ ? 1.0 : n < fade_left_ ? static_cast<double>(fade_left_ - n) / length : 0.0;
  };
  const bool is_fading = fading_ != nullptr && (rings_ || fade_left_ > 0);
  if (is_fading) {
    play(*fading_, input_count, fade_sound_, frames);
    add(fade_sound_, fading_->engine->output_count(), old_gain);
  }
  if (current_ != nullptr) {
    play(*current_, input_count, sound_, frames);
    const int count = current_->engine->output_count();
    if (is_fading && !is_alone_) {
      add(sound_, count, [&](std::size_t n) { return 1.0 - old_gain(n); });
    } else {
      add(sound_, count, [](std::size_t) { return 1.0; });
    }
  }
  fade_left_ -= std::min(fade_left_, frames);
  if (limit_) {
    const auto may_have_dc = [](const PlayingEngine* playing) {
      return playing != nullptr && playing->engine->may_have_dc();
    };
    dc_blocker_.process(out, frames, may_have_dc(current_) || may_have_dc(fading_));
    limiter_.process(out, frames);
  }
  double peak = 0.0;
  for (const double* const channel : out) {
    for (std::size_t n = 0; n < frames; ++n) {
      peak = std::max(peak, std::fabs(channel[n]));
    }
  }
  if (meters_were_read.lower()) {
    meters_.cpu_peak = 0.0;
    meters_.peak = 0.0;
    meters_.limited = 1.0;
  }
  meters_.peak = std::max(meters_.peak, peak);
  meters_.limited = std::min(meters_.limited, limiter_.take_reduction());
}

// An event with a serial acts only in that model. Notes and controllers without one act in both
// models, so a note that began before a swap ends where it began. The old model gets no new notes.
void Process::play(PlayingEngine& sounding, std::size_t input_count, std::vector<double>& samples,
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

// Publishes the meters and reports changed parameters, after the sound is done.
void Process::publish_meters() {
  meters_.frames = static_cast<std::uint64_t>(frame_);
  meters_.song = song_clock_.place();
  if (current_ == nullptr) {
    board.write(meters_);
    return;
  }
  Engine& engine = *current_->engine;
  EngineMeters now = engine.meters();
  now.resets += ended_.resets;
  now.shed += ended_.shed;
  now.beyond += ended_.beyond;
  if (now.resets != meters_.resets) {
    reports.push({Report::Kind::reset, current_->serial, 0, 0.0});
  }
  static_cast<EngineMeters&>(meters_) = now;
  board.write(meters_);
  if (reports.size() + Engine::max_changes > reports.capacity()) {
    return;  // the worker is behind: the engine keeps the changes
  }
  for (const std::uint16_t index : engine.take_changes()) {
    reports.push({Report::Kind::parameter, current_->serial, index, engine.parameter(index)});
  }
}

// Compares the time that the block took with its duration. If the load is too high, ends a fading
// model first and steals voices then.
void Process::limit_load(double took_s, std::size_t frames) {
  const double sound_s = static_cast<double>(frames) / rate_hz_;
  load_.add(took_s, sound_s);
  meters_.load = load_.mean();
  meters_.cpu_peak = std::max(meters_.cpu_peak, frames > 0 ? took_s / sound_s : 0.0);
  meters_.overruns += took_s > sound_s ? 1 : 0;
  board.write(meters_);
  if (current_ == nullptr) {
    return;
  }
  if (load_.is_over() && (rings_ || fade_left_ > 0)) {
    log_record({.frame = frame_, .kind = FlightRecord::Kind::hurry});
    end_fade_early();
    load_.forget();
    return;
  }
  const double load = load_.lasting();
  const int before = load_.limit();
  if (const auto voices = load_.update_limit(meters_.stepped, current_->engine->voice_count())) {
    log_record({.frame = frame_,
                .kind = FlightRecord::Kind::limit,
                .count = static_cast<std::uint32_t>(std::max(0, *voices))});
    current_->engine->limit_voices(*voices);
  }
  const bool gave_way = load_.limit() > 0 && (before == 0 || load_.limit() < before);
  if ((gave_way || load > 1.0) && frame_ >= next_overload_news_) {
    next_overload_news_ = frame_ + static_cast<std::int64_t>(rate_hz_);
    reports.push({Report::Kind::overload, current_->serial,
                  static_cast<std::uint16_t>(load_.limit()), load});
  }
}

void Process::end_fade_early() {
  fading_->engine->limit_voices(1);
  fade_left_ = rings_ ? fade_frames_ : fade_left_;
  rings_ = false;
}

void Process::record(std::size_t channels, std::size_t frames, bool records, bool listens) {
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
    if (records && !recording.push(piece)) {
      ++meters_.record_lost;
    }
    if (listens) {
      // A reader that finds the ring full knows that it has lost some chunks.
      listening.push(piece);
    }
  }
}

// --- flights ------------------------------------------------------------------------------------

void Process::log_record(const FlightRecord& record) {
  if (!keeps_flight.is_raised()) {
    return;
  }
  if (has_gap_) {
    has_gap_ = !flight.push({.frame = record.frame, .kind = FlightRecord::Kind::gap});
  }
  has_gap_ = has_gap_ || !flight.push(record);
}

void Process::log_period(std::size_t frames, std::size_t channels) {
  if (!keeps_flight.is_raised()) {
    return;
  }
  if (std::exchange(kept_rate_hz_, rate_hz_) != rate_hz_) {
    log_record({.frame = frame_, .kind = FlightRecord::Kind::rate, .event = {.value = rate_hz_}});
  }
  const bool is_other_period = std::exchange(kept_frames_, frames) != frames;
  const bool has_other_channels = std::exchange(kept_channels_, channels) != channels;
  if (is_other_period || has_other_channels) {
    log_record({.frame = frame_,
                .kind = FlightRecord::Kind::period,
                .count = static_cast<std::uint32_t>(frames),
                .channels = static_cast<std::uint32_t>(channels)});
  }
}

// Takes the next engine, if there is one.
PlayingEngine* Process::take_next_engine() {
  PlayingEngine* const next = slot.take();
  if (next != nullptr) {
    log_record({.frame = frame_, .kind = FlightRecord::Kind::take, .count = next->number});
    next->engine->set_tempo(tempo_);
  }
  return next;
}

void Process::play(const SampleTape& tape, std::size_t output_count, std::size_t frames) {
  for (std::size_t n = 0; n < frames; ++n, ++tape_at_) {
    const bool is_over = tape_at_ >= tape.frames();
    for (std::size_t c = 0; c < output_count; ++c) {
      mixed_[c * chunk_frames + n] =
          is_over || c >= tape.channels
              ? 0.0
              : static_cast<double>(tape.samples[tape_at_ * tape.channels + c]);
    }
  }
  if (tape_at_ >= tape.frames()) {
    is_tape_over.raise();
  }
}

void Process::repeat(const FlightRecord& record) {
  is_repeating_ = true;
  keeps_every_frame_ = true;
  switch (record.kind) {
    case FlightRecord::Kind::event:
      return add_pending(record.frame, record.event);
    case FlightRecord::Kind::rate:
      return set_rate(record.event.value);
    case FlightRecord::Kind::limit:
      return current_ != nullptr ? current_->engine->limit_voices(static_cast<int>(record.count))
                                 : void();
    case FlightRecord::Kind::hurry:
      return fading_ != nullptr ? end_fade_early() : void();
    case FlightRecord::Kind::period:
    case FlightRecord::Kind::take:
    case FlightRecord::Kind::gap:
      return;  // the caller of block() handles these
  }
}

// --- motion frames for the panel ----------------------------------------------------------------

void Process::keep_output(std::size_t channels, std::size_t frames) {
  const double share = channels > 0 ? 1.0 / static_cast<double>(channels) : 0.0;
  for (std::size_t n = 0; n < frames; ++n) {
    double sum = 0.0;
    for (std::size_t c = 0; c < channels; ++c) {
      sum += mixed_[c * chunk_frames + n];
    }
    heard_[heard_at_] = static_cast<float>(share * sum);
    heard_at_ = (heard_at_ + 1) % heard_.size();
  }
}

// Writes the motion frame that was requested. A stroboscope frame waits for its phase, up to
// longest_strobe_s. An engine that fades out must not write any more where the next one will.
void Process::write_motion() {
  MotionFrame& out = motion.writing();
  if (strobed_ != nullptr) {
    const bool is_here = strobed_ == current_;
    const std::size_t count = is_here ? current_->engine->take_slow_view() : 0;
    if (count == 0 && is_here && frame_ < strobed_until_) {
      return;
    }
    if (is_here || strobed_ == fading_) {
      strobed_->engine->request_slow_view({});
    }
    strobed_ = nullptr;
    if (count > 0) {
      out.count = count;
      return publish_motion();
    }
    wants_motion.raise();
  }
  const bool is_slow = wants_slow_motion.lower();
  if (is_slow && current_ != nullptr && current_->picture != 0 &&
      current_->engine->request_slow_view(out.numbers)) {
    strobed_ = current_;
    strobed_until_ = frame_ + static_cast<std::int64_t>(longest_strobe_s * rate_hz_);
  } else if (wants_motion.lower() || is_slow) {
    out.count = current_ != nullptr && current_->picture != 0
                    ? current_->engine->read_positions(out.numbers)
                    : 0;
    publish_motion();
  }
}

// Publishes the motion frame with the latest output. From now on the output is kept for the next
// frame, for looked_for_s.
void Process::publish_motion() {
  MotionFrame& out = motion.writing();
  out.frame = static_cast<std::uint64_t>(frame_);
  out.picture = current_ != nullptr ? current_->picture : 0;
  const auto at = heard_.begin() + static_cast<std::ptrdiff_t>(heard_at_);
  std::copy(heard_.begin(), at, std::copy(at, heard_.end(), out.heard.begin()));
  motion.publish();
  looked_until_ = frame_ + static_cast<std::int64_t>(looked_for_s * rate_hz_);
}

}  // namespace ressort::realtime
