#include "app/devices/audio.h"

#include <pthread.h>
#include <time.h>

#include <cerrno>
#include <chrono>
#include <thread>

namespace ressort::devices {

Result<AudioDevice> open_audio(const std::string& wanted, Process& process,
                               const AudioOptions& options) {
  struct Kind {
    const char* name;
    Result<AudioDevice> (*open)(Process&, const AudioOptions&);
  };
  std::string note;
  for (const Kind& kind :
       {Kind{"jack", open_jack}, Kind{"alsa", open_alsa}, Kind{"dummy", open_dummy}}) {
    if (wanted != "auto" && wanted != kind.name) {
      continue;
    }
    auto device = kind.open(process, options);
    if (device) {
      device->kind = kind.name;
      note += note.empty() || device->note.empty() ? "" : "\n";
      device->note = note + device->note;
      return device;
    }
    note += (note.empty() ? "" : "\n") + device.error().message;
  }
  return Error{std::move(note)};
}

namespace {

bool ask_for_priority() {
  sched_param priority{};
  priority.sched_priority = audio_priority;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority) == 0;
}

}  // namespace

void raise_priority() {
  static_cast<void>(ask_for_priority());
}

bool may_raise_priority() {
  bool may = false;
  std::thread([&] { may = ask_for_priority(); }).join();
  return may;
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

}  // namespace ressort::devices
