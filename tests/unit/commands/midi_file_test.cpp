// Standard MIDI Files, byte by byte, with times computed by hand.
#include "app/commands/smf/midi_file.h"

#include <cmath>

#include "app/commands/offline.h"
#include "app/session/sound_file.h"
#include "tests/support/app/data_folder.h"
#include "tests/support/rooms.h"

namespace ressort::midi_file_test {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

Bytes header(int type, int tracks, int division) {
  const auto byte = [](int value) { return static_cast<std::uint8_t>(value & 0xff); };
  return {
      'M',           'T', 'h', 'd', 0, 0, 0, 6, 0, byte(type), 0, byte(tracks), byte(division >> 8),
      byte(division)};
}

Bytes track(const Bytes& events) {
  const auto size = static_cast<std::uint8_t>(events.size());
  return Bytes{'M', 'T', 'r', 'k', 0, 0, 0, size} + events;
}

const Bytes end = {0, 0xff, 0x2f, 0};

MidiFile read(const Bytes& bytes) {
  auto midi = parse_midi_file(bytes);
  INFO((midi ? "" : midi.error().message));
  REQUIRE(midi);
  return *std::move(midi);
}

void check(const MidiFile& midi, std::size_t i, double time_s, const Bytes& bytes) {
  INFO(i);
  REQUIRE(i < midi.messages.size());
  CHECK(std::fabs(midi.messages[i].time_s - time_s) < 1e-12);
  const auto found = midi.bytes_of(midi.messages[i]);
  CHECK(Bytes(found.begin(), found.end()) == bytes);
}

std::string failure(const Bytes& bytes) {
  const auto midi = parse_midi_file(bytes);
  return midi ? "" : midi.error().message;
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != text.npos;
}

}  // namespace

TEST_CASE("Running status, a tempo change and long times are parsed", "[midi_file]") {
  // 96 ticks a quarter note: 48 ticks are 0.25 s at 120, and 0.5 s at 60 quarter notes a minute.
  const MidiFile midi =
      read(header(0, 1, 96) + track(Bytes{0,    0x93, 60,   100, 48,   60,   0,  // running status
                                          0,    0xff, 0x51, 3,   0x0f, 0x42, 0x40,  // 1 000 000 us
                                          48,   0x93, 62,   1,                      //
                                          0x81, 0x40, 0xc3, 5,                      // 192 ticks
                                          0,    7} +  // running status again
                                    end));
  REQUIRE(midi.messages.size() == 6);
  check(midi, 0, 0.0, {0x93, 60, 100});
  check(midi, 1, 0.25, {0x93, 60, 0});
  check(midi, 2, 0.75, {0x93, 62, 1});
  check(midi, 3, 2.75, {0xc3, 5});
  check(midi, 4, 2.75, {0xc3, 7});
  check(midi, 5, 2.75, {0x83, 62, 64});  // the file leaves this key down
  CHECK(std::fabs(midi.length_s - 2.75) < 1e-12);
  CHECK(midi.tempos.beats_per_minute_at(0.0) == 120.0);
  // A beat of 96 ticks lasts half a second up to the tempo after half a beat, then a second.
  CHECK(midi.tempos.beats_per_minute_at(0.24) == 120.0);
  CHECK(midi.tempos.beats_per_minute_at(0.26) == Approx(60.0));
  CHECK(midi.tempos.time_of(0.25) == Approx(0.125));
  CHECK(midi.tempos.time_of(3.0) == Approx(2.75));
  const MidiFile slow = read(
      header(0, 1, 96) + track(Bytes{0, 0xff, 0x51, 3, 0x0f, 0x42, 0x40, 0, 0x93, 60, 100} + end));
  CHECK(slow.tempos.beats_per_minute_at(0.0) == Approx(60.0));
}

