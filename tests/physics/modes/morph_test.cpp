// A morph through several presets: each stop sounds like the preset, numbers between stops follow
// their law, and the pitch stays constant.
#include "core/model/morph.h"

#include <array>
#include <cmath>

#include "app/session/loader.h"
#include "core/analysis/modes/morph_decay.h"
#include "core/compile/compile.h"
#include "core/model/language/mdl.h"
#include "tests/support/partial.h"
#include "tests/support/player.h"

namespace ressort::morph_test {
namespace {

using namespace support;

constexpr double rate_hz = 48000.0;

Scene scene_of_preset(const std::string& name) {
  auto scene = load_scene(std::string(RESSORT_SOURCE) + "/presets/" + name + ".toml", {});
  INFO(name << ": " << (scene ? "" : scene.error().message));
  REQUIRE(scene);
  return *std::move(scene);
}

// A string with air loss and a damper, whose parameters and places all change.
const char* const string_text =
    "@K param 0.1\n@Q param 0.3\n@Z param 0.0008\n@A param 0.00002\n@M param 1.\n"
    "@s string 24 M K Z 0. 0.\n@g ground 0.\n@air damper @g [@s 0.5] A\n"
    "@in1 frcInput [@s 0.23]\n@out1 posOutput [@s Q]\n";
constexpr std::array<std::array<double, 5>, 3> string_stops = {{{0.1, 0.3, 0.0008, 0.00002, 1.0},
                                                                {0.3, 0.9, 0.00005, 0.002, 2.0},
                                                                {0.02, 0.6, 0.0004, 0.0001, 0.5}}};

std::vector<MorphStop> stops_of(const Network& network, std::size_t count) {
  std::vector<MorphStop> stops;
  for (std::size_t i = 0; i < count; ++i) {
    stops.push_back({.name = "stop " + std::to_string(i + 1),
                     .network = &network,
                     .values = {string_stops[i].begin(), string_stops[i].end()}});
  }
  return stops;
}

Scene string_scene(std::size_t stops) {
  Scene scene;
  const Network network = network_of(string_text);
  auto through = morphed(network, stops_of(network, stops), "t", {});
  REQUIRE(through);
  const std::vector<double> values = parameter_values(*through);
  scene.network = with_even_decay(*std::move(through), {.stops = stops, .values = values});
  scene.preset = struck(1);
  scene.preset.controls[0].low = 0.1;
  scene.preset.gain = 0.1;
  scene.preset.morph_parameter = "t";
  scene.preset.morph.resize(stops);
  scene.preset.parameters = {{"t", 1.0, 1.0, static_cast<double>(stops)}};
  return scene;
}

int index_of(const Network& network, const std::string& name) {
  for (std::size_t i = 0; i < network.parameters.size(); ++i) {
    if (network.parameters[i].name == name) {
      return static_cast<int>(i);
    }
  }
  FAIL("no parameter " << name);
  return 0;
}

struct Played {
  std::vector<std::vector<double>> sound;  // [channel]
  std::size_t heap_calls = 0;
};

Played played(const Scene& scene, double seconds, const std::vector<Event>& events,
              double at_hz = rate_hz) {
  auto compiled = compile_network(scene.network, scene.preset, {.rate_hz = at_hz});
  REQUIRE(compiled);
  Played out;
  out.sound.resize(static_cast<std::size_t>(compiled->instrument.outputs));
  const auto frames = static_cast<std::size_t>(seconds * at_hz);
  std::size_t next = 0;
  for (std::size_t at = 0; at < frames; at += 64) {
    std::vector<Event> due;
    for (; next < events.size() && events[next].frame < at + 64; ++next) {
      due.push_back(events[next]);
      due.back().frame -= static_cast<std::uint32_t>(at);
    }
    std::vector<double*> to;
    for (auto& channel : out.sound) {
      channel.resize(at + 64);
      to.push_back(channel.data() + at);
    }
    const HeapWatch watch;
    compiled->engine->process(due, {}, to, 64);
    out.heap_calls += watch.calls();
  }
  return out;
}

// The sixth difference of a smooth morph contains only a small part of the highest partials; a step
// of 1 contributes 20.
double largest_sixth_difference(std::vector<double> y) {
  for (int order = 0; order < 6; ++order) {
    for (std::size_t n = 0; n + 1 < y.size(); ++n) {
      y[n] = y[n + 1] - y[n];
    }
    y.pop_back();
  }
  return peak(y);
}

struct Way {
  Scene scene;
  const char* parameter;
  int key;
  double hz;
  double last;
};

std::vector<Way> ways() {
  std::vector<Way> all;
  all.push_back({scene_of_preset("BellThirds"), "third", 57, 110.0, 2.0});
  all.push_back({scene_of_preset("BarMetals"), "metal", 57, 220.0, 3.0});
  all.push_back({string_scene(3), "t", 57, 220.0, 3.0});
  return all;
}

}  // namespace

TEST_CASE("a morph of 5 s keeps the pitch to a tenth of a cent, without a step", "[morph]") {
  for (const Way& way : ways()) {
    const int index = index_of(way.scene.network, way.parameter);
    std::vector<Event> events = {parameter(0, index, 1.0), note_on(0, way.key)};
    for (int step = 1; step <= 250; ++step) {
      events.push_back(parameter(static_cast<std::uint32_t>(step * 0.02 * rate_hz) - 1, index,
                                 1.0 + (way.last - 1.0) * step / 250.0));
    }
    const Played all = played(way.scene, 5.5, events);
    CHECK(all.heap_calls == 0);
    double worst = 0.0;
    for (double from_s = 0.1; from_s < 4.6; from_s += 0.25) {
      const HeardPartial found = partial_of(all.sound[0], rate_hz, way.hz, from_s, 0.3, 0.3);
      worst = std::max(worst, std::fabs(cents(found.hz, way.hz)));
    }
    const std::vector<double> ringing(all.sound[0].begin() + 4800, all.sound[0].end());
    INFO(way.parameter << ": " << worst << " cents, "
                       << 20.0 * std::log10(largest_sixth_difference(ringing) / peak(all.sound[0]))
                       << " dB");
    CHECK(worst < 0.1);
    CHECK(largest_sixth_difference(ringing) < 20e-3 * peak(all.sound[0]));
  }
}

TEST_CASE("the morph test detects a tenth of a cent and a step of -60 dB", "[morph]") {
  std::vector<double> y(static_cast<std::size_t>(rate_hz));
  for (std::size_t n = 0; n < y.size(); ++n) {
    y[n] = std::sin(2.0 * std::numbers::pi * 220.0 * std::exp2(0.1 / 1200.0) *
                    static_cast<double>(n) / rate_hz) +
           (n > 20000 ? 1e-3 : 0.0);
  }
  CHECK(cents(partial_of(y, rate_hz, 220.0, 0.0, 0.3, 0.3).hz, 220.0) > 0.099);
  CHECK(largest_sixth_difference(y) > 9e-3);
}

TEST_CASE("each stop of a morph sounds as its preset does", "[morph]") {
  const auto heard = [](const Scene& scene, const std::vector<Event>& events) {
    return played(scene, 0.3, events).sound;
  };
  const Scene morph = scene_of_preset("BarMetals");
  const int index = index_of(morph.network, "metal");
  double stop = 0.0;
  for (const char* name : {"Vibraphone", "CelestaBar", "Glockenspiel"}) {
    Scene alone = scene_of_preset(name);
    stop += 1.0;
    // Struck alike at the same pitch.
    alone.preset.controls = morph.preset.controls;
    std::erase_if(alone.preset.controls,
                  [](const ControlSetting& one) { return one.source != ControlSource::note; });
    for (ControlSetting& one : alone.preset.controls) {
      one.longest_ms = one.shortest_ms = 0.0;
    }
    Scene there = morph;
    there.preset.controls = alone.preset.controls;
    there.preset.gain = 1.0;
    alone.preset.transpose = there.preset.transpose = 0;
    alone.preset.hardness = there.preset.hardness = "";
    alone.preset.lfos.clear();
    const auto expected = heard(alone, {note_on(0, 60)});
    const auto found = heard(there, {parameter(0, index, stop), note_on(0, 60)});
    for (std::size_t c = 0; c < 2; ++c) {
      double off = 0.0;
      for (std::size_t n = 0; n < found[c].size(); ++n) {
        off = std::max(off, std::fabs(found[c][n] - expected[c][n]));
      }
      INFO(name << ", channel " << c << ": " << off / peak(expected[c]));
      // Its own key table and the morph's differ by the interpolation between semitones.
      CHECK(off < 1e-4 * peak(expected[c]));
    }
  }
}

TEST_CASE("between stops, stiffness and damping change by equal ratios and places linearly",
          "[morph]") {
  const Network network = network_of(string_text);
  auto through = morphed(network, stops_of(network, 3), "t", std::vector<std::string>{"A"});
  REQUIRE(through);
  const int a = index_of(*through, "A");
  const int t = index_of(*through, "t");
  REQUIRE(through->parameters.size() == 2);
  for (const double at : {1.0, 1.5, 2.0, 2.25, 3.0, 7.0}) {
    std::vector<double> values(2);
    values[static_cast<std::size_t>(a)] = 0.0123;
    values[static_cast<std::size_t>(t)] = at;
    const double inside = std::min(at, 3.0);
    const auto below = static_cast<std::size_t>(std::min(inside, 2.999)) - 1;
    const double way = inside - static_cast<double>(below + 1);
    const auto ratio = [&](std::size_t i) {
      return std::pow(string_stops[below][i], 1.0 - way) *
             std::pow(string_stops[below + 1][i], way);
    };
    const Macro& string = through->macros[0];
    CHECK(argument_value(*through, string.stiffness, values) == Approx(ratio(0)).epsilon(1e-12));
    CHECK(argument_value(*through, string.damping, values) == Approx(ratio(2)).epsilon(1e-12));
    CHECK(argument_value(*through, string.mass, values) == Approx(ratio(4)).epsilon(1e-12));
    const Mass& ear = through->masses[through->outputs[0].mass];
    CHECK(argument_value(*through, through->taps[ear.tap].u, values) ==
          Approx((1.0 - way) * string_stops[below][1] + way * string_stops[below + 1][1])
              .epsilon(1e-12));
    CHECK(argument_value(*through, linear_part(through->links[0]).damping, values) == 0.0123);
  }
}

TEST_CASE("levels change linearly in dB, and linearly from 0", "[morph]") {
  const Network network = network_of(
      "@L param 1.\n@Z param 0.\n@m osc 1. 0.01 Z 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m L\n");
  const std::vector<MorphStop> stops = {
      {.name = "a", .network = &network, .values = {1.0, 0.0}, .gain = 2.0},
      {.name = "b", .network = &network, .values = {0.001, 0.004}, .gain = 0.5}};
  const auto through = morphed(network, stops, "t", {});
  REQUIRE(through);
  const std::vector<double> middle = {1.5};
  CHECK(level_value(*through, through->outputs[0], middle) ==
        Approx(std::sqrt(2.0 * 0.5 * 1e-3)).epsilon(1e-12));
  CHECK(argument_value(*through, through->masses[0].damping, middle) == Approx(0.002));
}

TEST_CASE("T60 changes by equal ratios between stops with any damping", "[morph]") {
  const Scene scene = string_scene(2);
  const int t = index_of(scene.network, "t");
  const auto t60 = [&](double position) {
    return partial_of(played(scene, 2.2, {parameter(0, t, position), note_on(0, 57)}).sound[0],
                      rate_hz, 220.0, 0.2, 1.0, 0.9)
        .t60_s;
  };
  const double first = t60(1.0);
  const double last = t60(2.0);
  for (const double way : {0.25, 0.5, 0.75}) {
    INFO(way << ": " << t60(1.0 + way) << " s");
    CHECK(t60(1.0 + way) == Approx(std::pow(first, 1.0 - way) * std::pow(last, way)).epsilon(1e-3));
  }
  // Without the correction the error is 22 % in the middle.
  const Network network = network_of(string_text);
  Scene plain = scene;
  plain.network = *morphed(network, stops_of(network, 2), "t", {});
  const double loose =
      partial_of(played(plain, 2.2, {parameter(0, t, 1.5), note_on(0, 57)}).sound[0], rate_hz,
                 220.0, 0.2, 1.0, 0.9)
          .t60_s;
  CHECK(std::fabs(loose / std::sqrt(first * last) - 1.0) > 0.05);
}

TEST_CASE("a morph that is not possible is rejected with advice", "[morph]") {
  const auto refused = [](const std::string& a, const std::string& b) {
    const Network one = network_of(a);
    const Network other = network_of(b);
    const std::vector<MorphStop> stops = {
        {.name = "One", .network = &one, .values = parameter_values(one)},
        {.name = "Other", .network = &other, .values = parameter_values(other)}};
    const auto through = morphed(one, stops, "t", {});
    REQUIRE(!through);
    return through.error().message;
  };
  const auto string = [](const std::string& macro, const std::string& more = "") {
    return "@s " + macro + "\n@in1 frcInput [@s 0.3]\n@out1 posOutput [@s 0.9]\n" + more;
  };
  const std::string plain = string("string 12 1. 0.1 0.001 0. 0.");
  CHECK(
      refused(plain, string("string 20 1. 0.1 0.001 0. 0.")) ==
      "a morph needs models of the same structure, but 's' has 12 nodes, not 20, as in Other; put "
      "both into one model and change the levels of its outputs, as SixStructures does");
  CHECK(refused(plain, string("chain 12 1. 0.1 0.001 0. 0.")).find("is of another kind") !=
        std::string::npos);
  CHECK(refused(plain, plain + "@g ground 0.\n@k spring @g [@s 0.5] 0.1\n").find("masses") !=
        std::string::npos);
  CHECK(refused(plain + "@out2 posOutput [@s 0.1]\n", plain).find("a morph needs models") == 0);
  const std::string spring =
      "@m mass 1. 0. 0.\n@g ground 0.\n@in1 frcInput @m\n@out1 posOutput @m\n";
  CHECK(refused(spring + "@l spring @g @m 0.1\n", spring + "@l nlSpring3 @g @m 0.1 0.1 0.\n")
            .find("a link has another law") != std::string::npos);
}

}  // namespace ressort::morph_test
