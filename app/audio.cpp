#include "app/audio.h"

#include <pthread.h>
#include <time.h>

#include <cerrno>
#include <chrono>

namespace ressort {

Result<AudioDevice> open_audio(const std::string& wanted, Process& process,
                               const AudioOptions& options) {
  if (wanted == "jack") {
    return open_jack(process, options);
  }
  if (wanted == "alsa") {
    return open_alsa(process, options);
  }
  if (wanted == "dummy") {
    return open_dummy(process, options);
  }
  std::string note;
  for (auto* const open : {open_jack, open_alsa, open_dummy}) {
    auto device = open(process, options);
    if (device) {
      device->note = std::move(note);
      return device;
    }
    note += (note.empty() ? "" : "\n") + device.error().message;
  }
  return Error{std::move(note)};
}

void raise_priority() {
  sched_param priority{};
  priority.sched_priority = 70;  // above desktops, below the kernel's own audio threads
  pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority);
}

void sleep_until(std::int64_t time_ns) {
  const timespec wake{time_ns / 1'000'000'000, time_ns % 1'000'000'000};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr) == EINTR) {
  }
}

std::int64_t monotonic_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace ressort
