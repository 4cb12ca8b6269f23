// app/devices: MIDI from outside JACK. A door that any thread may knock at, and RtMidi behind it.
#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <string>

#include "app/realtime/midi.h"
#include "app/realtime/process.h"
#include "core/result.h"

namespace ressort::devices {

// Where packets with a time of arrival enter. They are played one period later, at constant
// latency. A test drives it as RtMidi does.
class MidiDoor {
 public:
  explicit MidiDoor(Process& process) : process_(process) {}

  // `reader` keeps one source's running status. [any thread but audio] The lock is between
  // sources; the audio thread never sees it.
  void arrive(MidiReader& reader, std::span<const std::uint8_t> bytes, std::int64_t time_ns);

 private:
  Process& process_;
  std::mutex mutex_;
};

enum class MidiApi { alsa, jack };

// Listens to every source there is and to those that are plugged in later; offers a port of its
// own that others can be connected to.
class MidiInput {
 public:
  static Result<std::unique_ptr<MidiInput>> open(MidiApi api, const std::string& client_name,
                                                 bool connect, MidiDoor& door);
  ~MidiInput();

  // About every second: connects new sources, forgets those that are gone. [control]
  void tick();

 private:
  struct Sources;
  explicit MidiInput(std::unique_ptr<Sources> sources);
  std::unique_ptr<Sources> sources_;
};

}  // namespace ressort::devices
