// MPE 1.0: zones, and notes with a channel of their own.
#include "core/engine/keyboard.h"
#include "core/engine/midi/channels.h"
#include "tests/support/pitch.h"
#include "tests/support/player.h"

namespace ressort::mpe_test {
namespace {

using namespace support;

Event on(int channel, Event event) {
  event.channel = static_cast<std::uint8_t>(channel);
  return event;
}
Event turned(int channel, std::uint32_t frame, int number, int value) {
  return on(channel, controller(frame, number, value / 127.0));
}
Event bend(int channel, std::uint32_t frame, double value) {
  return on(channel, {.frame = frame, .kind = EventKind::bend, .value = value});
}
Event pressed(int channel, std::uint32_t frame, double value) {
  return on(channel, {.frame = frame, .kind = EventKind::pressure, .value = value});
}
Event key_pressed(int channel, std::uint32_t frame, int key, double value) {
  return on(channel, {.frame = frame,
                      .kind = EventKind::key_pressure,
                      .index = static_cast<std::uint16_t>(key),
                      .value = value});
}

// Prepends the MPE configuration message.
std::vector<Event> zone(int master, int members, std::vector<Event> then = {}) {
  std::vector<Event> events = {turned(master, 0, 101, 0), turned(master, 0, 100, 6),
                               turned(master, 0, 6, members)};
  events.insert(events.end(), then.begin(), then.end());
  return events;
}
void make_zone(Channels& channels, int master, int members) {
  for (const Event& event : zone(master, members)) {
    channels.turn(event.channel, event.index, event.value);
  }
}

// Two inputs. Outputs 1 and 2 are their positions, summed over all awake voices.
const std::string hands =
    "@m mass 1. 0. 0.\n@g ground 0.\n@r springDamper @m @g 0.01 0.00001\n@in1 posInput 0.\n"
    "@in2 posInput 0.\n@k springDamper @in1 @m 0.001 0.\n@l springDamper @in2 @m 0.001 0.\n"
    "@out1 posOutput @in1\n@out2 posOutput @in2\n";

Preset expressive() {
  Preset preset;
  preset.voices = 6;
  preset.controls.push_back({.source = ControlSource::pressure, .target = "in1"});
  preset.controls.push_back({.source = ControlSource::controller, .number = 74, .target = "in2"});
  return preset;
}

// Returns the last samples of both outputs. The initial voice without a key sleeps before the
// events.
std::vector<double> ends(const std::vector<Event>& events) {
  Player player(hands, expressive());
  player.run(40000);
  player.run(30000, events);
  CHECK(player.heap_calls == 0);
  return {player.out[0].back(), player.out[1].back()};
}

std::vector<double> heard(const std::vector<Event>& events,
                          const std::vector<std::size_t>& blocks = {256}) {
  // The direct form rounds the same at any block size.
  Player player(ringing_string(), struck(6), {.method = Method::direct});
  player.run(20000, events, blocks);
  CHECK(player.heap_calls == 0);
  return player.y();
}

double apart(const std::vector<double>& a, const std::vector<double>& b, std::size_t from = 0) {
  double most = 0.0;
  for (std::size_t n = from; n < a.size(); ++n) {
    most = std::max(most, std::fabs(a[n] - b[n]));
  }
  return most;
}

std::size_t first_difference(const std::vector<double>& a, const std::vector<double>& b) {
  std::size_t n = 0;
  while (n < a.size() && a[n] == b[n]) {
    ++n;
  }
  return n;
}

}  // namespace

TEST_CASE("a zone has its members, and the newer of two overlapping zones gets the channels",
          "[mpe]") {
  Channels channels;
  const auto reach = [&](std::uint8_t c) { return channels.reach(c) & midi_channels; };
  const auto masters = [&] {
    std::vector<int> all;
    for (std::uint8_t c = 0; c < 16; ++c) {
      all.push_back(channels.master_of(c));
    }
    return all;
  };
  make_zone(channels, 0, 5);
  make_zone(channels, 15, 3);
  CHECK(masters() == std::vector<int>{0, 0, 0, 0, 0, 0, 6, 7, 8, 9, 10, 11, 15, 15, 15, 15});
  CHECK(reach(0) == 0x003f);
  CHECK(reach(15) == 0xf000);
  CHECK(reach(3) == 0x0008);
  CHECK(reach(8) == 0x0100);
  make_zone(channels, 15, 12);  // leaves two members to the lower zone
  CHECK(reach(0) == 0x0007);
  CHECK(reach(15) == 0xfff8);
  make_zone(channels, 0, 14);  // leaves none
  CHECK(reach(0) == 0x7fff);
  CHECK(reach(15) == 0x8000);
  make_zone(channels, 0, 15);
  CHECK(reach(0) == 0xffff);
  make_zone(channels, 0, 127);
  CHECK(reach(0) == 0xffff);
  make_zone(channels, 15, 15);
  CHECK(reach(15) == 0xffff);
  CHECK(reach(0) == 0x0001);
  make_zone(channels, 7, 3);  // not a master channel
  CHECK(reach(15) == 0xffff);
  CHECK(reach(7) == 0x0080);
  make_zone(channels, 15, 0);
  for (std::uint8_t c = 0; c < 16; ++c) {
    CHECK(reach(c) == 1U << c);
  }
}

TEST_CASE("bends add up to 48 semitones of the member and 2 of the master", "[mpe]") {
  Channels channels;
  make_zone(channels, 0, 7);
  channels.bend(1, 0.5);
  channels.bend(0, -1.0);
  CHECK(channels.semitones(1) == 24.0);
  CHECK(channels.zone_semitones(1) == -2.0);
  CHECK(channels.zone_semitones(0) == 0.0);
  CHECK(channels.zone_semitones(9) == 0.0);
  // A bend range sent to one member applies to all members; one sent to the master applies to
  // itself.
  channels.turn(3, 101, 0.0);
  channels.turn(3, 100, 0.0);
  channels.turn(3, 6, 24.0 / 127.0);
  CHECK(channels.semitones(1) == 12.0);
  CHECK(channels.semitones(0) == -2.0);
  // Without the zone it is an ordinary channel again.
  make_zone(channels, 0, 0);
  channels.bend(1, 1.0);
  CHECK(channels.semitones(1) == 2.0);
  CHECK(channels.zone_semitones(1) == 0.0);
}

TEST_CASE("a member's bend moves its own note alone, at the exact frame", "[mpe]") {
  const auto a = on(1, note_on(10, 60));
  const auto b = on(2, note_on(20, 64));
  const std::vector<double> both = heard(zone(0, 15, {a, b}));
  const std::vector<double> only_a = heard(zone(0, 15, {a}));
  std::optional<std::size_t> late;
  for (const std::uint32_t frame : {5000U, 5001U, 5063U, 7777U}) {
    const std::vector<double> bent = heard(zone(0, 15, {a, b, bend(2, frame, 0.1)}));
    const std::vector<double> bent_b = heard(zone(0, 15, {b, bend(2, frame, 0.1)}));
    const std::size_t first = first_difference(bent, both);
    // The change is one sample of the force law, at any frame and block size.
    CHECK(first - frame == late.value_or(first - frame));
    late = first - frame;
    CHECK(*late <= 2);
    CHECK(apart(bent, both) > 1e-3);
    double worst = 0.0;
    for (std::size_t n = 0; n < bent.size(); ++n) {
      worst = std::max(worst, std::fabs(bent[n] - only_a[n] - bent_b[n]));
    }
    CHECK(worst < 1e-12);
    CHECK(first_difference(heard(zone(0, 15, {a, b, bend(2, frame, 0.1)}), {64, 17, 512}), both) ==
          first);
  }
  // A master bend moves both notes. A member bend before the note applies from its start.
  const auto later = heard(zone(0, 15, {a, b, bend(0, 5000, 1.0)}));
  const auto alone = heard(zone(0, 15, {a, bend(0, 5000, 1.0)}));
  CHECK(apart(later, both, 5000) > 1e-3);
  CHECK(apart(alone, only_a, 5000) > 1e-3);
  CHECK(apart(heard(zone(0, 15, {bend(1, 0, 1.0 / 48.0), a})),
              heard(zone(0, 15, {on(1, note_on(10, 61))}))) < 1e-9);
}

TEST_CASE("pressure and slide move the inputs of their own note at the exact frame", "[mpe]") {
  const auto two = [](std::vector<Event> then) {
    std::vector<Event> events = {on(1, note_on(0, 60)), on(2, note_on(0, 64))};
    events.insert(events.end(), then.begin(), then.end());
    return zone(0, 15, events);
  };
  CHECK(ends(two({})) == std::vector<double>{0.0, 0.0});
  const auto near = [](double value) { return Approx(value).margin(1e-9); };
  CHECK(ends(two({pressed(1, 500, 0.5)}))[0] == near(0.5));
  CHECK(ends(two({pressed(1, 500, 0.5), pressed(2, 600, 0.25)}))[0] == near(0.75));
  CHECK(ends(two({turned(2, 500, 74, 127)}))[1] == near(1.0));
  CHECK(ends(two({turned(2, 500, 74, 127)}))[0] == near(0.0));
  CHECK(ends(two({turned(3, 500, 74, 127)}))[1] == near(0.0));
  CHECK(ends(two({turned(0, 500, 74, 127)}))[1] == near(2.0));  // the master's, for both
  CHECK(ends(two({pressed(0, 500, 1.0)}))[0] == near(2.0));
  // Key pressure applies to one key, and to none if no voice plays it.
  CHECK(ends(two({key_pressed(1, 500, 60, 1.0)}))[0] == near(1.0));
  CHECK(ends(two({key_pressed(1, 500, 64, 1.0)}))[0] == near(0.0));
  CHECK(ends(two({key_pressed(0, 500, 64, 1.0)}))[0] == near(1.0));
  // A slide before the note sets its initial position.
  Player player(hands, expressive());
  player.run(2000, zone(0, 15, {turned(1, 0, 74, 127), on(1, note_on(1000, 60))}));
  CHECK(player.out[1][1001] == Approx(1.0));

  for (const std::uint32_t frame : {700U, 701U, 767U}) {
    for (const std::vector<std::size_t>& blocks :
         {std::vector<std::size_t>{256}, std::vector<std::size_t>{1, 90, 33}}) {
      Player moved(hands, expressive());
      moved.run(2000, two({pressed(1, frame, 1.0), turned(2, frame + 1, 74, 127)}), blocks);
      const auto first = [&](std::size_t channel) {
        const auto& y = moved.out[channel];
        return std::find_if(y.begin(), y.end(), [](double v) { return v != 0.0; }) - y.begin();
      };
      CHECK(first(0) == static_cast<std::ptrdiff_t>(frame));
      CHECK(first(1) == static_cast<std::ptrdiff_t>(frame + 1));
    }
  }
}

TEST_CASE("without a zone pressure stays on its own channel and key", "[mpe]") {
  const std::vector<Event> notes = {on(4, note_on(0, 60)), on(4, note_on(0, 64)),
                                    on(5, note_on(0, 67))};
  const auto with = [&](const Event& event) {
    std::vector<Event> events = notes;
    events.push_back(event);
    return ends(events)[0];
  };
  CHECK(with(pressed(4, 500, 1.0)) == Approx(2.0));
  CHECK(with(pressed(5, 500, 1.0)) == Approx(1.0));
  CHECK(with(pressed(6, 500, 1.0)) == Approx(0.0).margin(1e-9));
  CHECK(with(key_pressed(4, 500, 64, 1.0)) == Approx(1.0));
  CHECK(with(key_pressed(5, 500, 64, 1.0)) == Approx(0.0).margin(1e-9));
}

TEST_CASE("a released note keeps the bend of its channel", "[mpe]") {
  const auto a = on(1, note_on(0, 60));
  const auto up = on(1, note_off(3000, 60));
  const std::vector<double> plain = heard(zone(0, 15, {a, up}));
  CHECK(apart(heard(zone(0, 15, {a, up, bend(1, 5000, 0.5)})), plain) == 0.0);
  CHECK(apart(heard(zone(0, 15, {a, bend(1, 2999, 0.5), up})), plain) > 1e-3);
  // The next note on the channel is bent, but the first keeps its pitch. The master still bends it.
  const auto b = on(1, note_on(5000, 64));
  const auto two = heard(zone(0, 15, {a, up, b, bend(1, 6000, 0.5)}));
  const auto only_b = heard(zone(0, 15, {b, bend(1, 6000, 0.5)}));
  double worst = 0.0;
  for (std::size_t n = 0; n < two.size(); ++n) {
    worst = std::max(worst, std::fabs(two[n] - plain[n] - only_b[n]));
  }
  CHECK(worst < 1e-12);
  CHECK(apart(heard(zone(0, 15, {a, up, bend(0, 5000, 1.0)})), plain) > 1e-3);
  // On ordinary channels a ringing note is bent, as on every synthesizer.
  CHECK(apart(heard({on(1, note_on(0, 60)), up, bend(1, 5000, 0.5)}), heard({a, up})) > 1e-3);
  // The same applies to inputs.
  CHECK(ends(zone(0, 15, {a, pressed(1, 100, 1.0), up, pressed(1, 5000, 0.0)}))[0] == Approx(1.0));
}

TEST_CASE("pedals and modes on a member channel are ignored", "[mpe]") {
  const auto heard = [](std::vector<Event> events) {
    Preset preset = struck(4);
    preset.damper_s = 0.05;
    Player player(ringing_string(), preset);
    player.run(20000, events);
    return player.y();
  };
  const auto a = on(1, note_on(100, 60));
  const auto up = on(1, note_off(8000, 60));
  const auto held = heard(zone(0, 15, {a}));
  const auto plain = heard(zone(0, 15, {a, up}));
  CHECK(plain != held);
  for (const int number : {120, 121, 123, 124, 126, 127}) {
    INFO(number);
    CHECK(heard(zone(0, 15, {a, turned(1, 3000, number, 0)})) == held);
  }
  for (const int pedal : {64, 66}) {
    INFO(pedal);
    CHECK(heard(zone(0, 15, {a, turned(1, 3000, pedal, 127), up})) == plain);
    CHECK(heard(zone(0, 15, {a, turned(0, 3000, pedal, 127), up})) == held);
    // Outside of a zone the channel has its own pedals.
    CHECK(heard({a, turned(1, 3000, pedal, 127), up}) == heard({a}));
  }
  CHECK(heard(zone(0, 15, {a, turned(0, 3000, 120, 0)})) != held);
  CHECK(heard(zone(0, 15, {a, turned(0, 3000, 123, 0)})) != held);
}

TEST_CASE("the master's pedals, levels and modes apply to the whole zone", "[mpe]") {
  Playing playing;
  playing.tuning = Tuning::keyboard;
  playing.voices = 4;
  Keyboard keyboard(playing, 44100.0, 2);
  for (const Event& event : zone(0, 3)) {
    keyboard.turn_controller(event.channel, event.index, event.value);
  }
  constexpr double highest = 1e9;
  keyboard.press_key(60, 1.0, 1, highest);
  keyboard.press_key(62, 1.0, 2, highest);
  keyboard.press_key(64, 1.0, 9, highest);
  keyboard.turn_controller(0, 64, 1.0);
  CHECK(keyboard.press_key(65, 1.0, 1, highest) == Press::starts);
  int held = 0;
  for (Voice& voice : keyboard.voices) {
    const bool ends =
        voice.held && keyboard.release_key(voice, voice.key, voice.channel, usual_release_velocity);
    CHECK((!voice.has_key || ends == (voice.channel == 9)));
    held += voice.sustained ? 1 : 0;
  }
  CHECK(held == 3);
  keyboard.turn_controller(0, 64, 0.0);
  for (const Voice& voice : keyboard.voices) {
    CHECK(keyboard.is_released_by_pedal(voice, 0) == voice.sustained);
  }
  Channels channels;
  make_zone(channels, 0, 3);
  channels.turn(0, 7, 50.0 / 127.0);
  channels.turn(0, 67, 1.0);
  channels.turn(0, 66, 1.0);
  CHECK(channels.level(2) == Approx(0.25));
  CHECK(channels.level(4) == Approx(1.0));
  CHECK(channels.softness(2) == Approx(0.75));
  CHECK((channels.latches(3) && !channels.latches(4)));
  // Modes affect the whole zone and nothing else.
  const std::vector<Event> notes = {on(1, note_on(0, 60)), on(2, note_on(0, 64)),
                                    on(9, note_on(0, 67))};
  for (const int mode : {120, 123}) {
    std::vector<Event> events = notes;
    events.push_back(turned(0, 3000, mode, 0));
    Preset preset = struck(4);
    preset.damper_s = 0.01;
    Player player(ringing_string(), preset);
    player.run(20000, zone(0, 3, events));
    Player other(ringing_string(), preset);
    other.run(20000, {notes[2]});
    CAPTURE(mode);
    CHECK(apart(player.y(), other.y(), 4200) < 1e-12);
    CHECK(apart(player.y(), other.y()) > 1e-3);
  }
}

TEST_CASE("a new zone releases the notes of its channels and no others", "[mpe]") {
  Preset preset = struck(4);
  preset.damper_s = 0.01;
  const auto other = on(9, note_on(0, 67));
  std::vector<Event> events = {on(1, note_on(0, 60)), turned(1, 0, 64, 127), turned(1, 0, 66, 127),
                               other};
  for (Event event : zone(0, 4)) {
    event.frame = 3000;
    events.push_back(event);
  }
  Player player(ringing_string(), preset);
  player.run(20000, events);
  Player alone(ringing_string(), preset);
  alone.run(20000, {other});
  CHECK(apart(player.y(), alone.y(), 4200) < 1e-12);
  CHECK(apart(player.y(), alone.y()) > 1e-3);
}

TEST_CASE("a note with an ID is bent, pressed and ended alone, and follows its instrument",
          "[mpe]") {
  const int first = note_channel(1);
  const int second = note_channel(2);
  // It behaves like a member of an MPE zone, to the sample.
  const auto member = zone(0, 7, {on(1, note_on(100, 60)), bend(1, 4000, 0.125)});
  CHECK(heard({on(first, note_on(100, 60)), bend(first, 4000, 0.125)}) == heard(member));
  const auto both = [&](std::vector<Event> then) {
    std::vector<Event> events = {on(first, note_on(0, 60)), on(second, note_on(0, 67))};
    events.insert(events.end(), then.begin(), then.end());
    return ends(events);
  };
  CHECK(both({})[0] == Approx(0.0).margin(1e-9));
  CHECK(both({pressed(first, 100, 0.5)})[0] == Approx(0.5));
  CHECK(both({pressed(second, 100, 0.25), pressed(first, 100, 0.5)})[0] == Approx(0.75));
  CHECK(both({turned(second, 100, 74, 127)})[1] == Approx(1.0));
  // The instrument's channel applies to all notes.
  CHECK(both({pressed(0, 100, 0.5)})[0] == Approx(1.0));
  CHECK(heard({on(first, note_on(0, 60)), turned(0, 3000, 7, 0)}) ==
        heard({note_on(0, 60), turned(0, 3000, 7, 0)}));
  // The other note keeps playing.
  CHECK(heard({on(first, note_on(0, 60)), turned(second, 3000, 123, 0)}) ==
        heard({on(first, note_on(0, 60))}));
  // Zone messages do not affect notes with an ID.
  Channels channels;
  make_zone(channels, 0, 15);
  channels.bend(static_cast<std::uint8_t>(first), 0.25);
  channels.turn(3, 101, 0.0);
  channels.turn(3, 100, 0.0);
  channels.turn(3, 6, 12.0 / 127.0);
  CHECK(channels.semitones(static_cast<std::uint8_t>(first)) == 12.0);
}

TEST_CASE("a note keeps its own frequency when its key is retuned", "[mpe]") {
  constexpr double rate_hz = 44100.0;
  Preset preset = struck(2);
  preset.transpose = -12;
  for (const double hz : {100.0, 261.3, 777.7}) {
    Event note = on(note_channel(3), note_on(0, 60));
    note.value2 = hz;
    Player player(ringing_string(), preset);
    player.run(
        60000,
        {note,
         {.frame = 9000, .kind = EventKind::key_tuning, .index = 60, .value = 300.0, .value2 = 1.0},
         {.frame = 9500, .kind = EventKind::tuning_reset}});
    const double found =
        measured_hz(std::span<const double>(player.y()).subspan(10000), rate_hz, hz);
    CAPTURE(hz);
    CHECK(1200.0 * std::log2(found / hz) == Approx(0.0).margin(0.02));
  }
}

}  // namespace ressort::mpe_test
