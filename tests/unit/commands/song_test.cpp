// A MIDI file that is paused, moved, slowed down and repeated while it plays.
#include "app/commands/smf/midi_player.h"
#include "tests/support/app/console_harness.h"

namespace ressort::song_test {
namespace {

// Keys 60, 61 and 62 at these seconds, each for a tenth of a second; controller 74 before the last.
MidiFile three_notes(std::array<double, 3> times_s) {
  MidiFile file;
  const auto add = [&](double time_s, std::array<std::uint8_t, 3> bytes) {
    file.messages.push_back({time_s, static_cast<std::uint32_t>(file.bytes.size()), 3});
    file.bytes.insert(file.bytes.end(), bytes.begin(), bytes.end());
  };
  for (std::uint8_t i = 0; i < 3; ++i) {
    if (i == 2) {
      add(times_s[i] - 0.001, {0xb0, 74, 127});
    }
    add(times_s[i], {0x90, static_cast<std::uint8_t>(60 + i), 100});
    add(times_s[i] + 0.1, {0x80, static_cast<std::uint8_t>(60 + i), 0});
  }
  file.length_s = times_s[2] + 0.1;
  return file;
}

struct Stage {
  Harness harness;
  MidiSink door{harness.process};
  MidiPlayer player;

  explicit Stage(std::array<double, 3> times_s)
      : player(begun(harness.session.song(), three_notes(times_s)), door, harness.session.song()) {}
  static MidiFile begun(Song& song, MidiFile file) {
    song.begin(file.length_s, {}, false);
    return file;
  }

