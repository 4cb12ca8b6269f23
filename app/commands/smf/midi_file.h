// app/commands: Standard MIDI Files (MIDI Manufacturers Association, RP-001), types 0 and 1. Pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "app/rooms.h"
#include "core/result.h"

namespace ressort::commands {

inline constexpr std::size_t max_midi_file_bytes = std::size_t{16} << 20;

struct MidiFile {
  struct Message {
    double time_s = 0.0;
    std::uint32_t first = 0;  // of `bytes`
    std::uint32_t count = 0;
  };
  std::vector<Message> messages;    // of all tracks, in time; at one time by tracks
  std::vector<std::uint8_t> bytes;  // theirs, each with its status, as a cable carries them
  double length_s = 0.0;            // to the last event, the ends of tracks included

  std::span<const std::uint8_t> bytes_of(const Message& message) const {
    return std::span(bytes).subspan(message.first, message.count);
  }
};

// Channel messages and SysEx, and what tempo changes or frames of SMPTE make of their ticks. Other
// meta events, chunks of other kinds and what comes after the last track are passed over, and
// running status lasts beyond meta events, as most writers of files have it. An error says at which
// byte, from 0, the file is broken; a file of type 2, or longer than a day, is one too. O(n log n)
// of the file's bytes.
Result<MidiFile> parse_midi_file(std::span<const std::uint8_t> file);

// The same from a file; an error has its name.
Result<MidiFile> read_midi_file(const std::string& path);

// Whether a person means such a file by a name: it ends in .mid or .midi, in any case.
bool names_midi_file(std::string_view path);

}  // namespace ressort::commands