TEST_CASE("channels play on others or are left out", "[midi_file]") {
  MidiFile midi = read(header(0, 1, 96) +
                       track(Bytes{0, 0x92, 60, 100, 0, 0x90, 61, 100, 0, 0xf0, 2,  1, 0xf7,  //
                                   0, 0xe2, 0,  70,  0, 0x82, 60, 0,   0, 0x80, 61, 0} +
                             end));
  KeyOptions::SongChannels channels;
  channels.fill(-1);
  channels[2] = 9;
  map_channels(midi, channels);
  REQUIRE(midi.messages.size() == 4);
  check(midi, 0, 0.0, {0x99, 60, 100});
  check(midi, 1, 0.0, {0xf0, 1, 0xf7});
  check(midi, 2, 0.0, {0xe9, 0, 70});
  check(midi, 3, 0.0, {0x89, 60, 0});
}

TEST_CASE("Tracks of type 1 play together, with the tempo of any track", "[midi_file]") {
  const MidiFile midi =
      read(header(1, 2, 480) +
           // The tempo doubles after a quarter note: 250 000 us.
           track(Bytes{0x83, 0x60, 0xff, 0x51, 3, 0x03, 0xd0, 0x90} + end) +
           Bytes{'X', 'F', 'I', 'H', 0, 0, 0, 2, 1, 2} +  // a chunk of another kind
           track(Bytes{0, 0x90, 60, 1, 0x87, 0x40, 0x80, 60, 64, 0x83, 0x60, 0xff, 0x2f, 0}) +
           Bytes{1, 2, 3});
  REQUIRE(midi.messages.size() == 2);
  check(midi, 0, 0.0, {0x90, 60, 1});
  check(midi, 1, 0.75, {0x80, 60, 64});  // 480 ticks in 0.5 s and 480 in 0.25 s
  CHECK(std::fabs(midi.length_s - 1.0) < 1e-12);
}

TEST_CASE("SMPTE times ignore the tempo", "[midi_file]") {
  // 25 frames of 40 ticks are a second. The value 29 means 30 drop frame, so 30000 / 1001 frames
  // are a second.
  const Bytes events = track(Bytes{0, 0xff, 0x51, 3, 1, 0, 0, 0x87, 0x68, 0x90, 1, 1} + end);
  check(read(header(0, 1, (256 - 25) << 8 | 40) + events), 0, 1.0, {0x90, 1, 1});
  check(read(header(0, 1, (256 - 29) << 8 | 40) + events), 0, 25.0 * 1001.0 / 30000.0,
        {0x90, 1, 1});
}

TEST_CASE("Keys and pedals that a file leaves down are released at its end", "[midi_file]") {
  const MidiFile midi = read(header(0, 1, 96) + track(Bytes{0,  0x90, 60,   1,    //
                                                            0,  0x90, 62,   1,    //
                                                            0,  0x91, 62,   1,    //
                                                            0,  0x95, 64,   1,    //
                                                            0,  0xb0, 64,   127,  // sustain
                                                            0,  0xb1, 64,   127,  //
                                                            0,  0xb2, 66,   1,    // sostenuto
                                                            0,  0x80, 60,   0,    //
                                                            0,  0xb1, 64,   0,    //
                                                            0,  0xb5, 123,  0,    // all notes off
                                                            96, 0xff, 0x2f, 0}));
  REQUIRE(midi.messages.size() == 14);
  check(midi, 10, 0.5, {0x80, 62, 64});
  check(midi, 11, 0.5, {0xb0, 64, 0});
  check(midi, 12, 0.5, {0x81, 62, 64});
  check(midi, 13, 0.5, {0xb2, 66, 0});
}

TEST_CASE("Whole, divided and escaped SysEx messages are passed on", "[midi_file]") {
  const MidiFile midi = read(
      // a complete exclusive message
      header(0, 1, 96) +
      track(Bytes{0,    0xf0, 4,    0x7e, 0x7f, 9,    0xf7, 0,
                  0xf0, 2,    0x43, 0x12,                         // the first part of one
                  96,   0xf7, 2,    0x01, 0xf7,                   // its second and last part
                  0,    0xf7, 1,    0xf8, 0,    0x80, 1,    2} +  // a clock, escaped
            end));
  REQUIRE(midi.messages.size() == 5);
  check(midi, 0, 0.0, {0xf0, 0x7e, 0x7f, 9, 0xf7});
  check(midi, 1, 0.0, {0xf0, 0x43, 0x12});
  check(midi, 2, 0.5, {0x01, 0xf7});
  check(midi, 3, 0.5, {0xf8});
  check(midi, 4, 0.5, {0x80, 1, 2});
}

