// Program changes, from MIDI bytes to the playing preset.
#include <chrono>
#include <mutex>
#include <thread>

#include "app/session/files.h"
#include "app/session/session.h"
#include "tests/support/app/data_folder.h"
#include "tests/support/app/process_harness.h"

namespace ressort::programs_test {
namespace {

using namespace support;
using namespace std::chrono_literals;

const std::string model_text =
    "@s ground 0.\n@m mass 1. 0. 0.\n@r0 springDamper @s @m 0.01 0.0001\n"
    "@in1 frcInput @m\n@out1 posOutput @m\n";

std::string preset(const std::string& name) {
  return "model = \"m.mdl\"\ndescription = \"" + name +
         "\"\n[[control]]\nfrom = \"note\"\nto = \"in1\"\nhow = \"impulse\"\nrange = [0.0, 0.1]\n";
}

// Plays `frames` with these bytes in the first. Returns the number of heap calls meanwhile.
std::size_t play(support::Harness& harness, std::size_t frames,
                 const std::vector<std::uint8_t>& bytes = {}) {
  std::size_t calls = 0;
  const std::vector<MidiPacket> packets = {{.frame = 0, .bytes = bytes}};
  for (std::size_t at = 0; at < frames; at += 256) {
    auto& y = harness.out[0];
    y.resize(y.size() + 256);
    double* const output = y.data() + y.size() - 256;
    const HeapWatch watch;
    harness.process.block(std::span<const double* const>(), {&output, 1}, 256,
                          {packets.data(), at == 0 ? 1U : 0U}, 0);
    calls += watch.calls();
  }
  return calls;
}

// Returns the reports of program changes.
std::vector<Report> reports_of(const std::vector<std::vector<std::uint8_t>>& packets,
                               unsigned channels = 0xffff) {
  Preset played = struck(1);
  played.channels = channels;
  support::Harness harness;
  harness.process.slot.offer(sounding(ringing_string(), played, 1));
  play(harness, 256);
  for (const auto& bytes : packets) {
    CHECK(play(harness, 256, bytes) == 0);
  }
  std::vector<Report> found;
  Report report;
  while (harness.process.reports.pop(report)) {
    if (report.kind == Report::Kind::program) {
      found.push_back(report);
    }
  }
  return found;
}

}  // namespace

TEST_CASE("program numbers count from the channel's bank", "[programs]") {
  const auto found = reports_of({{0xc0, 5},
                                 {0xb1, 0, 1},
                                 {0xb1, 32, 2},
                                 {0xc1, 3},
                                 {0xc0, 127},
                                 {0xb1, 0, 0, 32, 0},
                                 {0xc1, 0}});
  REQUIRE(found.size() == 4);
  CHECK(found[0].value == 5.0);
  CHECK(found[1].value == 128.0 * 130.0 + 3.0);
  CHECK(found[2].value == 127.0);
  CHECK(found[3].value == 0.0);
  CHECK(reports_of({{0xc4, 5}}, 0x000f).empty());  // a channel that is not received
}

TEST_CASE("channel settings are kept for the next model", "[programs]") {
  const auto loudness = [](const std::vector<std::uint8_t>& bytes) {
    support::Harness harness;
    harness.process.slot.offer(sounding(ringing_string(), struck(2), 1));
    play(harness, 256);
    play(harness, 256, bytes);
    harness.process.slot.offer(sounding(ringing_string(), struck(2), 2));
    CHECK(play(harness, 256 * 20) == 0);
    harness.out[0].clear();
    CHECK(play(harness, 2560, {0x90, 60, 127}) == 0);
    return peak(harness.y());
  };
  const double full = loudness({});
  CHECK(full > 1e-3);
  CHECK(loudness({0xb0, 7, 50}) == Approx(0.25 * full));
  CHECK(loudness({0xb1, 7, 50}) == Approx(full));
}

TEST_CASE("a ringing model is unchanged by a load, and fades at the second one", "[programs]") {
  const std::vector<std::uint8_t> strike = {0x90, 60, 127};
  const auto played = [&](std::vector<std::size_t> swaps, bool lets_ring) {
    support::Harness harness;
    harness.process.slot.offer(sounding(ringing_string(), struck(2), 1));
    play(harness, 256, strike);
    std::uint32_t serial = 1;
    for (const std::size_t at : swaps) {
      play(harness, at - harness.y().size());
      PlayingEngine* const next = sounding(ringing_string(), struck(2), ++serial);
      next->lets_ring = lets_ring;
      delete harness.process.slot.offer(next);
    }
    CHECK(play(harness, 25600 - harness.y().size()) == 0);
    CHECK(harness.process.meters().swaps == 1 + swaps.size());
    return harness.y();
  };
  const std::vector<double> alone = played({}, false);
  CHECK(peak(std::span(alone).subspan(20000)) > 1e-3);
  CHECK(played({2560}, true) == alone);
  // A load fades the ringing model in 50 ms, and so does a second program change.
  const auto faded = played({2560}, false);
  CHECK(peak(std::span(faded).subspan(2560 + fade_frames)) == 0.0);
  const auto twice = played({2560, 12800}, true);
  CHECK(std::equal(twice.begin(), twice.begin() + 12800, alone.begin()));
  for (std::size_t n = 0; n < fade_frames; ++n) {
    const double way = static_cast<double>(n) / static_cast<double>(fade_frames);
    REQUIRE(twice[12800 + n] == Approx((1.0 - way) * alone[12800 + n]).margin(1e-12));
  }
  CHECK(peak(std::span(twice).subspan(12800 + fade_frames)) == 0.0);
}

TEST_CASE("a held note is released in the model that it began in", "[programs]") {
  support::Harness harness;
  harness.process.slot.offer(sounding(hand_text, holding(), 1));
  play(harness, 2560, {0x90, 60, 127});
  PlayingEngine* const next = sounding(hand_text, holding(), 2);
  next->lets_ring = true;
  harness.process.slot.offer(next);
  play(harness, 25600);
  CHECK(harness.y().back() == Approx(1.0));
  play(harness, 25600, {0x80, 60, 0});
  CHECK(harness.y().back() == Approx(0.0).margin(1e-6));
}

TEST_CASE(
    "a program change loads the preset with its number, and unknown numbers are reported once",
    "[programs]") {
  DataFolder data;
  data.write("models/m.mdl", model_text);
  for (const char* const name : {"Alpha", "Beta", "Gamma"}) {
    data.write("presets/" + std::string(name) + ".toml", preset(name));
  }
  REQUIRE(known_presets() == std::vector<std::string>{"Alpha", "Beta", "Gamma"});
  std::mutex mutex;
  std::vector<std::string> told;
  Process process(48000.0);
  Session session(process, {.compile = {.rate_hz = 48000.0}}, [&](const std::string& text) {
    const std::lock_guard lock(mutex);
    told.push_back(text);
  });
  REQUIRE(session.load_and_wait("Alpha"));
  std::vector<float> left(64);
  std::vector<float*> outputs = {left.data()};
  const auto send = [&](const std::vector<std::uint8_t>& bytes) {
    const MidiPacket packet{0, bytes};
    process.block(std::span<const float* const>(), std::span<float* const>(outputs), 64,
                  {&packet, 1}, 0);
  };
  const auto wait_for = [&](auto&& is_so) {
    for (int i = 0; i < 2000 && !is_so(); ++i) {
      send({});
      std::this_thread::sleep_for(5ms);
    }
    return is_so();
  };
  const auto count = [&] {
    const std::lock_guard lock(mutex);
    return told.size();
  };
  send({0x90, 60, 100});
  send({0xc0, 2});
  CHECK(wait_for([&] { return session.current()->name == "Gamma"; }));
  send({0xc9, 1});
  CHECK(wait_for([&] { return session.current()->name == "Beta"; }));
  CHECK(wait_for([&] { return count() == 2; }));
  send({0xc0, 3});
  CHECK(wait_for([&] { return count() == 3; }));
  send({0xc0, 3});
  send({0xb0, 0, 1, 0xc0, 0});
  CHECK(wait_for([&] { return count() == 4; }));
  const std::lock_guard lock(mutex);
  CHECK(told[0] == "program 3: Gamma");
  CHECK(told[2] == "there is no program 4 in bank 0; there are 3 presets");
  CHECK(told[3] == "there is no program 1 in bank 128; there are 3 presets");
  CHECK(session.current()->name == "Beta");
}

}  // namespace ressort::programs_test
