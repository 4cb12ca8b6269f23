// Reads every MIDI message, and every malformed one.
#include "app/realtime/midi.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "app/realtime/midi_chart.h"
#include "app/realtime/song_clock.h"
#include "core/engine/midi/channels.h"
#include "tests/support/harness.h"

namespace ressort::midi_test {
namespace {

using Bytes = std::vector<std::uint8_t>;

std::vector<Event> read(MidiReader& reader, const Bytes& bytes) {
  std::vector<Event> events;
  reader.read(bytes, [&](const Event& event) { events.push_back(event); });
  return events;
}
std::vector<Event> read(const Bytes& bytes) {
  MidiReader reader;
  return read(reader, bytes);
}

void check_event(const Event& event, EventKind kind, int channel, int index, double value) {
  CHECK(event.kind == kind);
  CHECK(event.channel == channel);
  CHECK(event.index == index);
  CHECK(event.value == Approx(value).margin(1e-15));
  CHECK(event.model == 0);
}

}  // namespace

TEST_CASE("every channel message becomes an event", "[midi]") {
  const auto events = read({0x93, 60,  127,  0x83, 61,   64, 0xa0, 62,   1,  0xbf,
                            1,    127, 0xd2, 127,  0xe1, 0,  64,   0x90, 63, 0});
  REQUIRE(events.size() == 7);
  check_event(events[0], EventKind::note_on, 3, 60, 1.0);
  check_event(events[1], EventKind::note_off, 3, 61, 64 / 127.0);
  check_event(events[2], EventKind::key_pressure, 0, 62, 1 / 127.0);
  check_event(events[3], EventKind::controller, 15, 1, 1.0);
  check_event(events[4], EventKind::pressure, 2, 0, 1.0);
  check_event(events[5], EventKind::bend, 1, 0, 0.0);
  check_event(events[6], EventKind::note_off, 0, 63,
              usual_release_velocity);  // a note on with velocity 0 is a note off
}

// Keyboards without a release sensor send 0, or 64, in every note off.
TEST_CASE("a release velocity of 0 counts once the channel has sent another", "[midi]") {
  MidiReader reader;
  const auto released = [&](std::uint8_t channel, std::uint8_t velocity) {
    return read(reader, {static_cast<std::uint8_t>(0x80 | channel), 60, velocity}).at(0).value;
  };
  CHECK(released(0, 0) == usual_release_velocity);
  CHECK(released(0, 64) == 64 / 127.0);
  CHECK(released(0, 0) == usual_release_velocity);
  CHECK(released(0, 1) == 1 / 127.0);
  CHECK(released(0, 0) == 0.0);
  CHECK(released(1, 0) == usual_release_velocity);
  CHECK(read({0x90, 60, 0}).at(0).value == usual_release_velocity);
  CHECK(read({0x80, 60, 0}).at(0).value == usual_release_velocity);  // another source
}

TEST_CASE("the bend reaches -1 and 1 exactly", "[midi]") {
  CHECK(read({0xe0, 0, 0})[0].value == -1.0);
  CHECK(read({0xe0, 0x7f, 0x7f})[0].value == 1.0);
  CHECK(read({0xe0, 0, 0x40})[0].value == 0.0);
  CHECK(read({0xe0, 1, 0x40})[0].value == 1.0 / 8191.0);
  CHECK(read({0xe0, 0x7f, 0x3f})[0].value == -1.0 / 8192.0);
}

TEST_CASE("running status works within a packet and across packets", "[midi]") {
  MidiReader reader;
  auto events = read(reader, {0x90, 60, 100, 61, 100, 62, 0});
  REQUIRE(events.size() == 3);
  check_event(events[1], EventKind::note_on, 0, 61, 100 / 127.0);
  check_event(events[2], EventKind::note_off, 0, 62, usual_release_velocity);
  events = read(reader, {63, 100});
  REQUIRE(events.size() == 1);
  check_event(events[0], EventKind::note_on, 0, 63, 100 / 127.0);
  // Clocks do not end running status; system common messages do.
  CHECK(read(reader, {0xf8, 0xfe}).size() == 1);
  CHECK(read(reader, {64, 100}).size() == 1);
  CHECK(read(reader, {0xf1, 7}).empty());
  CHECK(reader.malformed() == 0);
  CHECK(read(reader, {65, 100}).empty());
  CHECK(reader.malformed() > 0);
}

TEST_CASE("real-time bytes may appear anywhere", "[midi]") {
  MidiReader reader;
  const auto events = read(reader, {0xf8, 0x90, 0xfe, 60, 0xf8, 0xff, 100, 0xfa, 0xfb, 0xfc, 0xfd});
  REQUIRE(events.size() == 6);
  check_event(events[0], EventKind::clock, 0, 0, 0.0);
  check_event(events[1], EventKind::clock, 0, 0, 0.0);
  check_event(events[2], EventKind::note_on, 0, 60, 100 / 127.0);
  for (const ClockMessage message :
       {ClockMessage::start, ClockMessage::resume, ClockMessage::stop}) {
    const auto index = static_cast<std::uint16_t>(message);
    check_event(events[2 + index], EventKind::clock, 0, index, 0.0);
  }
  // A song position is a number of sixteenth notes with 14 bits, the low half first.
  check_event(read(reader, {0xf2, 5, 3}).at(0), EventKind::clock, 0,
              static_cast<std::uint16_t>(ClockMessage::song_position), 389.0);
  CHECK(reader.malformed() == 0);
}

TEST_CASE("unknown system exclusive messages are ignored, in one packet or several", "[midi]") {
  MidiReader reader;
  auto events = read(reader, {0xf0, 0x7e, 60, 100, 1, 0xf7, 0x90, 60, 100});
  CHECK(events.size() == 1);
  CHECK(read(reader, {0xf0, 1, 2, 3}).empty());
  CHECK(read(reader, {60, 100, 60, 0xf8, 100}).size() == 1);
  CHECK(read(reader, {4, 0xf7}).empty());
  CHECK(read(reader, {0x91, 60, 100}).size() == 1);
  CHECK(reader.malformed() == 0);
  // A status byte ends the exclusive message; the truncated message is counted.
  CHECK(read(reader, {0xf0, 1, 2, 0x90, 60, 100}).size() == 1);
}

namespace {

// Frequency in Hz by the standard: a semitone of equal temperament and a fraction of 1/16384.
double tuned_hz(int semitone, int fraction) {
  return 440.0 * std::pow(2.0, (semitone - 69.0 + fraction / 16384.0) / 12.0);
}

Bytes dump_of_all_keys(bool has_bank = false) {
  Bytes bytes = {0x7e, 0x7f, 0x08, 0x01, 0};
  if (has_bank) {
    bytes = {0x7e, 0x7f, 0x08, 0x04, 2, 0};
  }
  bytes.insert(bytes.end(), 16, 'x');
  for (int key = 0; key < 128; ++key) {
    const bool stays = key == 61;
    bytes.insert(bytes.end(), {static_cast<std::uint8_t>(stays ? 0x7f : key),
                               static_cast<std::uint8_t>(stays ? 0x7f : 64),
                               static_cast<std::uint8_t>(stays ? 0x7f : 3)});
  }
  std::uint8_t sum = 0;
  for (const std::uint8_t byte : bytes) {
    sum ^= byte;
  }
  bytes.push_back(sum);
  bytes.insert(bytes.begin(), 0xf0);
  bytes.push_back(0xf7);
  return bytes;
}

}  // namespace

TEST_CASE("tuning messages are read, in one packet or several", "[midi]") {
  const Bytes change = {0xf0, 0x7f, 0x10, 0x08, 0x02, 5,  3,    60,   60,   64,
                        0,    61,   0x7f, 0x7f, 0x7f, 62, 0x7f, 0x7f, 0x7e, 0xf7};
  for (const std::size_t cut : {std::size_t{1}, std::size_t{7}, change.size()}) {
    MidiReader reader;
    std::vector<Event> events;
    for (std::size_t at = 0; at < change.size(); at += cut) {
      const auto begin = change.begin() + static_cast<std::ptrdiff_t>(at);
      const auto count = static_cast<std::ptrdiff_t>(std::min(cut, change.size() - at));
      for (const Event& event : read(reader, Bytes(begin, begin + count))) {
        events.push_back(event);
      }
      read(reader, {0xf8});
    }
    REQUIRE(events.size() == 2);  // all ones: no change
    check_event(events[0], EventKind::key_tuning, 0, 60, tuned_hz(60, 8192));
    check_event(events[1], EventKind::key_tuning, 0, 62, tuned_hz(127, 16382));
    CHECK(events[0].value2 == 1.0);
    CHECK(reader.malformed() == 0);
  }
  MidiReader reader;
  for (const bool has_bank : {false, true}) {
    const auto dump = read(reader, dump_of_all_keys(has_bank));
    REQUIRE(dump.size() == 127);
    check_event(dump[60], EventKind::key_tuning, 0, 60, tuned_hz(60, 64 * 128 + 3));
    check_event(dump[61], EventKind::key_tuning, 0, 62, tuned_hz(62, 64 * 128 + 3));
    CHECK(dump[60].value2 == 0.0);
  }
  for (const std::uint8_t kind :
       Bytes{0x7e, 0x7f}) {  // for new notes only, or for sounding notes too
    const auto one = read(reader, {0xf0, kind, 0, 8, 7, 1, 2, 1, 60, 61, 64, 0, 0xf7});
    REQUIRE(one.size() == 1);
    check_event(one[0], EventKind::key_tuning, 0, 60, tuned_hz(61, 8192));
    CHECK(one[0].value2 == (kind == 0x7f ? 1.0 : 0.0));
  }
  CHECK(reader.malformed() == 0);
}

TEST_CASE("a truncated, overlong or damaged tuning message is rejected", "[midi]") {
  Bytes altered = dump_of_all_keys();
  altered[100] ^= 1;
  Bytes altered_bank = dump_of_all_keys(true);
  altered_bank[100] ^= 1;
  Bytes shorter = dump_of_all_keys();
  shorter.erase(shorter.begin() + 50);
  Bytes longer = dump_of_all_keys();
  longer.insert(longer.end() - 1, 5000, 1);
  const std::vector<Bytes> wrong = {altered,
                                    altered_bank,
                                    shorter,
                                    longer,
                                    {0xf0, 0x7f, 0, 8, 2, 0, 2, 60, 60, 0, 0, 0xf7},
                                    {0xf0, 0x7f, 0, 8, 2, 0, 0, 60, 60, 0, 0, 0xf7}};
  for (const Bytes& bytes : wrong) {
    MidiReader reader;
    CHECK(read(reader, bytes).empty());
    CHECK(reader.malformed() == 1);
    CHECK(read(reader, {0x90, 60, 100}).size() == 1);
  }
  // Ended by another status byte, or an unknown kind of any length.
  MidiReader reader;
  CHECK(read(reader, {0xf0, 0x7f, 0, 8, 2, 0, 1, 60, 60, 0, 0, 0x90, 60, 100}).size() == 1);
  Bytes unknown(100'000, 0x11);
  unknown.front() = 0xf0;
  unknown.back() = 0xf7;
  CHECK(read(reader, unknown).empty());
  CHECK(reader.malformed() == 0);
}

TEST_CASE("truncated and unknown messages make no event and are counted", "[midi]") {
  const std::vector<Bytes> wrong = {{0x90}, {0x90, 60}, {60},   {0xf4},
                                    {0xf5}, {0xe0, 1},  {0xd0}, {0xf2, 1}};
  for (const Bytes& bytes : wrong) {
    MidiReader reader;
    CAPTURE(bytes);
    CHECK(read(reader, bytes).empty());
    CHECK(reader.malformed() == 1);
    // The next message is read normally.
    CHECK(read(reader, {0x90, 60, 100}).size() == 1);
    CHECK(reader.malformed() == 1);
  }
  MidiReader reader;
  CHECK(read(reader, {0x90, 60, 0x90, 61, 100}).size() == 1);
  CHECK(reader.malformed() == 1);
  check_event(read(reader, {0xc3, 5}).at(0), EventKind::program, 3, 5, 0.0);
  CHECK(read(reader, {0xf6}).empty());
  CHECK(reader.malformed() == 1);
}

TEST_CASE("the chart has every controller with a fixed meaning", "[midi]") {
  const auto state = [](const Channels& channels) {
    return std::vector<double>{channels.level(0),
                               channels.balance(0)[0],
                               channels.softness(0),
                               channels.glide_s(0, 1.0),
                               channels.sustains(0) ? 1.0 : 0.0,
                               channels.latches(0) ? 1.0 : 0.0,
                               channels.is_legato(0) ? 1.0 : 0.0,
                               channels.semitones(0)};
  };
  int found = 0;
  for (int number = 0; number < 120; ++number) {
    Channels channels;
    channels.bend(0, 1.0);
    channels.turn(0, 101, 0.0);  // bend range, for data entry
    channels.turn(0, 100, 0.0);
    const auto before = state(channels);
    channels.turn(0, number, 0.6);
    if (state(channels) == before) {
      continue;
    }
    ++found;
    CAPTURE(number);
    CHECK(std::any_of(midi_chart().begin(), midi_chart().end(), [&](const MidiChartRow& row) {
      const std::string words = " " + std::string(row.number) + ",";
      return row.is_received && row.number.starts_with("CC") &&
             words.find(" " + std::to_string(number) + ",") != words.npos;
    }));
  }
  CHECK(found >= 11);
}

TEST_CASE("random bytes in random packets make only valid events", "[midi]") {
  support::Random random(99);
  MidiReader reader;
  std::size_t count = 0;
  for (std::size_t at = 0; at < 100000;) {
    Bytes bytes(random.below(12));
    for (std::uint8_t& byte : bytes) {
      byte = static_cast<std::uint8_t>(random.next());
    }
    at += bytes.size();
    for (const Event& event : read(reader, bytes)) {
      ++count;
      const bool is_bend = event.kind == EventKind::bend;
      const bool is_known =
          event.kind == EventKind::note_on || event.kind == EventKind::note_off ||
          event.kind == EventKind::controller || event.kind == EventKind::pressure ||
          event.kind == EventKind::key_pressure || event.kind == EventKind::program ||
          event.kind == EventKind::clock || is_bend;
      REQUIRE(is_known);
      REQUIRE(event.index <= 127);
      REQUIRE(event.channel <= 15);
      REQUIRE(event.value >= (is_bend ? -1.0 : 0.0));
      REQUIRE(event.value <= (event.kind == EventKind::clock ? 16383.0 : 1.0));
      REQUIRE((event.kind != EventKind::note_on || event.value > 0.0));
    }
  }
  CHECK(count > 1000);
  CHECK(reader.malformed() > 1000);
  CHECK(read(reader, {0xf7, 0x90, 60, 100}).size() == 1);
}

TEST_CASE("an octave tuning sets twelve deviations in cents for all keys", "[midi]") {
  Bytes one = {0xf0, 0x7f, 0x7f, 0x08, 0x08, 0x03, 0x7f, 0x7f};
  Bytes two = {0xf0, 0x7e, 0x7f, 0x08, 0x09, 0x03, 0x7f, 0x7f};
  for (int step = 0; step < 12; ++step) {
    one.push_back(static_cast<std::uint8_t>(64 - 5 * step));  // C unchanged, C# 5 cents flat
    two.push_back(static_cast<std::uint8_t>(64 + step));      // 100/64 cents each
    two.push_back(64);                                        // half of it
  }
  one.push_back(0xf7);
  two.push_back(0xf7);
  const auto of_one = read(one);
  const auto of_two = read(two);
  REQUIRE((of_one.size() == 128 && of_two.size() == 128));
  for (int key = 0; key < 128; ++key) {
    CAPTURE(key);
    const auto cents = [&](const Event& event) {
      CHECK((event.kind == EventKind::key_tuning && event.index == key));
      return 1200.0 * std::log2(event.value / 440.0) - 100.0 * (key - 69);
    };
    const Event& now = of_one[static_cast<std::size_t>(key)];
    const Event& later = of_two[static_cast<std::size_t>(key)];
    CHECK(cents(now) == Approx(-5.0 * (key % 12)).margin(1e-9));
    CHECK(cents(later) == Approx(100.0 / 64.0 * (key % 12 + 0.5)).margin(1e-9));
    CHECK((now.value2 == 1.0 && later.value2 == 0.0));
  }
  for (Bytes* const whole : {&one, &two}) {
    MidiReader reader;
    Bytes less(*whole);
    less.erase(less.end() - 2);
    CHECK(read(reader, less).empty());
    CHECK(reader.malformed() == 1);
    Bytes more(*whole);
    more.insert(more.end() - 1, 0);
    CHECK(read(reader, more).empty());
    CHECK(reader.malformed() == 2);
  }
}

}  // namespace ressort::midi_test
