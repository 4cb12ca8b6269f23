// The place in a song by a MIDI clock and by JACK's transport.
#include "app/realtime/song_clock.h"
#include "tests/support/catch.h"
#include "tests/support/rooms.h"

namespace ressort::song_clock_test {
namespace {

using namespace realtime;

struct Clock {
  SongClock song;
  std::int64_t frame = 0;

  void send(ClockMessage message, double value = 0.0) {
    const bool is_tick = song.follow(
        {.kind = EventKind::clock, .index = static_cast<std::uint16_t>(message), .value = value},
        frame);
    CHECK(is_tick == (message == ClockMessage::tick));
  }
  void tick(int count) {
    for (int i = 0; i < count; ++i) {
      send(ClockMessage::tick);
      frame += 1000;
    }
  }
};

}  // namespace

// The first tick after a start is the beginning of the song, and 24 ticks are a beat.
TEST_CASE("a MIDI clock starts, stops, continues and jumps", "[song_clock]") {
  Clock clock;
  clock.tick(10);
  CHECK(clock.song.place().jumps == 0);  // it runs without a song
  clock.send(ClockMessage::start);
  CHECK_FALSE(clock.song.place().rolls);
  clock.tick(1);
  CHECK(clock.song.place().rolls);
  CHECK(clock.song.place().in_beats);
  CHECK(clock.song.place().position == 0.0);
  CHECK(clock.song.place().frame == 10000);
  clock.tick(36);
  CHECK(clock.song.place().position == 1.5);
  CHECK(clock.song.place().frame == 46000);
  CHECK(clock.song.place().jumps == 1);
  clock.send(ClockMessage::stop);
  CHECK_FALSE(clock.song.place().rolls);
  CHECK(clock.song.place().jumps == 2);
  clock.tick(5);
  clock.send(ClockMessage::resume);
  clock.tick(1);
  CHECK(clock.song.place().rolls);
  CHECK(clock.song.place().position == 1.5);
  clock.send(ClockMessage::stop);
  clock.send(ClockMessage::song_position, 22.0);  // sixteenths: 5.5 beats
  CHECK(clock.song.place().position == 5.5);
  CHECK_FALSE(clock.song.place().rolls);
  clock.send(ClockMessage::resume);
  clock.tick(13);
  CHECK(clock.song.place().position == 6.0);
  const std::uint64_t jumps = clock.song.place().jumps;
  clock.send(ClockMessage::song_position, 4.0);  // while it rolls, as for a loop
  clock.tick(1);
  CHECK(clock.song.place().position == 1.0);
  CHECK(clock.song.place().rolls);
  CHECK(clock.song.place().jumps == jumps + 1);
}

TEST_CASE("JACK's transport starts, stops and is located", "[song_clock]") {
  SongClock song;
  const double block_s = 0.01;
  double position = 0.0;
  std::int64_t frame = 0;
  const auto blocks = [&](int count, bool rolls, double beats_per_s = 0.0) {
    for (int i = 0; i < count; ++i, frame += 480) {
      song.follow({.beats_per_s = beats_per_s,
                   .rolls = rolls,
                   .in_beats = beats_per_s > 0.0,
                   .position = position},
                  frame, block_s);
      position += rolls ? block_s * (beats_per_s > 0.0 ? beats_per_s : 1.0) : 0.0;
    }
    return song.place();
  };
  CHECK(blocks(3, false).jumps == 0);
  CHECK(blocks(100, true).jumps == 1);
  CHECK(song.place().rolls);
  CHECK_FALSE(song.place().in_beats);
  CHECK(song.place().position == Approx(0.99));
  CHECK(song.place().frame == 102 * 480);
  position = 30.0;
  CHECK(blocks(10, true).jumps == 2);
  CHECK(song.place().position == Approx(30.09));
  CHECK(blocks(10, false).jumps == 3);
  position = 12.0;  // located while it stands
  CHECK(blocks(10, false).jumps == 4);
  CHECK(song.place().position == 12.0);
  CHECK(blocks(10, true, 2.5).jumps == 5);
  CHECK(song.place().in_beats);
  CHECK(song.place().position == Approx(12.0 + 9 * 0.025));
}

TEST_CASE("the clock or the transport that has moved last leads", "[song_clock]") {
  Clock clock;
  const Transport stopped;
  clock.song.follow(stopped, 0, 0.01);
  clock.send(ClockMessage::start);
  clock.tick(25);
  clock.song.follow(stopped, 0, 0.01);  // a transport that stands still leads nobody
  CHECK(clock.song.place().position == 1.0);
  clock.song.follow({.rolls = true, .position = 7.0}, 99, 0.01);
  CHECK(clock.song.place().position == 7.0);
  clock.tick(24);  // the clock goes on, and does not lead
  CHECK(clock.song.place().position == 7.0);
  clock.send(ClockMessage::stop);
  CHECK_FALSE(clock.song.place().rolls);
}

}  // namespace ressort::song_clock_test