TEST_CASE("Errors of a MIDI file have the offset of the byte", "[midi_file]") {
  CHECK(contains(failure({}), "MThd"));
  CHECK(contains(failure({'R', 'I', 'F', 'F', 0, 0, 0, 0}), "byte 0"));
  CHECK(contains(failure({'M', 'T', 'h', 'd', 0, 0}), "byte 6: the file ends"));
  CHECK(contains(failure(header(3, 1, 96)), "type 3"));
  CHECK(contains(failure(header(0, 1, 0)), "byte 12"));
  CHECK(contains(failure(header(0, 1, 0xe000)), "SMPTE"));
  CHECK(contains(failure(header(0, 1, (256 - 25) << 8)), "SMPTE"));
  CHECK(contains(failure(header(0, 1, 96)), "byte 14: the file ends before track 1 of 1"));
  const Bytes head = header(0, 1, 96);  // 14 bytes, the track's events begin at 22
  CHECK(contains(failure(head + Bytes{'M', 'T', 'r', 'k', 0, 0, 0, 9, 0}),
                 "byte 23: the file ends within"));
  CHECK(contains(failure(head + track({0, 60, 1})), "byte 23: expected an event"));
  CHECK(contains(failure(head + track({0, 0x90, 60, 0x90})), "byte 25: expected a data byte"));
  CHECK(contains(failure(head + track({0, 0x90, 60})),
                 "byte 25: the file ends within a channel message"));
  CHECK(contains(failure(head + track({0, 0xf4})), "byte 23: this status byte"));
  CHECK(contains(failure(head + track({0x81, 0x82, 0x83, 0x84, 0})), "byte 22: the time"));
  CHECK(contains(failure(head + track({0, 0xff, 0x51, 2, 1, 1})), "byte 23: a tempo"));
  CHECK(contains(failure(head + track({0, 0xff, 0x51, 3, 0, 0, 0})), "byte 23: a tempo"));
  CHECK(contains(failure(head + track({0, 0xf0, 0x7f, 1})), "the file ends within a SysEx"));
  // 2^28 - 1 ticks of a second each.
  CHECK(contains(failure(header(0, 1, 1) + track({0, 0xff, 0x51, 3, 0xff, 0xff, 0xff,  //
                                                  0xff, 0xff, 0xff, 0x7f, 0x90, 1, 1})),
                 "longer than a day"));
}

