#include "app/commands/smf/midi_file.h"

#include <algorithm>
#include <array>
#include <bitset>
#include <cctype>
#include <optional>
#include <tuple>
#include <utility>

#include "app/session/files.h"
#include "app/text.h"
#include "core/midi_number.h"

namespace ressort::commands {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr double longest_file_s = 24.0 * 3600.0;

// A parsed event. For a tempo, `count` is the length of a quarter note in microseconds.
struct TrackEvent {
  enum class Kind : std::uint8_t { message, tempo, end };
  std::uint64_t tick = 0;
  Kind kind = Kind::message;
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};

// Reads bytes in order. After the first failure it returns 0.
class Reader {
 public:
  Reader(Bytes file, std::size_t at, std::size_t end) : file_(file), at_(at), end_(end) {}

  std::size_t at() const { return at_; }
  bool is_at_end() const { return at_ == end_; }
  std::size_t left() const { return end_ - at_; }
  const std::optional<Error>& failure() const { return failure_; }

  void fail(std::size_t at, const std::string& what) {
    if (!failure_) {
      failure_ = Error{"byte " + std::to_string(at) + ": " + what};
    }
  }

  std::uint8_t peek() const { return at_ < end_ ? file_[at_] : std::uint8_t{0}; }

  Bytes take(std::size_t count, const char* what) {
    if (count > left()) {
      fail(end_, std::string("the file ends within ") + what);
      at_ = end_;
      return {};
    }
    at_ += count;
    return file_.subspan(at_ - count, count);
  }

  // Big-endian.
  std::uint32_t number(std::size_t count, const char* what) {
    std::uint32_t value = 0;
    for (const std::uint8_t byte : take(count, what)) {
      value = value << 8 | byte;
    }
    return value;
  }

  // Reads a variable-length quantity: seven bits per byte, at most four bytes.
  std::uint32_t quantity(const char* what) {
    const std::size_t start = at_;
    std::uint32_t value = 0;
    for (int i = 0; i < 4; ++i) {
      const std::uint32_t byte = number(1, what);
      value = value << 7 | (byte & 0x7fU);
      if (byte < 0x80) {
        return value;
      }
    }
    fail(start, std::string(what) + " has more than four bytes");
    return 0;
  }

 private:
  Bytes file_;
  std::size_t at_;
  std::size_t end_;
  std::optional<Error> failure_;
};

class Track {
 public:
  Track(Reader& reader, std::vector<TrackEvent>& events, std::vector<std::uint8_t>& bytes)
      : reader_(reader), events_(events), bytes_(bytes) {}

  // Returns true after an end-of-track event.
  bool read() {
    bool should_continue = true;
    while (should_continue && !reader_.is_at_end() && !reader_.failure()) {
      tick_ += reader_.quantity("the time before an event");
      should_continue = read_event();
    }
    add(TrackEvent::Kind::end, 0, 0);
    return !should_continue && !reader_.failure();
  }
  // Returns the offset of the first real-time byte between events, which belong into no file.
  std::optional<std::size_t> realtime() const { return realtime_; }

 private:
  void add(TrackEvent::Kind kind, std::size_t first, std::size_t count) {
    events_.push_back(
        {tick_, kind, static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(count)});
  }

  // Appends a message: its status, if any, and bytes of the file.
  void add_message(int status, Bytes data) {
    const std::size_t first = bytes_.size();
    if (status != 0) {
      bytes_.push_back(static_cast<std::uint8_t>(status));
    }
    bytes_.insert(bytes_.end(), data.begin(), data.end());
    add(TrackEvent::Kind::message, first, bytes_.size() - first);
  }

  // Returns false at the end of the track.
  bool read_event() {
    const std::size_t start = reader_.at();
    if (reader_.peek() < 0x80) {
      if (running_ == 0 && reader_.left() > 0) {
        reader_.fail(start, "expected an event, found a data byte without a running status");
      }
      read_channel_message();
      return true;
    }
    const std::uint32_t status = reader_.number(1, "an event");
    if (status < 0xf0) {
      running_ = static_cast<int>(status);
      read_channel_message();
    } else if (status == 0xf0 || status == 0xf7) {
      const std::uint32_t count = reader_.quantity("the length of a SysEx");
      const Bytes data = reader_.take(count, "a SysEx");
      if (!reader_.failure() && (status == 0xf0 || !data.empty())) {
        add_message(status == 0xf0 ? 0xf0 : 0, data);
      }
    } else if (status == 0xff) {
      return read_meta(start);
    } else if (status >= 0xf8) {
      realtime_ = realtime_.value_or(start);
    } else {
      reader_.fail(start, "this status byte is not allowed in a file");
    }
    return true;
  }

