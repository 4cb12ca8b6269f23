// app/devices: the interface of an audio backend. jack.cpp, alsa.cpp and dummy.cpp implement it; a
// backend knows nothing of the rest of the program but the process.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "app/devices/wiring.h"
#include "app/realtime/process.h"
#include "core/result.h"

namespace ressort::devices {

struct AudioOptions {
  std::string client_name = "ressort";
  bool connect = false;            // connects to the physical outputs and all MIDI sources
  int outputs = 2;                 // ports: out_left and out_right, or out_1 and so on
  double rate_hz = 48000.0;        // ignored by JACK, which has its own
  int period_frames = 256;         // ignored by JACK, which has its own
  std::string device = "default";  // ALSA only
  bool sends_midi = false;         // a port for messages to controllers
  Wiring wiring;                   // connections of the lost device, to be restored
};

// A running backend. Its destruction ends its audio thread; another backend may then use the
// process. All functions: [control].
struct AudioDevice {
  std::string kind;         // "jack", "alsa" or "dummy"
  std::string description;  // "JACK, 48000 Hz, 256 frames"
  double rate_hz = 48000.0;
  int priority = 0;                           // real-time priority of its audio thread; 0: none
  std::function<bool()> is_lost;              // gone or at another rate: close and reopen it
  std::function<void(int)> set_audio_inputs;  // adds inputs until there are this many
  std::function<void()> tick;                 // call it often: connects ports that were plugged in
  std::function<Wiring()> wiring;             // connections to restore on the next device
  bool has_midi = false;                      // delivers MIDI itself, with exact frames
  std::string note;               // backends that failed before it, outputs that are missing
  std::shared_ptr<void> running;  // ends the audio thread when it is reset
};

// Each opens a backend. Errors say what is missing and what to do.
Result<AudioDevice> open_jack(Process& process, const AudioOptions& options);
Result<AudioDevice> open_alsa(Process& process, const AudioOptions& options);
Result<AudioDevice> open_dummy(Process& process, const AudioOptions& options);

// Opens the backend `wanted`, or for "auto" the first of "jack", "alsa" and "dummy" that opens.
Result<AudioDevice> open_audio(const std::string& wanted, Process& process,
                               const AudioOptions& options);

// Requests real-time priority for the calling thread. Does nothing without the permission.
void raise_priority();

// Returns true if the program may use real-time priority. [control]
bool may_raise_priority();
inline constexpr int audio_priority = 70;  // below the kernel's audio threads

// Sleeps until the monotonic clock reaches this time.
void sleep_until(std::int64_t time_ns);

// Returns the monotonic clock in ns. Reads shared memory, makes no system call. [any thread]
std::int64_t monotonic_ns();

}  // namespace ressort::devices
