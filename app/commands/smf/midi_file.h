// app/commands: Standard MIDI Files (MIDI Manufacturers Association, RP-001). Pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "app/session/loader.h"
#include "app/session/song.h"
#include "core/result.h"

namespace ressort::commands {

inline constexpr std::size_t max_midi_file_bytes = std::size_t{16} << 20;

struct MidiFile {
  struct Message {
    double time_s = 0.0;
    std::uint32_t first = 0;  // index into `bytes`
    std::uint32_t count = 0;
  };
  std::vector<Message> messages;    // messages of all tracks, sorted by time, then by track
  std::vector<std::uint8_t> bytes;  // bytes of the messages, each with its status byte
  TempoMap tempos;
  double length_s = 0.0;              // time of the last event, ends of tracks included
  std::vector<std::string> warnings;  // damage that was read over

  std::span<const std::uint8_t> bytes_of(const Message& message) const {
    return std::span(bytes).subspan(message.first, message.count);
  }
};

// Parses channel messages and SysEx and converts ticks to seconds. Ignores other meta events, other
// chunks, and bytes after the last track. Running status continues after meta events, as most
// programs write it. Releases at the end the keys and pedals that the file leaves down. Reads files
// in a RIFF wrapper, and over damage: a MacBinary head, wrong lengths and counts, real-time
// messages, an early end, for which it adds warnings. Plays the first sequence of type 2. Errors
// and warnings have the offset of the byte, from 0. Fails for files longer than a day. O(n log n)
// in the size of the file, for each of its tracks at worst.
Result<MidiFile> parse_midi_file(std::span<const std::uint8_t> file);

// Appends messages at the end that release all keys and pedals that are still down.
void release_all(MidiFile& midi);

// Moves messages to other channels, or leaves them out.
void map_channels(MidiFile& midi, const KeyOptions::SongChannels& channels);

// Reads and parses a file, and maps its channels. Errors have its name.
Result<MidiFile> read_midi_file(const std::string& path,
                                const std::optional<KeyOptions::SongChannels>& channels = {});

// Returns whether a name ends in .mid, .midi or .rmi, in upper or lower case.
bool is_midi_file_name(std::string_view path);

}  // namespace ressort::commands
