// app/commands: a MIDI file as a keyboard that plays by itself.
#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

#include "app/commands/smf/midi_file.h"
#include "app/devices/midi_input.h"

namespace ressort::commands {

class MidiPlayer {
 public:
  // Starts to play through the door, in a thread of its own. The door must outlive it.
  MidiPlayer(MidiFile file, MidiDoor& door);
  ~MidiPlayer();  // what it has not played is not played
  MidiPlayer(const MidiPlayer&) = delete;
  MidiPlayer& operator=(const MidiPlayer&) = delete;

  // Whether the last message has been played. [any thread]
  bool is_over() const;

 private:
  void work();

  MidiFile file_;
  MidiDoor& door_;
  mutable std::mutex mutex_;  // of the next three
  std::condition_variable wake_;
  bool must_end_ = false;
  bool is_over_ = false;
  std::thread thread_;  // last, so that all else is there when it starts
};

}  // namespace ressort::commands
