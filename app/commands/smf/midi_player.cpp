#include "app/commands/smf/midi_player.h"

#include <chrono>
#include <utility>

#include "app/devices/audio.h"

namespace ressort::commands {

MidiPlayer::MidiPlayer(MidiFile file, MidiSink& door)
    : file_(std::move(file)), door_(door), thread_([this] { work(); }) {}

MidiPlayer::~MidiPlayer() {
  {
    const std::lock_guard lock(mutex_);
    must_end_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

bool MidiPlayer::is_over() const {
  const std::lock_guard lock(mutex_);
  return is_over_;
}

// Stamps messages with their nominal times instead of the times at which this thread wakes up. The
// output has no jitter as long as the thread wakes up within a period.
void MidiPlayer::work() {
  MidiReader reader;
  const std::int64_t start_ns = monotonic_ns();
  const auto start = std::chrono::steady_clock::now();
  std::unique_lock lock(mutex_);
  for (const MidiFile::Message& message : file_.messages) {
    const auto after = std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * message.time_s));
    if (wake_.wait_until(lock, start + after, [this] { return must_end_; })) {
      return;
    }
    lock.unlock();
    door_.arrive(reader, file_.bytes_of(message), start_ns + after.count());
    lock.lock();
  }
  is_over_ = true;
}

}  // namespace ressort::commands