  void read_channel_message() {
    const int kind = running_ & 0xf0;
    const std::size_t start = reader_.at();
    const Bytes data = reader_.take(kind == 0xc0 || kind == 0xd0 ? 1 : 2, "a channel message");
    for (std::size_t i = 0; i < data.size(); ++i) {
      if (data[i] >= 0x80) {
        reader_.fail(start + i, "expected a data byte, found a status byte");
      }
    }
    if (!reader_.failure()) {
      add_message(running_, data);
    }
  }

  bool read_meta(std::size_t start) {
    const std::uint32_t type = reader_.number(1, "a meta event");
    const std::uint32_t count = reader_.quantity("the length of a meta event");
    const Bytes data = reader_.take(count, "a meta event");
    constexpr std::uint32_t end_of_track = 0x2f;
    constexpr std::uint32_t set_tempo = 0x51;
    if (type == set_tempo && !reader_.failure()) {
      const std::uint32_t quarter_us = data.size() == 3
                                           ? static_cast<std::uint32_t>(data[0]) << 16 |
                                                 static_cast<std::uint32_t>(data[1]) << 8 | data[2]
                                           : 0;
      if (quarter_us == 0) {
        reader_.fail(start, "a tempo must have three bytes and must not be 0");
        return true;
      }
      add(TrackEvent::Kind::tempo, 0, quarter_us);
    }
    return type != end_of_track;
  }

  Reader& reader_;
  std::vector<TrackEvent>& events_;
  std::vector<std::uint8_t>& bytes_;
  std::uint64_t tick_ = 0;
  int running_ = 0;  // running status
  std::optional<std::size_t> realtime_;
};

// Duration of a tick: a fraction of a quarter note, which depends on the tempo, or of an SMPTE
// frame.
struct Division {
  double ticks_per_quarter = 0.0;  // 0: ticks divide SMPTE frames
  double tick_s = 0.0;             // length of a tick of SMPTE time
};

Division read_division(Reader& reader) {
  const std::size_t start = reader.at();
  const std::uint32_t division = reader.number(2, "the header");
  if (division < 0x8000) {
    if (division == 0) {
      reader.fail(start, "the number of ticks per quarter note is 0");
    }
    return {.ticks_per_quarter = static_cast<double>(division)};
  }
  const std::uint32_t frames = 256 - (division >> 8);
  const std::uint32_t ticks = division & 0xffU;
  const bool is_known = frames == 24 || frames == 25 || frames == 29 || frames == 30;
  if (!is_known || ticks == 0) {
    reader.fail(start, "expected 24, 25, 29 or 30 SMPTE frames per second with at least one tick");
    return {};
  }
  const double frames_per_s = frames == 29 ? 30000.0 / 1001.0 : frames;  // 29: 30 drop frame
  return {.tick_s = 1.0 / (frames_per_s * ticks)};
}

bool is_chunk(Bytes type, std::string_view name) {
  return std::ranges::equal(type, name);
}

// Returns the offset of a chunk's name at or after `from`, or the end of the file.
std::size_t find_chunk(Bytes file, std::string_view name, std::size_t from) {
  const auto found = std::search(file.begin() + static_cast<std::ptrdiff_t>(from), file.end(),
                                 name.begin(), name.end());
  return static_cast<std::size_t>(found - file.begin());
}

// Reads the tracks of a file whose chunks may have wrong lengths and which may end early.
class Tracks {
 public:
  Tracks(Bytes file, MidiFile& midi) : file_(file), midi_(midi) {}

  // Reads a track whose events begin at `first`. Returns the offset behind it.
  std::size_t read(std::size_t first, std::size_t count) {
    const std::size_t rest = file_.size() - first;
    std::size_t end = first + std::min(count, rest);
    auto [at, is_ended] = read_events(first, end);
    if (!is_ended && !is_chunk_at(end)) {  // events follow the chunk
      const std::size_t next = find_chunk(file_, "MTrk", end);
      undo();
      std::tie(at, is_ended) = read_events(first, next);
      end = next;
      warn(first - 4, "the chunk says " + std::to_string(count) + " bytes, but its events go on");
    } else if ((count > rest && !failure_) || (is_ended && at < end && is_chunk_at(at))) {
      warn(first - 4, "the chunk says " + std::to_string(count) +
                          " bytes, but its events end after " + std::to_string(at - first));
      end = at;
    }
    if (failure_) {
      midi_.warnings.push_back(failure_->message + "; the rest of the track is left out");
    } else if (realtime_) {
      warn(*realtime_, "left out: real-time messages between the events");
    }
    return end;
  }

