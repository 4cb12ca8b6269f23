// app/devices: MIDI outside of JACK's audio clients, through RtMidi.
#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <string>

#include "app/realtime/midi.h"
#include "app/realtime/process.h"
#include "core/result.h"

namespace ressort::devices {

// The entry for MIDI packets with a time of arrival. They are played one period later, at constant
// latency. Tests call it as RtMidi does.
class MidiSink {
 public:
  explicit MidiSink(Process& process) : process_(process) {}

  // Plays a packet. `reader` keeps the running status of one source. The lock is shared by the
  // sources only, never by the audio thread. [any thread but audio]
  void arrive(MidiReader& reader, std::span<const std::uint8_t> bytes, std::int64_t time_ns);

 private:
  Process& process_;
  std::mutex mutex_;
};

enum class MidiApi { alsa, jack };

// Listens to all MIDI sources, including ones plugged in later, and opens a port that others can
// connect to, and if messages go to controllers another one for them.
class MidiInput {
 public:
  static Result<std::unique_ptr<MidiInput>> open(MidiApi api, const std::string& client_name,
                                                 bool connect, MidiSink& door,
                                                 Process* sender = nullptr);
  ~MidiInput();

  // Connects new sources and drops unplugged ones. Call it about once a second. [control]
  void tick();
  // Sends the messages that wait for controllers. [control]
  void send();

 private:
  struct Sources;
  explicit MidiInput(std::unique_ptr<Sources> sources);
  std::unique_ptr<Sources> sources_;
};

}  // namespace ressort::devices
