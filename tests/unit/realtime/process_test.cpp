// The whole audio thread: events at their frames, and models that change while they sound.
#include <numbers>
#include <set>

#include "tests/support/app/process_harness.h"

namespace ressort::process_test {
namespace {

using namespace support;

double old_gain(std::size_t n) {
  return n < fade_frames ? 1.0 - static_cast<double>(n) / fade_frames : 0.0;
}

}  // namespace

// --- events -------------------------------------------------------------------------------------

TEST_CASE("without a model there is silence", "[process]") {
  Harness harness(true, 2);
  harness.run(1000, 100);
  CHECK(peak(harness.out[0]) == 0.0);
  CHECK(peak(harness.out[1]) == 0.0);
}

TEST_CASE("MIDI acts at its exact frame for any block length", "[process]") {
  const std::uint8_t on[] = {0x90, 69, 127};
  for (const std::size_t block : {64u, 333u, 512u, 2000u}) {
    for (const std::uint32_t frame : {0u, 1u, 33u, 63u}) {
      Harness harness;
      harness.process.slot.offer(sounding(scenes::poly_triangle(), struck(1), 1));
      harness.run(2000, block, {{.frame = frame, .bytes = on}});
      Player player(scenes::poly_triangle(), struck(1), {.method = Method::direct});
      player.run(2000, {note_on(frame, 69)});
      CAPTURE(block, frame);
      CHECK(harness.y() == player.y());
      CHECK(peak(harness.y()) > 0.01);
    }
  }
}

// 24 ticks in a beat: at 150 beats per minute 735 frames of 44.1 kHz from tick to tick.
TEST_CASE("a MIDI clock and JACK's transport set the tempo", "[process]") {
  Harness harness;
  const std::vector<std::uint8_t> tick = {0xf8};
  const auto play_ticks = [&](std::size_t count, double length, double jitter) {
    std::vector<MidiPacket> packets;
    for (std::size_t i = 0; i < count; ++i) {
      const double late = i % 2 == 0 ? 0.0 : jitter;
      packets.push_back({static_cast<std::uint32_t>(length * static_cast<double>(i) + late), tick});
    }
    const auto frames = static_cast<std::size_t>(length * static_cast<double>(count));
    harness.run(frames, frames, packets);
    return harness.process.meters().tempo;
  };
  CHECK(play_ticks(6, 735.0, 0.0) == 0.0);  // too few
  CHECK(play_ticks(30, 735.0, 0.0) == Approx(150.0).epsilon(1e-9));
  // A whole beat later nothing of the old tempo is left; ticks that are late by 64 frames and in
  // time by turns change the mean of 24 of them by at most 64 / (24 * 918.75) = 0.29 %.
  CHECK(play_ticks(48, 918.75, 64.0) == Approx(120.0).epsilon(0.0030));
  harness.run(44100);  // a pause of a second, longer than between two ticks
  CHECK(play_ticks(7, 1837.5, 0.0) == Approx(60.0).epsilon(1e-3));
  harness.process.set_transport({.beats_per_s = 1.5});
  harness.run(256);
  CHECK(harness.process.meters().tempo == 90.0);
  harness.process.set_transport({});  // the transport's master has left
  harness.run(256);
  CHECK(harness.process.meters().tempo == 90.0);
  CHECK(harness.heap_calls == 0);
}

TEST_CASE("an event acts at its frame, and a late event acts at once", "[process]") {
  Harness harness;
  Preset faint;  // a larger drift would look like an unstable voice
  faint.gain = 0x1p-10;
  harness.process.slot.offer(sounding(clock_text, faint, 1));
  harness.at(1717, push());
  harness.run(4000, 100);
  CHECK(pushed_at(harness.y()) == 1717);
  CHECK(harness.process.meters().late == 0);
  harness.out[0].clear();
  // Twice as fast from now on; 90 frames too late.
  harness.at(3910, push());
  harness.run(100, 100);
  CHECK(harness.y()[1] - harness.y()[0] == 2.0 * faint.gain);
  CHECK(harness.process.meters().late == 1);
  CHECK(harness.process.meters().late_s == Approx(90.0 / rate).epsilon(1e-12));
}

TEST_CASE("events with a time have constant latency", "[process]") {
  Random random(5);
  for (int i = 0; i < 50; ++i) {
    Harness harness;
    harness.process.slot.offer(sounding(clock_text, Preset{}, 1));
    harness.run(256 * 4, 256);
    // A key pressed during the last period, read at the start of this one.
    const std::size_t frame = 256 * 3 + random.below(256);
    const auto when = static_cast<std::int64_t>(static_cast<double>(frame) / rate * 1e9);
    harness.process.from_midi.push(
        {.event = push(), .timing = TimedEvent::When::at_time, .when = when});
    harness.run(1024, 256);
    CAPTURE(frame);
    CHECK(pushed_at(harness.y()) == frame + 256);
  }
  // An event from the past acts at the first frame, one from the far future within this block.
  for (const std::int64_t when : {std::int64_t{0}, std::int64_t{1000000000}}) {
    Harness harness;
    harness.process.slot.offer(sounding(clock_text, Preset{}, 1));
    harness.run(1024, 256);
    harness.process.from_midi.push(
        {.event = push(), .timing = TimedEvent::When::at_time, .when = when});
    harness.run(1024, 256);
    CHECK(pushed_at(harness.y()) == (when == 0 ? 1024 : 1279));
  }
}

TEST_CASE("the events of a bundle act in one frame", "[process]") {
  Harness harness;
  harness.process.slot.offer(sounding(clock_text, Preset{}, 1));
  harness.run(256);
  CHECK(harness.now(push(), 3));
  harness.run(256);
  CHECK(pushed_at(harness.y()) == 256);
  CHECK(harness.y()[256] == 3.0);
  CHECK(harness.y()[257] == 6.0);
}

TEST_CASE("events act in order of arrival, and rejected ones are counted", "[process]") {
  Harness harness;
  harness.process.slot.offer(sounding(hand_text, holding(), 1));
  for (const double target : {0.03, 0.04, 0.02}) {
    harness.at(300, parameter(0, 0, target));
  }
  harness.run(1000);
  Report report;
  REQUIRE(harness.process.reports.pop(report));
  CHECK(report.kind == Report::Kind::parameter);
  CHECK(report.model == 1);
  CHECK(report.value == 0.02);
  CHECK_FALSE(harness.process.reports.pop(report));

  for (std::size_t i = 0; i < Process::max_ahead + 10; ++i) {
    CHECK(harness.process.schedule(1000000, push()) == (i < Process::max_ahead));
  }
  CHECK(harness.process.meters().dropped == 10);
}

// --- models that change -------------------------------------------------------------------------

TEST_CASE("two models crossfade linearly over 50 ms", "[process]") {
  for (const std::size_t block : {32u, 441u, 512u, 3000u}) {
    Harness harness;
    harness.process.slot.offer(constant("0.75"));
    harness.run(block, block);
    CHECK(harness.y()[0] == 0.75);  // the first model starts at once
    harness.out[0].clear();
    harness.process.slot.offer(constant("-0.25", 2));
    harness.run(4000, block);
    double worst = 0.0;
    for (std::size_t n = 0; n < 4000; ++n) {
      const double expected = 0.75 * old_gain(n) - 0.25 * (1.0 - old_gain(n));
      worst = std::max(worst, std::fabs(harness.y()[n] - expected));
    }
    INFO("block " << block << ": " << show(worst));
    CHECK(worst < 1e-15);
    CHECK(harness.process.meters().swaps == 2);
  }
}

TEST_CASE("a note from before the swap ends in the old model, a new one starts in the new model",
          "[process]") {
  Harness harness;
  harness.process.slot.offer(sounding(hand_text, holding(), 1));
  harness.now(note_on(0, 60));
  harness.run(10240);  // the position input has reached 1
  harness.out[0].clear();
  harness.process.slot.offer(constant("0.", 2));
  harness.at(10240 + 500, note_off(0, 60));
  harness.at(10240 + 1500, note_on(0, 60));
  harness.run(2000);
  Player player(hand_text, holding());
  player.run(12240, {note_on(0, 60), note_off(10740, 60)});
  double worst = 0.0;
  for (std::size_t n = 0; n < 2000; ++n) {
    worst = std::max(worst, std::fabs(harness.y()[n] - old_gain(n) * player.y()[10240 + n]));
  }
  INFO(show(worst));
  CHECK(worst < 1e-15);
  CHECK(player.y()[12239] < 0.3);  // the key was released
}

TEST_CASE("an event for one model does not act in another", "[process]") {
  Harness harness;
  harness.process.slot.offer(sounding(clock_text, Preset{}, 7));
  harness.now({.kind = EventKind::gesture,
               .gesture = Gesture::force,
               .index = 1,
               .model = 6,
               .value = 1.0});
  harness.run(256);
  CHECK(peak(harness.y()) == 0.0);
  harness.process.slot.offer(sounding(clock_text, Preset{}, 8));
  harness.now({.kind = EventKind::gesture,
               .gesture = Gesture::force,
               .index = 1,
               .model = 7,
               .value = 1.0});
  harness.run(256);
  for (std::size_t n = 0; n < 256; ++n) {  // in the old model, which fades
    CHECK(std::fabs(harness.y()[256 + n] - old_gain(n) * static_cast<double>(n + 1)) < 1e-12);
  }
}

TEST_CASE("a thousand changes of the model under sounding notes make no step", "[process]") {
  const std::string texts[] = {scenes::poly_triangle("0.0005"), ringing_string()};
  // The steps of each model played alone with the same note.
  double own_step = 0.0;
  double own_peak = 0.0;
  for (const std::string& text : texts) {
    Player player(text, struck(2));
    player.run(4 * fade_frames, {note_on(0, 57), note_on(900, 64)});
    own_step = std::max(own_step, largest_step(player.y()));
    own_peak = std::max(own_peak, peak(player.y()));
  }
  // The DC blocker adds its pole's share of a peak.
  const double bound = own_step + 2.0 * own_peak / static_cast<double>(fade_frames) +
                       2.0 * std::numbers::pi * DcBlocker::corner_hz / 44100.0 * own_peak;

  Harness harness;
  std::set<std::uint32_t> returned;  // serials
  int collected = 0;
  double step = 0.0;
  double before = 0.0;
  bool finite = true;
  for (std::uint32_t i = 0; i < 1000; ++i) {
    PlayingEngine* const next = sounding(texts[i % 2], struck(2), i + 1);
    PlayingEngine* const refused = harness.process.slot.offer(next);
    REQUIRE(refused == nullptr);
    const auto start = static_cast<std::int64_t>(harness.played);
    for (const Event& note : {note_on(0, 57), note_on(900, 64)}) {
      harness.process.schedule(start + note.frame, note);
    }
    harness.out[0].clear();
    harness.run(fade_frames + 600, 128 + i % 200);
    for (const double y : harness.y()) {
      step = std::max(step, std::fabs(y - before));
      before = y;
      finite = finite && std::isfinite(y);
    }
    if (PlayingEngine* const old = harness.process.slot.collect()) {
      returned.insert(old->serial);
      ++collected;
      delete old;
    }
  }
  INFO("largest step " << show(step) << " within " << show(bound));
  CHECK(finite);
  CHECK(step <= bound);
  CHECK(step > 0.1 * own_step);  // there was sound
  CHECK(harness.process.meters().swaps == 1000);
  CHECK(collected == 999);
  CHECK(returned.size() == 999);  // each once
  CHECK(harness.heap_calls == 0);
}

TEST_CASE("an early offer waits, and a replaced offer is returned", "[process]") {
  Harness harness;
  PlayingEngine* const first = constant("1.", 1);
  PlayingEngine* const second = constant("2.", 2);
  PlayingEngine* const third = constant("3.", 3);
  PlayingEngine* const fourth = constant("4.", 4);
  harness.process.slot.offer(first);
  harness.run(256);
  CHECK(harness.process.slot.offer(second) == nullptr);
  harness.run(256);
  CHECK(harness.process.slot.offer(third) == nullptr);
  harness.run(256);
  CHECK(harness.process.slot.offer(fourth) == third);
  delete third;
  CHECK(harness.process.slot.collect() == nullptr);
  harness.run(10000);
  CHECK(harness.y().back() == 4.0);
  // There is one place for a returned engine: the second is returned once the first was collected.
  CHECK(harness.process.slot.collect() == first);
  delete first;
  harness.run(256);
  CHECK(harness.process.slot.collect() == second);
  delete second;
}

// --- output -------------------------------------------------------------------------------------

TEST_CASE("the block length does not change the limiter's output", "[process]") {
  Preset loud = struck(4);
  loud.gain = 50.0;
  std::vector<double> expected;
  for (const std::size_t block : {512u, 64u, 100u, 4096u}) {
    Harness harness(true);
    harness.process.slot.offer(sounding(ringing_string(), loud, 1));
    for (std::uint32_t i = 0; i < 20; ++i) {
      harness.process.schedule(i * 777 + 1, note_on(0, 50 + static_cast<int>(i % 12)));
    }
    harness.run(20480, block);
    if (expected.empty()) {
      expected = harness.y();
      CHECK(harness.process.meters().limited < 1.0);  // it was loud enough
    }
    CAPTURE(block);
    CHECK(harness.y() == expected);
    CHECK(peak(harness.y()) <= Limiter::ceiling);
  }
}

TEST_CASE("one output plays on every channel, and too many are folded", "[process]") {
  Harness harness(false, 2);
  harness.process.slot.offer(constant("0.5"));
  harness.run(10);
  CHECK(harness.out[0][9] == 0.5);
  CHECK(harness.out[1][9] == 0.5);
  Harness folded(false, 2);
  folded.process.slot.offer(
      sounding("@a ground 1.\n@b ground 2.\n@c ground 4.\n@out1 posOutput "
               "@a\n@out2 posOutput @b\n@out3 posOutput @c\n",
               Preset{}, 1));
  folded.run(10);
  CHECK(folded.out[0][9] == 5.0);
  CHECK(folded.out[1][9] == 2.0);
}

TEST_CASE("single and double precision buffers have the same content", "[process]") {
  Harness harness;
  Process process(rate, false);
  harness.process.slot.offer(sounding(ringing_string(), struck(1), 1));
  process.slot.offer(sounding(ringing_string(), struck(1), 1));
  harness.process.schedule(3, note_on(0, 60));
  process.schedule(3, note_on(0, 60));
  harness.run(512);
  std::vector<float> left(512);
  float* const outputs[] = {left.data()};
  process.block(std::span<const float* const>(), outputs, 512, {}, 0);
  for (std::size_t n = 0; n < 512; ++n) {
    CHECK(left[n] == static_cast<float>(harness.y()[n]));
  }
}

TEST_CASE("a recording equals the output; a reset is reported once", "[process]") {
  Harness harness(false, 2);
  harness.process.slot.offer(sounding(ringing_string(), struck(1), 1));
  harness.process.is_recording.raise();
  harness.process.schedule(3, note_on(0, 60));
  harness.run(2000, 333);
  std::vector<float> heard;
  RecordedChunk chunk;
  while (harness.process.recording.pop(chunk)) {
    CHECK(chunk.channels == 2);
    heard.insert(heard.end(), chunk.samples.begin(), chunk.samples.begin() + 2 * chunk.frames);
  }
  REQUIRE(heard.size() == 4000);
  for (std::size_t n = 0; n < 2000; ++n) {
    CHECK(heard[2 * n] == static_cast<float>(harness.y()[n]));
  }
  harness.process.schedule(2000, push(1e12));
  harness.run(1000);
  Report report;
  REQUIRE(harness.process.reports.pop(report));
  CHECK(report.kind == Report::Kind::reset);
  CHECK_FALSE(harness.process.reports.pop(report));
  CHECK(harness.process.meters().resets == 1);
}

}  // namespace ressort::process_test