  void warn(std::size_t at, const std::string& text) {
    midi_.warnings.push_back("byte " + std::to_string(at) + ": " + text);
  }
  std::vector<TrackEvent> take_events() { return std::move(events_); }

 private:
  std::pair<std::size_t, bool> read_events(std::size_t first, std::size_t end) {
    kept_events_ = events_.size();
    kept_bytes_ = midi_.bytes.size();
    Reader reader(file_, first, end);
    Track track(reader, events_, midi_.bytes);
    const bool is_ended = track.read();
    failure_ = reader.failure();
    realtime_ = track.realtime();
    return {reader.at(), is_ended};
  }
  // Drops the events of the track.
  void undo() {
    events_.resize(kept_events_);
    midi_.bytes.resize(kept_bytes_);
  }
  bool is_chunk_at(std::size_t at) const {
    const Bytes name = file_.subspan(at, std::min<std::size_t>(4, file_.size() - at));
    return name.empty() || (name.size() == 4 && std::ranges::all_of(name, [](int c) {
                              return std::isalnum(c) != 0 || c == ' ';
                            }));
  }

  Bytes file_;
  MidiFile& midi_;
  std::vector<TrackEvent> events_;
  std::size_t kept_events_ = 0;  // of the tracks before
  std::size_t kept_bytes_ = 0;
  std::optional<Error> failure_;
  std::optional<std::size_t> realtime_;
};

}  // namespace

Result<MidiFile> parse_midi_file(Bytes file) {
  // A RIFF head (.rmi) or a MacBinary head may come first.
  const std::size_t begin = find_chunk(file, "MThd", 0);
  if (begin == file.size()) {
    return Error{"byte 0: expected MThd, the start of a MIDI file"};
  }
  Reader reader(file, begin + 4, file.size());
  const std::uint32_t header_bytes = reader.number(4, "the header");
  const std::size_t header = reader.at();
  const std::uint32_t type = reader.number(2, "the header");
  const std::uint32_t tracks = reader.number(2, "the header");
  if (!reader.failure() && (header_bytes < 6 || type > 2)) {
    reader.fail(header, header_bytes < 6 ? "the header has fewer than 6 bytes"
                                         : "type " + std::to_string(type) +
                                               " is unknown; types 0, 1 and 2 are read");
  }
  const Division division = read_division(reader);
  reader.take(header_bytes < 6 ? 0 : header_bytes - 6, "the header");
  if (reader.failure()) {
    return *reader.failure();
  }

  MidiFile midi;
  Tracks reading(file, midi);
  if (begin > 0 && !is_chunk(file.first(4), "RIFF")) {
    reading.warn(
        0, "ignored " + std::to_string(begin) + " bytes before MThd, such as a MacBinary head");
  }
  std::uint32_t found = 0;
  std::size_t at = reader.at();
  constexpr std::size_t head_bytes = 8;
  while (at + head_bytes <= file.size() &&
         (found < tracks || is_chunk(file.subspan(at, 4), "MTrk"))) {
    Reader head(file, at, file.size());
    const bool is_track = is_chunk(head.take(4, "the head of a chunk"), "MTrk");
    const std::size_t count = head.number(4, "the head of a chunk");
    found += is_track ? 1 : 0;
    const bool is_played = is_track && (type < 2 || found == 1);
    at = is_played ? reading.read(head.at(), count)
                   : head.at() + std::min(count, file.size() - head.at());
  }
  if (found == 0) {
    return Error{"byte " + std::to_string(at) + ": the file ends before track 1 of " +
                 std::to_string(tracks)};
  }
  if (type == 2) {
    reading.warn(header, "type 2, a list of sequences: only the first one is played");
  } else if (found != tracks) {
    reading.warn(header + 2, "the header says " + counted(tracks, "track", "tracks") +
                                 ", the file has " + std::to_string(found));
  }
  std::vector<TrackEvent> events = reading.take_events();
  const bool is_empty = std::ranges::all_of(
      events, [](const TrackEvent& event) { return event.kind == TrackEvent::Kind::end; });
  if (is_empty && !midi.warnings.empty()) {
    return Error{midi.warnings.front()};
  }

  std::ranges::stable_sort(events, {}, &TrackEvent::tick);
  constexpr double default_quarter_s = 0.5;  // 120 quarter notes a minute
  double tick_s =
      division.tick_s > 0.0 ? division.tick_s : default_quarter_s / division.ticks_per_quarter;
  std::uint64_t tick = 0;
  for (const TrackEvent& event : events) {
    midi.length_s += static_cast<double>(event.tick - tick) * tick_s;
    tick = event.tick;
    if (midi.length_s > longest_file_s) {
      return Error{"longer than a day"};
    }
    switch (event.kind) {
      case TrackEvent::Kind::message:
        midi.messages.push_back({midi.length_s, event.first, event.count});
        break;
      case TrackEvent::Kind::tempo:
        if (division.tick_s == 0.0) {
          tick_s = 1e-6 * event.count / division.ticks_per_quarter;
          auto& tempos = midi.tempos.tempos;
          if (tick == 0) {
            tempos.clear();
          }
          tempos.push_back({static_cast<double>(tick) / division.ticks_per_quarter, midi.length_s,
                            6e7 / event.count});
        }
        break;
      case TrackEvent::Kind::end:
        break;
    }
  }
  release_all(midi);
  return midi;
}

