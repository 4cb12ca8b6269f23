// app/commands: plays a MIDI file like a keyboard.
#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

#include "app/commands/smf/midi_file.h"
#include "app/devices/midi_input.h"

namespace ressort::commands {

class MidiPlayer {
 public:
  // Starts a thread that plays through `door`, which must outlive this object.
  MidiPlayer(MidiFile file, MidiSink& door);
  ~MidiPlayer();  // stops playing
  MidiPlayer(const MidiPlayer&) = delete;
  MidiPlayer& operator=(const MidiPlayer&) = delete;

  // Returns whether the last message has been played. [any thread]
  bool is_over() const;

 private:
  void work();

  MidiFile file_;
  MidiSink& door_;
  mutable std::mutex mutex_;  // guards the next three
  std::condition_variable wake_;
  bool must_end_ = false;
  bool is_over_ = false;
  std::thread thread_;  // last, so that it starts after all members exist
};

}  // namespace ressort::commands
