// More events than can be played, with a full queue of future events: audible events act in the
// next block, rejected ones are counted, and the work of a block is bounded.
#include "app/devices/midi_input.h"
#include "tests/support/app/process_harness.h"

namespace ressort::flood_test {

using namespace support;

namespace {

constexpr std::size_t period = 256;
constexpr std::size_t flood = 581;         // events of a period, at 100,000 a second
constexpr std::int64_t far = 432000;       // 9.8 s
constexpr std::size_t steal_frames = 221;  // the fade of a panic, 5 ms

// A larger drift would look like an unstable voice.
Preset faint() {
  Preset preset;
  preset.gain = 0x1p-20;
  return preset;
}

// Sends all kinds of events that neither start nor end sound.
void pour(Harness& harness, std::size_t count = flood) {
  for (std::size_t i = 0; i < count; ++i) {
    const double way = static_cast<double>(i % 100) / 100.0;
    const Event events[] = {{.kind = EventKind::bend, .value = way},
                            {.kind = EventKind::pressure, .value = way},
                            parameter(0, 0, 0.005 + 0.01 * way),
                            controller(0, 1, way)};
    harness.now(events[i % 4]);
  }
}

void fill_future(Harness& harness) {
  while (harness.at(far, note_on(0, 70), 512)) {
  }
}

// The position input is at 1 while a key is held; the note sounds at full level from the second
// block on.
struct Held : Harness {
  Held() {
    process.slot.offer(sounding(hand_text, holding(), 1));
    now(note_on(0, 60));
    run(64 * period, period);
  }
};

}  // namespace

TEST_CASE("a bundle that does not fit into the future queue is rejected as a whole", "[flood]") {
  Harness harness;
  harness.process.slot.offer(sounding(clock_text, faint(), 1));
  CHECK(harness.at(1000, push(), 3000));
  CHECK_FALSE(harness.at(500, push(), Process::max_ahead - 3000 + 1));
  CHECK(harness.process.meters().dropped == Process::max_ahead - 3000 + 1);
  CHECK(harness.at(2000, push(), Process::max_ahead - 3000));
  CHECK_FALSE(harness.at(2000, push()));
  harness.run(1001, 77);
  CHECK(pushed_at(harness.y()) == 1000);  // no event of the rejected bundle acted
  CHECK(harness.y()[1000] == 3000.0 * faint().gain);
  // Acted events free their places; waiting ones keep theirs.
  CHECK_FALSE(harness.at(3000, push(), 3001));
  CHECK(harness.at(3000, push(), 3000));
}

TEST_CASE("a full future queue does not block immediate events", "[flood]") {
  Harness harness;
  harness.process.slot.offer(sounding(ringing_string(), struck(4), 1));
  fill_future(harness);
  harness.run(period);
  for (std::size_t i = 0; i < 3; ++i) {
    fill_future(harness);
    harness.out[0].clear();
    const std::uint8_t on[] = {0x90, 60, 100};
    const bool is_midi = i == 0;
    if (!is_midi) {
      const TimedEvent note{.event = note_on(0, 60)};
      CHECK(harness.process.send(i == 1 ? harness.process.from_osc : harness.process.from_console,
                                 {&note, 1}));
    }
    harness.run(period, period,
                is_midi ? std::vector<MidiPacket>{{0, on}} : std::vector<MidiPacket>{});
    CHECK(peak(harness.y()) > 1e-4);
    // Panic acts within the next block.
    harness.now({.kind = EventKind::panic});
    harness.run(2 * period);
    CHECK(peak(std::span(harness.y()).subspan(period + steal_frames)) == 0.0);
  }
}

TEST_CASE("panic discards waiting events, but no later ones", "[flood]") {
  for (const bool is_controller : {false, true}) {
    Harness harness;
    harness.process.slot.offer(sounding(clock_text, faint(), 1));
    CHECK(harness.at(1000, push(), Process::max_ahead));
    harness.run(period);
    const std::uint8_t all_sound_off[] = {0xb0, 120, 0};
    if (is_controller) {
      harness.run(period, period, {{0, all_sound_off}});
    } else {
      harness.now({.kind = EventKind::panic});
      CHECK(harness.at(2000, push()) == false);  // still full
      harness.run(period);
    }
    CHECK(harness.at(2000, push(), Process::max_ahead));  // all places are free again
    harness.run(2000);
    CHECK(pushed_at(harness.y()) == 2000);
  }
  // Three events in one block: a bundle, panic, another bundle.
  Harness harness;
  harness.process.slot.offer(sounding(clock_text, faint(), 1));
  harness.at(500, push());
  harness.now({.kind = EventKind::panic});
  harness.at(600, push());
  harness.run(1000);
  CHECK(pushed_at(harness.y()) == 600);
  // A panic with a time discards later events when it acts.
  harness.at(3000, push());
  harness.at(2000, {.kind = EventKind::panic});
  harness.at(1500, push());
  harness.out[0].clear();
  harness.run(2500);
  CHECK(harness.y()[500] > harness.y()[499] + 1.5 * (harness.y()[499] - harness.y()[498]));
  CHECK(peak(std::span(harness.y()).subspan(1000 + steal_frames)) == 0.0);
}

TEST_CASE("note-offs and panic act in the next block of a flood with a full future queue",
          "[flood]") {
  for (const bool is_panic : {false, true}) {
    Held harness;
    fill_future(harness);
    for (int i = 0; i < 20; ++i) {
      pour(harness);
      harness.run(period);
    }
    const double before = harness.y().back();
    harness.out[0].clear();
    CHECK(before == Approx(1.0).epsilon(1e-3));
    pour(harness);
    harness.now(is_panic ? Event{.kind = EventKind::panic} : note_off(0, 60));
    pour(harness);
    harness.run(period);
    CHECK(harness.y()[0] < before);  // from its first frame on
    if (is_panic) {
      CHECK(peak(std::span(harness.y()).subspan(steal_frames)) == 0.0);
    }
    CHECK(harness.process.meters().dropped == 512);  // the last attempt to fill the future queue
  }
}

TEST_CASE("events that end sound have room when no other event has", "[flood]") {
  for (const Event& ending : {note_off(0, 60), Event{.kind = EventKind::panic},
                              controller(0, 120, 0.0), controller(0, 123, 0.0)}) {
    Held harness;
    harness.out[0].clear();
    std::size_t sent = 0;
    while (harness.now(parameter(0, 0, 0.02))) {
      REQUIRE(++sent < 100000);
    }
    CHECK(sent >= Process::max_now);
    CHECK(harness.process.meters().dropped == 1);
    CHECK(harness.now(ending));
    CHECK_FALSE(harness.now(parameter(0, 0, 0.02)));
    harness.run(period);
    CHECK(harness.y()[0] < 1.0 - 1e-4);
  }
}

TEST_CASE("every rejected event of a MIDI flood is counted", "[flood]") {
  const std::vector<std::uint8_t> on = {0x90, 60, 100};
  const std::vector<std::uint8_t> off = {0x80, 60, 0};
  {
    Held harness;
    harness.out[0].clear();
    std::vector<MidiPacket> packets(Process::max_now + 700, MidiPacket{0, on});
    packets.push_back({0, off});
    harness.run(period, period, packets);
    CHECK(harness.process.meters().dropped == 700);
    CHECK(harness.y()[1] < 1.0);
  }
  Held harness;
  harness.out[0].clear();
  MidiSink door(harness.process);
  MidiReader reader;
  for (std::size_t i = 0; i < Process::max_now + 700; ++i) {
    door.arrive(reader, on, 0);
  }
  door.arrive(reader, off, 0);
  CHECK(harness.process.meters().dropped == 700);
  harness.run(period);
  CHECK(harness.y()[1] < 1.0);
}

TEST_CASE("a block has a bounded number of cuts, and surplus events act early but in order",
          "[flood]") {
  // An event on every frame: the first ones exactly, the others at the last cut.
  for (const auto& [block, moments] : {std::pair<std::size_t, std::size_t>{64, 16}, {256, 32}}) {
    Harness harness;
    harness.process.slot.offer(sounding(clock_text, faint(), 1));
    std::vector<Event> expected;
    for (std::uint32_t n = 0; n < block; ++n) {
      harness.at(n, push());
      expected.push_back(push());
      expected.back().frame = std::min(n, static_cast<std::uint32_t>(moments - 1));
    }
    harness.run(2 * block, block);
    Player player(clock_text, faint(), {.method = Method::direct});
    player.run(2 * block, expected, {block});
    CAPTURE(block);
    CHECK(harness.y() == player.y());
  }
}

TEST_CASE("offline every event acts at its own frame", "[flood]") {
  Harness harness;
  harness.process.slot.offer(sounding(clock_text, faint(), 1));
  std::vector<Event> events;
  for (std::uint32_t n = 0; n < period; ++n) {
    harness.process.schedule(n, push());
    events.push_back(push());
    events.back().frame = n;
  }
  harness.run(2 * period);
  Player player(clock_text, faint(), {.method = Method::direct});
  player.run(2 * period, events);
  CHECK(harness.y() == player.y());
}

TEST_CASE("events at one sample are applied together", "[flood]") {
  // A voice that starts together with a parameter change has the new value from the start, without
  // a ramp.
  const std::string text = scenes::poly_triangle();
  Player after(text, struck(1), {.method = Method::direct});
  after.run(2000, {note_on(0, 69), parameter(0, 0, 0.15), parameter(0, 0, 0.12)});
  Player before(text, struck(1), {.method = Method::direct});
  before.run(2000, {parameter(0, 0, 0.12), note_on(0, 69)});
  CHECK(after.y() == before.y());
  CHECK(peak(after.y()) > 0.001);
}

TEST_CASE("the audio thread does not allocate in a flood", "[flood]") {
  Held harness;
  for (int i = 0; i < 4; ++i) {
    fill_future(harness);
    pour(harness, 6000);
    harness.now({.kind = EventKind::panic});
    harness.run(period);
  }
  CHECK(harness.heap_calls == 0);
}

}  // namespace ressort::flood_test
