// Several engines that share the notes of one instrument play the same as one engine.
#include <algorithm>
#include <cmath>
#include <vector>

#include "app/session/loader.h"
#include "core/engine/midi/note_share.h"
#include "tests/support/harness.h"

namespace ressort::share_test {

namespace {

// 60 notes, two at a time. A plucked body remembers the side of the finger, so it gets each key
// once.
std::vector<double> played(const Scene& scene, NoteShare::Part share, bool with_panic,
                           bool is_plucked) {
  auto compiled = compile_network(scene.network, scene.preset,
                                  {.rate_hz = 48000.0, .voices = 64, .share = share});
  REQUIRE(compiled);
  Engine& engine = *compiled->engine;
  std::vector<std::vector<double>> buffers(static_cast<std::size_t>(engine.output_count()),
                                           std::vector<double>(480));
  std::vector<double*> outputs;
  for (auto& buffer : buffers) {
    outputs.push_back(buffer.data());
  }
  std::vector<double> heard;
  for (std::uint16_t step = 0; step < 60; ++step) {
    std::vector<Event> events;
    const auto key_at = [&](int at) {
      return static_cast<std::uint16_t>(is_plucked ? 36 + at : 45 + at * 7 % 24);
    };
    const std::uint16_t key = key_at(step);
    if (step % 2 == 0) {  // keys are repeated while they ring, two at a time
      events.push_back({.kind = EventKind::note_on, .index = key, .value = 0.7});
      events.push_back({.frame = 100,
                        .kind = EventKind::note_on,
                        .index = static_cast<std::uint16_t>(is_plucked ? key + 1 : key + 12),
                        .value = 0.5});
    } else {
      events.push_back({.kind = EventKind::note_off, .index = key_at(step - 1), .value = 0.5});
      events.push_back({.frame = 50,
                        .kind = EventKind::controller,
                        .index = 64,
                        .value = step % 4 == 1 ? 1.0 : 0.0});
      events.push_back(
          {.frame = 60, .kind = EventKind::bend, .value = with_panic ? 0.2 : 0.3 * std::sin(step)});
    }
    if (with_panic && step == 31) {
      events.push_back({.frame = 70, .kind = EventKind::panic});
    }
    engine.process(events, {}, outputs, 480);
    for (const auto& buffer : buffers) {
      heard.insert(heard.end(), buffer.begin(), buffer.end());
    }
  }
  CHECK(engine.meters().stolen == 0);
  return heard;
}

double peak_of(const std::vector<double>& samples) {
  double peak = 0.0;
  for (const double sample : samples) {
    peak = std::max(peak, std::fabs(sample));
  }
  return peak;
}

}  // namespace

TEST_CASE("two and three engines that share the notes sum up to one", "[share]") {
  const std::string folder = std::string(RESSORT_SOURCE) + "/presets/";
  for (const std::string name : {"PolyTriangle", "Guitar", "Marimba", "IPlayTheTriangle"}) {
    auto scene = load_scene(folder + name + ".toml", {});
    REQUIRE(scene);
    scene->preset.precision = Precision::float64;
    const bool is_plucked = name == "Guitar" || name == "IPlayTheTriangle";
    for (const bool with_panic : {false, true}) {
      const std::vector<double> whole = played(*scene, {}, with_panic, is_plucked);
      CHECK(peak_of(whole) > 1e-3);
      for (const int count : {2, 3}) {
        INFO(name << " by " << count);
        std::vector<double> sum(whole.size());
        int sounding = 0;
        for (int number = 1; number <= count; ++number) {
          const std::vector<double> part = played(*scene, {number, count}, with_panic, is_plucked);
          sounding += peak_of(part) > 1e-3 ? 1 : 0;
          for (std::size_t n = 0; n < sum.size(); ++n) {
            sum[n] += part[n];
          }
        }
        CHECK(sounding == (count));
        double apart = 0.0;
        for (std::size_t n = 0; n < sum.size(); ++n) {
          apart = std::max(apart, std::fabs(sum[n] - whole[n]));
        }
        CHECK(apart < 1e-12 * peak_of(whole));
      }
    }
  }
}

TEST_CASE("new keys alternate between engines, and a repeated key stays with its engine",
          "[share]") {
  NoteShare first({1, 2});
  NoteShare second({2, 2});
  const auto takers = [&](std::uint8_t channel, std::size_t key) {
    return std::pair(first.owns(channel, key), second.owns(channel, key));
  };
  CHECK(takers(0, 60) == std::pair(true, false));
  CHECK(takers(0, 64) == std::pair(false, true));
  CHECK(takers(0, 67) == std::pair(true, false));
  CHECK(takers(1, 60) ==
        std::pair(false, true));  // the same key on another channel counts as another key
  CHECK(takers(0, 64) == std::pair(false, true));
  CHECK(takers(0, 60) == std::pair(true, false));
  first.restart();
  second.restart();
  CHECK(takers(0, 64) == std::pair(true, false));
}

}  // namespace ressort::share_test