void release_all(MidiFile& midi) {
  using enum MidiNumber::Controller;
  static constexpr std::array<std::uint8_t, 2> pedals = {sustain_pedal, sostenuto_pedal};
  struct Channel {
    std::bitset<128> keys;
    std::bitset<pedals.size()> pressed;
  };
  std::array<Channel, 16> channels;
  for (const MidiFile::Message& message : midi.messages) {
    const auto bytes = midi.bytes_of(message);
    constexpr std::uint8_t highest_data = 127;  // an escaped SysEx message has any bytes
    if (bytes.size() != 3 || bytes[1] > highest_data) {
      continue;
    }
    Channel& channel = channels[bytes[0] & 0x0f];
    const std::uint8_t number = bytes[1];
    switch (bytes[0] & 0xf0) {
      case 0x80:
        channel.keys.reset(number);
        break;
      case 0x90:
        channel.keys.set(number, bytes[2] > 0);
        break;
      case 0xb0:
        for (std::size_t i = 0; i < pedals.size(); ++i) {
          channel.pressed[i] = number == pedals[i] ? bytes[2] > 0 : channel.pressed[i];
        }
        if (number == reset_all_controllers) {
          channel.pressed.reset();
        } else if (number >= all_sound_off && number != local_control) {
          channel.keys.reset();
        }
        break;
      default:
        break;
    }
  }
  const auto append = [&](int status, std::size_t number, std::uint8_t value) {
    midi.messages.push_back({midi.length_s, static_cast<std::uint32_t>(midi.bytes.size()), 3});
    midi.bytes.insert(midi.bytes.end(), {static_cast<std::uint8_t>(status),
                                         static_cast<std::uint8_t>(number), value});
  };
  for (int c = 0; c < 16; ++c) {
    const Channel& channel = channels[static_cast<std::size_t>(c)];
    for (std::size_t key = 0; key < channel.keys.size(); ++key) {
      if (channel.keys[key]) {
        append(0x80 | c, key, 64);
      }
    }
    for (std::size_t i = 0; i < pedals.size(); ++i) {
      if (channel.pressed[i]) {
        append(0xb0 | c, pedals[i], 0);
      }
    }
  }
}

void map_channels(MidiFile& midi, const KeyOptions::SongChannels& channels) {
  std::erase_if(midi.messages, [&](const MidiFile::Message& message) {
    std::uint8_t& status = midi.bytes[message.first];
    if (status < 0x80 || status >= 0xf0) {
      return false;  // a part of a SysEx
    }
    const int to = channels[status & 0x0f];
    status = static_cast<std::uint8_t>((status & 0xf0) | std::max(0, to));
    return to < 0;
  });
}

Result<MidiFile> read_midi_file(const std::string& path,
                                const std::optional<KeyOptions::SongChannels>& channels) {
  const auto bytes = read_bytes(path, max_midi_file_bytes);
  if (!bytes) {
    return bytes.error();
  }
  auto midi = parse_midi_file(
      std::span(reinterpret_cast<const std::uint8_t*>(bytes->data()), bytes->size()));
  if (!midi) {
    return Error{"'" + path + "' is not a valid MIDI file: " + midi.error().message};
  }
  for (std::string& warning : midi->warnings) {
    warning = path + ": " + warning;
  }
  if (channels) {
    map_channels(*midi, *channels);
  }
  return midi;
}

bool is_midi_file_name(std::string_view path) {
  std::string lower(path);
  std::ranges::transform(lower, lower.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower.ends_with(".mid") || lower.ends_with(".midi") || lower.ends_with(".rmi");
}

}  // namespace ressort::commands
