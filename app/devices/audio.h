// app/devices: what the program needs from an audio backend: a list of functions. jack.cpp,
// alsa.cpp and dummy.cpp each open one; the process is all that they know of the rest.
#pragma once

#include <functional>
#include <string>
#include <utility>

#include "app/devices/wiring.h"
#include "app/realtime/process.h"
#include "core/result.h"

namespace ressort::devices {

struct AudioOptions {
  std::string client_name = "ressort";
  bool connect = false;            // to the physical outputs and to every MIDI source
  int outputs = 2;                 // ports: out_left and out_right, or out_1...
  double rate_hz = 48000.0;        // a wish; JACK has its own
  int period_frames = 256;         // a wish; JACK has its own
  std::string device = "default";  // ALSA's
  Wiring wiring;                   // of the device that was lost, to be made again
};

// A running backend. Closing it, or letting it go, ends its audio thread; the process may then be
// used by another. All functions: [control].
struct AudioDevice {
  std::string kind;         // "jack", "alsa" or "dummy"
  std::string description;  // "JACK, 48000 Hz, 256 frames"
  double rate_hz = 48000.0;
  int priority = 0;  // of its audio thread, if that has one for real time
  std::function<void()> close;
  std::function<bool()> is_lost;              // the server or the device is gone, or runs at
                                              //   another rate: close it and open it anew
  std::function<void(int)> set_audio_inputs;  // the model wants so many
  std::function<void()> tick;                 // often: connects what was plugged in
  std::function<Wiring()> wiring;             // what to make again on the next device
  bool has_midi = false;                      // brings its own MIDI, with exact frames
  std::string note;                           // what was tried before it, and why it failed

  AudioDevice() = default;
  AudioDevice(AudioDevice&& other) noexcept { *this = std::move(other); }
  AudioDevice& operator=(AudioDevice&& other) noexcept {
    std::swap(kind, other.kind);
    std::swap(description, other.description);
    std::swap(rate_hz, other.rate_hz);
    std::swap(priority, other.priority);
    std::swap(close, other.close);
    std::swap(is_lost, other.is_lost);
    std::swap(set_audio_inputs, other.set_audio_inputs);
    std::swap(tick, other.tick);
    std::swap(wiring, other.wiring);
    std::swap(has_midi, other.has_midi);
    std::swap(note, other.note);
    return *this;
  }
  ~AudioDevice() {
    if (close) {
      close();
    }
  }
};

// Errors say what is missing and what to do.
Result<AudioDevice> open_jack(Process& process, const AudioOptions& options);
Result<AudioDevice> open_alsa(Process& process, const AudioOptions& options);
Result<AudioDevice> open_dummy(Process& process, const AudioOptions& options);

// The first that opens of "jack", "alsa" and "dummy", or the one that `wanted` names.
Result<AudioDevice> open_audio(const std::string& wanted, Process& process,
                               const AudioOptions& options);

// Asks for real-time priority for the calling thread; without the right to it, it stays as it is.
void raise_priority();

// Whether that would be granted. [control]
bool may_raise_priority();
inline constexpr int audio_priority = 70;  // above desktops, below the kernel's own audio threads

// Sleeps until the monotonic clock reads this.
void sleep_until(std::int64_t time_ns);

// The monotonic clock, in ns. Reads shared memory, makes no system call. [any thread]
std::int64_t monotonic_ns();

}  // namespace ressort::devices