  // Plays until this is true, for at most 20 s.
  template <class True>
  bool plays_until(True&& is_true) {
    for (int i = 0; i < 20000 && !is_true(); ++i) {
      harness.play();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return is_true();
  }
  std::uint64_t notes() { return harness.process.meters().notes; }
  int last_key() { return harness.process.meters().last_notes[(notes() - 1) % 4].key; }
};

}  // namespace

TEST_CASE("a song is moved and paused", "[song]") {
  Stage stage({0.0, 100.0, 200.0});
  Harness& h = stage.harness;
  REQUIRE(stage.plays_until([&] { return stage.notes() == 1; }));
  CHECK(has(h.say("song play 100"), "playing at 100.0 of 200.1 s, tempo 100 %"));
  REQUIRE(stage.plays_until([&] { return stage.notes() == 2; }));
  CHECK(stage.last_key() == 61);
  CHECK(has(h.say("song pause"), "paused at 100."));
  CHECK(has(h.say("song play 200"), "playing at 200.0"));
  REQUIRE(stage.plays_until([&] { return h.session.song().is_over(); }));
  REQUIRE(stage.plays_until([&] { return stage.notes() == 3; }));
  CHECK(stage.last_key() == 62);
  CHECK(has(h.say("song play"), "playing at 0.0"));  // It was over.
  REQUIRE(stage.plays_until([&] { return stage.notes() == 4; }));
  CHECK(stage.last_key() == 60);
}

TEST_CASE("a song is repeated at another tempo", "[song]") {
  Stage stage({0.0, 0.2, 100.0});
  Harness& h = stage.harness;
  CHECK(has(h.say("song tempo 1000"), "tempo 1000 %"));
  CHECK(has(h.say("song loop 0.15 0.4"), "loop from 0.15 to 0.4 s"));
  // Without the loop there are three notes.
  REQUIRE(stage.plays_until([&] { return stage.notes() >= 8; }));
  CHECK(stage.last_key() == 61);
  h.say("song loop");
  CHECK(has(h.say("song play 99.9"), "tempo 1000 %"));
  REQUIRE(stage.plays_until([&] { return h.session.song().is_over(); }));
}

// The position of a song is its tempo times the time that has passed.
TEST_CASE("a song's position follows its tempo", "[song]") {
  Song::State state{.plays = true, .at_s = 10.0, .tempo = 2.0};
  const auto later = state.at + std::chrono::seconds(3);
  CHECK(state.position_s(later) == Approx(16.0).margin(1e-9));
  CHECK(state.time_of(16.0) == later);
  state.plays = false;
  CHECK(state.position_s(later) == 10.0);
}

// A file of 120 beats a minute plays at a quarter more of its speed by a clock of 150.
TEST_CASE("a song follows a clock", "[song]") {
  Stage stage({0.0, 100.0, 200.0});
  Song& song = stage.harness.session.song();
  const ClockReading reading{.rate_hz = 48000.0};
  Meters none;
  Meters faster;
  faster.tempo = 150.0;
  song.clock(faster, reading);
  CHECK(song.state().tempo == 1.0);
  CHECK(has(stage.harness.say("song tempo clock"), "by the clock"));
  song.clock(none, reading);
  CHECK(song.state().tempo == 1.0);
  song.clock(faster, reading);
  CHECK(song.state().tempo == Approx(1.25).epsilon(1e-12));
  stage.harness.say("song tempo 80");
  song.clock(faster, reading);
  CHECK(song.state().tempo == Approx(0.8).epsilon(1e-12));
}

// The clock starts in beat 6. By a file that has four beats of half a second and then beats of a
// second, that is at 4 s. What is due there must be sent a period of 480 frames before.
TEST_CASE("a song starts, jumps and stops with a clock", "[song]") {
  Song song;
  song.begin(100.0, {{{0.0, 0.0, 120.0}, {4.0, 2.0, 60.0}}}, true);
  REQUIRE(song.follow_clock());
  const ClockReading reading{
      .frame = 9600, .time_ns = 5'000'000'000, .rate_hz = 48000.0, .period = 480};
  Meters now;
  now.tempo = 60.0;
  now.song = {.rolls = false, .in_beats = true, .position = 50.0, .jumps = 7};
  song.clock(now, reading);  // a stop before anyone followed
  CHECK(song.state().at_s == 0.0);
  const std::uint64_t jumps = song.state().jumps;
  now.song = {.rolls = true, .in_beats = true, .position = 6.0, .frame = 9600, .jumps = 8};
  song.clock(now, reading);
  const Song::State started = song.state();
  CHECK(started.plays);
  CHECK(started.jumps == jumps + 1);
  CHECK(started.at_s == Approx(4.0).epsilon(1e-12));
  CHECK(started.at.time_since_epoch() == std::chrono::milliseconds(4990));
  CHECK(started.tempo == Approx(1.0).epsilon(1e-12));
  // A tick that is 20 ms late corrects the position without a jump, one in time changes nothing.
  now.song.position = 7.0;
  now.song.frame = 9600 + 48000 + 960;
  song.clock(now, reading);
  CHECK(song.state().jumps == started.jumps);
  CHECK(song.state().time_of(6.0) - started.time_of(6.0) == std::chrono::milliseconds(20));
  const std::uint64_t changes = song.state().changes;
  now.song.position = 8.0;
  now.song.frame += 48000;
  song.clock(now, reading);
  CHECK(song.state().changes == changes);
  // A command of the player ends the lead of the clock until it starts again.
  REQUIRE(song.play(50.0));
  song.clock(now, reading);
  CHECK(song.state().at_s == Approx(50.0));
  now.song = {.rolls = false, .in_beats = false, .position = 12.5, .frame = 9600, .jumps = 9};
  song.clock(now, reading);
  CHECK_FALSE(song.state().plays);
  CHECK(song.state().at_s == 12.5);
}

TEST_CASE("a wrong command of a song is an error", "[song]") {
  Harness h;
  CHECK(has(h.say("song play"), "no MIDI file was given"));
  Stage stage({0.0, 100.0, 200.0});
  const std::pair<const char*, const char*> wrong[] = {
      {"song stop", "expected play [SECONDS]"},   {"song tempo", "expected play [SECONDS]"},
      {"song tempo 5", "must lie between 10"},    {"song tempo fast", "expected a number"},
      {"song loop 3", "expected play"},           {"song loop 3 3.001", "at least 0.01 s apart"},
      {"song loop 5 3", "at least 0.01 s apart"}, {"song play -1", "expected the second"},
      {"song play 1 2", "expected play"}};
  for (const auto& [line, message] : wrong) {
    INFO(line);
    CHECK(has(stage.harness.say(line), message));
  }
}

}  // namespace ressort::song_test
