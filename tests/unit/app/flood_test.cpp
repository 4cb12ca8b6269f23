// More events than anybody can play, and a future that is full: what is to be heard is heard in the
// next block, what is refused is counted, and a block's work is bounded.
#include "app/devices/midi_input.h"
#include "tests/support/process_rig.h"

namespace ressort {

using namespace rig;

namespace {

constexpr std::size_t period = 256;
constexpr std::size_t flood = 581;         // of a period, at 100 000 a second
constexpr std::int64_t far = 432000;       // 9.8 s
constexpr std::size_t steal_frames = 221;  // the fade of a panic, 5 ms

// What drifts far would else be taken for a voice that lost its stability.
Preset faint() {
  Preset preset;
  preset.gain = 0x1p-20;
  return preset;
}

// Everything but what starts or ends sound.
void pour(Stage& stage, std::size_t count = flood) {
  for (std::size_t i = 0; i < count; ++i) {
    const double way = static_cast<double>(i % 100) / 100.0;
    const Event events[] = {{.kind = EventKind::bend, .value = way},
                            {.kind = EventKind::pressure, .value = way},
                            parameter(0, 0, 0.005 + 0.01 * way),
                            controller(0, 1, way)};
    stage.now(events[i % 4]);
  }
}

void fill_future(Stage& stage) {
  while (stage.at(far, note_on(0, 70), 512)) {
  }
}

// Its hand is at 1 while a key is held; it sounds at full from the second block on.
struct Held : Stage {
  Held() {
    process.slot.offer(sounding(hand_text, holding(), 1));
    now(note_on(0, 60));
    run(64 * period, period);
  }
};

}  // namespace

TEST_CASE("a bundle that finds no room ahead is refused whole", "[flood]") {
  Stage stage;
  stage.process.slot.offer(sounding(clock_text, faint(), 1));
  CHECK(stage.at(1000, push(), 3000));
  CHECK_FALSE(stage.at(500, push(), Process::max_ahead - 3000 + 1));
  CHECK(stage.process.meters().dropped == Process::max_ahead - 3000 + 1);
  CHECK(stage.at(2000, push(), Process::max_ahead - 3000));
  CHECK_FALSE(stage.at(2000, push()));
  stage.run(1001, 77);
  CHECK(pushed_at(stage.y()) == 1000);  // nothing of the refused one acted
  CHECK(stage.y()[1000] == 3000.0 * faint().gain);
  // What has acted leaves its room to others; what waits keeps its own.
  CHECK_FALSE(stage.at(3000, push(), 3001));
  CHECK(stage.at(3000, push(), 3000));
}

TEST_CASE("no future silences what is to act now", "[flood]") {
  Stage stage;
  stage.process.slot.offer(sounding(ringing_string(), struck(4), 1));
  fill_future(stage);
  stage.run(period);
  for (std::size_t i = 0; i < 3; ++i) {
    fill_future(stage);
    stage.out[0].clear();
    const std::uint8_t on[] = {0x90, 60, 100};
    const bool is_midi = i == 0;
    if (!is_midi) {
      const TimedEvent note{.event = note_on(0, 60)};
      CHECK(stage.process.send(i == 1 ? stage.process.from_osc : stage.process.from_console,
                               {&note, 1}));
    }
    stage.run(period, period,
              is_midi ? std::vector<MidiPacket>{{0, on}} : std::vector<MidiPacket>{});
    CHECK(peak(stage.y()) > 1e-4);
    // And panic within the next one.
    stage.now({.kind = EventKind::panic});
    stage.run(2 * period);
    CHECK(peak(std::span(stage.y()).subspan(period + steal_frames)) == 0.0);
  }
}

TEST_CASE("panic forgets what waits for its time, and nothing that comes after it", "[flood]") {
  for (const bool is_controller : {false, true}) {
    Stage stage;
    stage.process.slot.offer(sounding(clock_text, faint(), 1));
    CHECK(stage.at(1000, push(), Process::max_ahead));
    stage.run(period);
    const std::uint8_t all_sound_off[] = {0xb0, 120, 0};
    if (is_controller) {
      stage.run(period, period, {{0, all_sound_off}});
    } else {
      stage.now({.kind = EventKind::panic});
      CHECK(stage.at(2000, push()) == false);  // still full
      stage.run(period);
    }
    CHECK(stage.at(2000, push(), Process::max_ahead));  // all of its room is free again
    stage.run(2000);
    CHECK(pushed_at(stage.y()) == 2000);
  }
  // In one block: a bundle, panic, another bundle.
  Stage stage;
  stage.process.slot.offer(sounding(clock_text, faint(), 1));
  stage.at(500, push());
  stage.now({.kind = EventKind::panic});
  stage.at(600, push());
  stage.run(1000);
  CHECK(pushed_at(stage.y()) == 600);
  // One with a time of its own forgets what would come after it, once it is there.
  stage.at(3000, push());
  stage.at(2000, {.kind = EventKind::panic});
  stage.at(1500, push());
  stage.out[0].clear();
  stage.run(2500);
  CHECK(stage.y()[500] > stage.y()[499] + 1.5 * (stage.y()[499] - stage.y()[498]));
  CHECK(peak(std::span(stage.y()).subspan(1000 + steal_frames)) == 0.0);
}

TEST_CASE("note-offs and panic act in the next block of a flood, with the future full", "[flood]") {
  for (const bool is_panic : {false, true}) {
    Held stage;
    fill_future(stage);
    for (int i = 0; i < 20; ++i) {
      pour(stage);
      stage.run(period);
    }
    const double before = stage.y().back();
    stage.out[0].clear();
    CHECK(before == Approx(1.0).epsilon(1e-3));
    pour(stage);
    stage.now(is_panic ? Event{.kind = EventKind::panic} : note_off(0, 60));
    pour(stage);
    stage.run(period);
    CHECK(stage.y()[0] < before);  // from its first frame on
    if (is_panic) {
      CHECK(peak(std::span(stage.y()).subspan(steal_frames)) == 0.0);
    }
    CHECK(stage.process.meters().dropped == 512);  // the last try to fill the future
  }
}

TEST_CASE("where no other event finds room, what ends sound does", "[flood]") {
  for (const Event& ending : {note_off(0, 60), Event{.kind = EventKind::panic},
                              controller(0, 120, 0.0), controller(0, 123, 0.0)}) {
    Held stage;
    stage.out[0].clear();
    std::size_t sent = 0;
    while (stage.now(parameter(0, 0, 0.02))) {
      REQUIRE(++sent < 100000);
    }
    CHECK(sent >= Process::max_now);
    CHECK(stage.process.meters().dropped == 1);
    CHECK(stage.now(ending));
    CHECK_FALSE(stage.now(parameter(0, 0, 0.02)));
    stage.run(period);
    CHECK(stage.y()[0] < 1.0 - 1e-4);
  }
}

TEST_CASE("every event of a flood of MIDI that finds no room is counted", "[flood]") {
  const std::vector<std::uint8_t> on = {0x90, 60, 100};
  const std::vector<std::uint8_t> off = {0x80, 60, 0};
  {
    Held stage;
    stage.out[0].clear();
    std::vector<MidiPacket> packets(Process::max_now + 700, MidiPacket{0, on});
    packets.push_back({0, off});
    stage.run(period, period, packets);
    CHECK(stage.process.meters().dropped == 700);
    CHECK(stage.y()[1] < 1.0);
  }
  Held stage;
  stage.out[0].clear();
  MidiDoor door(stage.process);
  MidiReader reader;
  for (std::size_t i = 0; i < Process::max_now + 700; ++i) {
    door.arrive(reader, on, 0);
  }
  door.arrive(reader, off, 0);
  CHECK(stage.process.meters().dropped == 700);
  stage.run(period);
  CHECK(stage.y()[1] < 1.0);
}

TEST_CASE("a block acts at a bounded number of moments, early but in order", "[flood]") {
  // A push on every frame: the first of them exactly, the others with the last of these.
  for (const auto& [block, moments] : {std::pair<std::size_t, std::size_t>{64, 16}, {256, 32}}) {
    Stage stage;
    stage.process.slot.offer(sounding(clock_text, faint(), 1));
    std::vector<Event> expected;
    for (std::uint32_t n = 0; n < block; ++n) {
      stage.at(n, push());
      expected.push_back(push());
      expected.back().frame = std::min(n, static_cast<std::uint32_t>(moments - 1));
    }
    stage.run(2 * block, block);
    Player player(clock_text, faint(), {.method = Method::direct});
    player.run(2 * block, expected, {block});
    CAPTURE(block);
    CHECK(stage.y() == player.y());
  }
}

TEST_CASE("offline every event acts on its own frame, however many there are", "[flood]") {
  Stage stage;
  stage.process.slot.offer(sounding(clock_text, faint(), 1));
  std::vector<Event> events;
  for (std::uint32_t n = 0; n < period; ++n) {
    stage.process.schedule(n, push());
    events.push_back(push());
    events.back().frame = n;
  }
  stage.run(2 * period);
  Player player(clock_text, faint(), {.method = Method::direct});
  player.run(2 * period, events);
  CHECK(stage.y() == player.y());
}

TEST_CASE("what acts in one sample is computed once, from what all of it leaves", "[flood]") {
  // A voice that starts with a turn of a parameter has it from its start on: no ramp is heard.
  const std::string text = scenes::poly_triangle();
  Player after(text, struck(1), {.method = Method::direct});
  after.run(2000, {note_on(0, 69), parameter(0, 0, 0.15), parameter(0, 0, 0.12)});
  Player before(text, struck(1), {.method = Method::direct});
  before.run(2000, {parameter(0, 0, 0.12), note_on(0, 69)});
  CHECK(after.y() == before.y());
  CHECK(peak(after.y()) > 0.001);
}

TEST_CASE("the audio thread allocates nothing in a flood", "[flood]") {
  Held stage;
  for (int i = 0; i < 4; ++i) {
    fill_future(stage);
    pour(stage, 6000);
    stage.now({.kind = EventKind::panic});
    stage.run(period);
  }
  CHECK(stage.heap_calls == 0);
}

}  // namespace ressort
