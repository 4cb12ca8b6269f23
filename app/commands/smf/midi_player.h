// app/commands: plays a MIDI file like a keyboard.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <thread>

#include "app/commands/smf/midi_file.h"
#include "app/devices/midi_input.h"
#include "app/session/song.h"

namespace ressort::commands {

class MidiPlayer {
 public:
  // Starts a thread that plays through `door` as `song`, which has begun, says. Both must outlive
  // this object.
  MidiPlayer(MidiFile file, MidiSink& door, Song& song);
  ~MidiPlayer();  // stops playing
  MidiPlayer(const MidiPlayer&) = delete;
  MidiPlayer& operator=(const MidiPlayer&) = delete;

 private:
  void work();
  void send(std::span<const std::uint8_t> bytes, Song::Clock::time_point time);
  void release_keys(Song::Clock::time_point time);
  std::size_t go_to(double position_s, Song::Clock::time_point time);

  const MidiFile file_;
  MidiSink& door_;
  Song& song_;
  MidiReader reader_;
  Flag must_end_;
  std::thread thread_;  // last, so that it starts after all members exist
};

}  // namespace ressort::commands