// Each kind of damage, in each wrapper, with one and with two tracks: the notes are played and the
// damage is told once.
TEST_CASE("Wrapped and damaged files play what they have", "[midi_file]") {
  const Bytes note = {96, 0x90, 60, 100, 96, 0x80, 60, 64};
  const auto chunk = [](int says, const Bytes& events) {
    return Bytes{'M', 'T', 'r', 'k', 0, 0, 0, static_cast<std::uint8_t>(says)} + events;
  };
  const Bytes whole = note + end;
  const auto size = static_cast<int>(whole.size());
  const Bytes realtime = Bytes{96, 0x90, 60, 100, 48, 0xf8, 48, 0x80, 60, 64} + end;
  const struct {
    const char* what;
    Bytes last;  // the last track
    const char* warning;
  } kinds[] = {
      {"intact", chunk(size, whole), ""},
      {"long", chunk(size + 90, whole), "the chunk says 102 bytes, but its events end"},
      {"short", chunk(size - 3, whole), "the chunk says 9 bytes, but its events go on"},
      {"empty", chunk(0, whole), "the chunk says 0 bytes, but its events go on"},
      {"cut", chunk(size, Bytes(whole.begin(), whole.end() - 1)),
       "within the length of a meta event; the rest of the track is left out"},
      {"realtime", track(realtime), "left out: real-time messages"},
      {"torn", chunk(size, Bytes(note.begin(), note.end() - 1)),
       "within a channel message; the rest of the track is left out"},
      {"wrong", track(Bytes{96, 0x90, 60, 100, 96, 0xf4, 1}),
       "this status byte is not allowed in a file; the rest of the track is left out"},
  };
  int files = 0;
  for (const auto& kind : kinds) {
    for (const int count : {1, 2}) {
      for (const int told : {count, 5}) {
        Bytes file = header(count == 1 ? 0 : 1, told, 96);
        file = file + (count == 2 ? track(Bytes{0, 0x91, 70, 1, 1, 0x81, 70, 2} + end) : Bytes()) +
               kind.last;
        Bytes riff = {'R', 'I', 'F', 'F', 0, 0, 0, 0, 'R', 'M', 'I', 'D', 'd', 'a', 't', 'a'};
        riff = riff + Bytes{static_cast<std::uint8_t>(file.size()), 0, 0, 0};
        for (const Bytes& wrapper : {Bytes(), riff, Bytes(128, 0)}) {
          const MidiFile midi = read(wrapper + file);
          INFO(kind.what << ", " << count << " of " << told << " tracks, behind "
                         << wrapper.size());
          const std::size_t first = count == 2 ? 2 : 0;
          check(midi, first, 0.5, {0x90, 60, 100});
          REQUIRE(midi.messages.size() == first + 2);
          CHECK(midi.messages.back().time_s == 1.0);  // a key left down is released at the end
          const bool has_warning = kind.warning[0] != 0;
          const std::size_t wrapped = wrapper.size() == 128 ? 1 : 0;
          REQUIRE(midi.warnings.size() ==
                  wrapped + (has_warning ? 1U : 0U) + (told == count ? 0U : 1U));
          CHECK((wrapped == 0 || midi.warnings[0].starts_with("byte 0: ignored 128 bytes")));
          CHECK((!has_warning || contains(midi.warnings[wrapped], kind.warning)));
          CHECK((told == count || contains(midi.warnings.back(), "the header says 5 tracks")));
          ++files;
        }
      }
    }
  }
  CHECK(files == 96);
  const Bytes first = track(note + end);
  const MidiFile list = read(header(2, 2, 96) + first + track(Bytes{0, 0x92, 1, 1} + end));
  CHECK(list.messages.size() == 2);
  CHECK(list.warnings == std::vector<std::string>{
                             "byte 8: type 2, a list of sequences: only the first one is played"});
}

TEST_CASE("A track may end without an end-of-track event", "[midi_file]") {
  CHECK(read(header(0, 1, 96) + track({0, 0xc0, 5})).messages.size() == 1);
  CHECK(read(header(0, 1, 96) + track({})).messages.empty());
}

TEST_CASE("The extension of a MIDI file may be in any case", "[midi_file]") {
  CHECK(is_midi_file_name("a/song.mid"));
  CHECK(is_midi_file_name("SONG.MIDI"));
  CHECK(is_midi_file_name("song.rmi"));
  CHECK_FALSE(is_midi_file_name("song.mdl"));
  CHECK_FALSE(is_midi_file_name("mid"));
}

TEST_CASE("A rendered MIDI file starts at its frame and ends in silence", "[midi_file]") {
  const Folder folder;
  // A note at 0.5 s, its end a second later, no pedal.
  const Bytes bytes =
      header(0, 1, 480) + track(Bytes{0x83, 0x60, 0x90, 69, 100, 0x87, 0x40, 0x80, 69, 64} + end);
  const std::string song = folder.write("song.mid", std::string(bytes.begin(), bytes.end()));
  const std::string output = folder.file("song.wav");
  const auto rendered =
      render({.name = "PolyTriangle", .output = output, .rate_hz = 48000.0, .midi = song}, {});
  INFO((rendered ? "" : rendered.error().message));
  REQUIRE(rendered);
  const auto sound = read_sound(output);
  REQUIRE(sound);
  const std::vector<double>& left = sound->channels[0];
  const auto frame =
      std::find_if(left.begin(), left.end(), [](double y) { return y != 0.0; }) - left.begin();
  // The strike is in frame 24000; the wave moves one link per frame towards the output. The limiter
  // is off.
  CHECK(frame >= 24000);
  CHECK(frame < 24010);
  // The file lasts 1.5 s; the decay ends long before the longest tail of a minute.
  CHECK(static_cast<double>(rendered->frames) >= 1.5 * 48000.0);
  CHECK(static_cast<double>(rendered->frames) < 20.0 * 48000.0);
}

}  // namespace ressort::midi_file_test
