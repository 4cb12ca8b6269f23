#include "app/session/timbre/timbre_watch.h"

#include <algorithm>

#include "core/analysis/timbre/pitch.h"

namespace ressort::session {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds analysis_interval{
    10};  // a third of a second of blocks of 16 frames fits into the ring
constexpr std::size_t most_kept_frames = 94;

std::size_t recent_samples(double rate_hz) {
  return std::max(pitch_samples(rate_hz), TimbreWatch::frame + TimbreWatch::hop);
}

}  // namespace

TimbreWatch::~TimbreWatch() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) {
    thread_.join();
  }
}

void TimbreWatch::listen(std::chrono::duration<double> time) {
  {
    const std::lock_guard lock(mutex_);
    until_ = std::max(until_, Clock::now() + std::chrono::duration_cast<Clock::duration>(time));
    if (!thread_.joinable()) {
      thread_ = std::thread([this] { work(); });
    }
  }
  wake_.notify_all();
}

std::vector<TimbreWatch::Heard> TimbreWatch::since(std::uint64_t number) const {
  const std::lock_guard lock(mutex_);
  const auto first =
      std::ranges::find_if(frames_, [&](const Heard& heard) { return heard.number > number; });
  return {first, frames_.end()};
}

std::optional<TimbreWatch::Moment> TimbreWatch::now() const {
  std::vector<double> samples;
  double rate_hz = 0.0;
  {
    const std::lock_guard lock(mutex_);
    samples = recent_;
    rate_hz = rate_hz_;
  }
  if (rate_hz == 0.0 || samples.size() < recent_samples(rate_hz)) {
    return std::nullopt;
  }
  const auto all = std::span<const double>(samples);
  Moment moment{.f0_hz = find_f0(all, rate_hz), .figures = {}};
  FrameAnalysis analysis({.rate_hz = rate_hz, .size = frame, .f0_hz = moment.f0_hz});
  static_cast<void>(analysis.next(all.last(frame + hop).first(frame)));
  moment.figures = figures_of(analysis.next(all.last(frame)));
  return moment;
}

void TimbreWatch::work() {
  std::unique_lock lock(mutex_);
  while (!stop_) {
    if (Clock::now() < until_) {
      lock.unlock();
      analyse_output();
      lock.lock();
    } else {
      wake_.wait(lock);
    }
  }
}

// Analyses the output until no client listens or the rate changes.
void TimbreWatch::analyse_output() {
  const double rate_hz = process_.clock.read().rate_hz;
  RecordedChunk chunk;
  while (process_.listening.pop(chunk)) {  // chunks left from the last time
  }
  {
    const std::lock_guard lock(mutex_);
    frames_.clear();
    recent_.clear();
    rate_hz_ = rate_hz;
  }
  // The rate may be unknown until the first block.
  FrameStream stream({.rate_hz = rate_hz > 0.0 ? rate_hz : 48000.0, .size = frame}, hop,
                     [this](std::size_t, const FrameTimbre& timbre, const FrameAnalysis&) {
                       const std::lock_guard lock(mutex_);
                       frames_.push_back({++number_, timbre});
                       if (frames_.size() > most_kept_frames) {
                         frames_.pop_front();
                       }
                     });
  process_.is_listening.raise();
  std::vector<double> samples;
  bool should_continue = true;
  while (should_continue) {
    // A full ring has lost chunks, so the next chunk does not continue the last one.
    const bool is_whole = process_.listening.size() < process_.listening.capacity();
    samples.clear();
    while (process_.listening.pop(chunk)) {
      for (std::size_t n = 0; n < chunk.frames; ++n) {
        double sum = 0.0;
        for (std::size_t c = 0; c < chunk.channels; ++c) {
          sum += static_cast<double>(chunk.samples[n * chunk.channels + c]);
        }
        samples.push_back(sum / static_cast<double>(chunk.channels));
      }
    }
    std::unique_lock lock(mutex_);
    recent_.insert(recent_.end(), samples.begin(), samples.end());
    if (const std::size_t enough = rate_hz > 0.0 ? recent_samples(rate_hz) : 0;
        recent_.size() > enough) {
      recent_.erase(recent_.begin(), recent_.end() - static_cast<std::ptrdiff_t>(enough));
    }
    // Samples first: a reader that sees a frame finds its samples.
    lock.unlock();
    stream.add(samples);
    lock.lock();
    wake_.wait_for(lock, analysis_interval, [this] { return stop_; });
    should_continue =
        is_whole && !stop_ && Clock::now() < until_ && process_.clock.read().rate_hz == rate_hz;
  }
  process_.is_listening.lower();
}

}  // namespace ressort::session
