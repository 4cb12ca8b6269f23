// Six structures with one pitch and one decay, and the mixes of the paper's patch, judged by the
// sound and with the paper's table written in this file.
#include <array>
#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>

#include "core/analysis/timbre/frame_analysis.h"
#include "core/compile/compile.h"
#include "core/model/language/mdl.h"
#include "tests/support/partial.h"
#include "tests/support/player.h"
#include "tests/support/random.h"

namespace ressort::six_structures_test {
namespace {

using namespace support;

constexpr std::size_t structures = 6;
constexpr std::array<const char*, structures> names = {"string", "stiff",  "chain",
                                                       "mesh",   "corner", "closed"};

std::string text_of(const std::string& path) {
  std::ifstream file(std::string(RESSORT_SOURCE) + path);
  REQUIRE(file);
  std::ostringstream all;
  all << file.rdbuf();
  return all.str();
}

Preset preset() {
  const ParsedPreset parsed = parse_preset(text_of("/presets/SixStructures.toml"));
  REQUIRE(parsed.ok());
  return parsed.preset;
}

// The sound of one structure, or of all.
struct Heard {
  int only = -1;
  bool has_levels = true;
  double rate_hz = 48000.0;
};

std::vector<double> played(const Heard& heard, double seconds, const std::vector<Event>& events) {
  Network network = network_of(text_of("/models/SixStructures.mdl"));
  REQUIRE(network.outputs.size() == 2 * structures);
  network.outputs.resize(structures);  // The left channel.
  if (!heard.has_levels) {
    for (Output& output : network.outputs) {
      output.level = no_argument;
    }
  }
  if (heard.only >= 0) {
    network.outputs = {network.outputs[static_cast<std::size_t>(heard.only)]};
  }
  Preset quick = preset();
  quick.tuned_along.clear();  // Takes long and is not needed here.
  auto compiled = compile_network(network, quick, {.rate_hz = heard.rate_hz});
  REQUIRE(compiled);
  std::vector<double> sound(static_cast<std::size_t>(seconds * heard.rate_hz));
  std::size_t next = 0;
  for (std::size_t at = 0; at < sound.size(); at += 64) {
    const std::size_t n = std::min<std::size_t>(64, sound.size() - at);
    std::vector<Event> due;
    for (; next < events.size() && events[next].frame < at + n; ++next) {
      due.push_back(events[next]);
      due.back().frame -= static_cast<std::uint32_t>(at);
    }
    double* const to = sound.data() + at;
    compiled->engine->process(due, {}, std::span(&to, 1), n);
  }
  return sound;
}

double peak_of(const std::vector<double>& y) {
  double peak = 0.0;
  for (const double sample : y) {
    peak = std::max(peak, std::fabs(sample));
  }
  return peak;
}

int index_of(const std::string& name) {
  const Network network = network_of(text_of("/models/SixStructures.mdl"));
  for (std::size_t i = 0; i < network.parameters.size(); ++i) {
    if (network.parameters[i].name == name) {
      return static_cast<int>(i);
    }
  }
  FAIL("no parameter " << name);
  return 0;
}

}  // namespace

TEST_CASE("six structures share pitch and decay at three keys", "[six_structures]") {
  for (const double rate_hz : {44100.0, 48000.0}) {
    for (int i = 0; i < static_cast<int>(structures); ++i) {
      for (const int key : {45, 57, 69}) {
        const double hz = 440.0 * std::exp2((key - 69) / 12.0);
        const HeardPartial found =
            partial_of(played({.only = i, .rate_hz = rate_hz}, 2.2, {note_on(0, key)}), rate_hz, hz,
                       0.2, 1.0, 0.9);
        INFO(names[static_cast<std::size_t>(i)] << ", " << hz << " Hz at " << rate_hz << ": "
                                                << cents(found.hz, hz) << " cents, " << found.t60_s
                                                << " s");
        CHECK(std::fabs(cents(found.hz, hz)) < 0.01);
        CHECK(std::fabs(found.t60_s / 3.0 - 1.0) < 1e-3);
      }
    }
  }
}

TEST_CASE("T60 is reached and moves the pitch by less than 0.05 cents", "[six_structures]") {
  const int t60 = index_of("t60");
  Network network = network_of(text_of("/models/SixStructures.mdl"));
  network.outputs.resize(structures);
  for (std::size_t i = 0; i < structures; ++i) {
    network.outputs[i].number = static_cast<int>(i) + 1;  // One output per structure.
    network.outputs[i].level = no_argument;
  }
  for (const double asked_s : {0.2, 0.37, 1.0, 2.0, 10.0}) {
    // Windows long enough to exclude other partials and no longer than the sound.
    const double length_s = asked_s < 1.0 ? 0.11 : 1.0;
    const int key = asked_s < 1.0 ? 69 : 57;
    const double hz = 440.0 * std::exp2((key - 69) / 12.0);
    auto compiled = compile_network(network, preset(), {.rate_hz = 48000.0});
    REQUIRE(compiled);
    std::vector<std::vector<double>> sound(structures, std::vector<double>(105600));
    std::vector<double*> to;
    for (std::vector<double>& channel : sound) {
      to.push_back(channel.data());
    }
    compiled->engine->process(std::vector<Event>{parameter(0, t60, asked_s), note_on(0, key)}, {},
                              to, sound[0].size());
    for (std::size_t i = 0; i < structures; ++i) {
      const HeardPartial found = partial_of(sound[i], 48000.0, hz, 0.02, length_s, 0.9 * length_s);
      INFO(names[i] << ", " << asked_s << " s: " << cents(found.hz, hz) << " cents, " << found.t60_s
                    << " s");
      CHECK(std::fabs(cents(found.hz, hz)) < 0.05);
      CHECK(std::fabs(found.t60_s / asked_s - 1.0) < 1e-3);
    }
  }
}

// T60 changes while low notes sound, where dampers flatten most: 3 cents at 55 Hz without
// correction.
TEST_CASE("keys stay in tune while T60 changes", "[six_structures]") {
  const int t60 = index_of("t60");
  const auto found_at = [&](bool is_tuned) {
    Preset quick = preset();
    quick.tuned_along = is_tuned ? "t60" : "";
    Player player(text_of("/models/SixStructures.mdl"), quick, {.rate_hz = 48000.0});
    std::vector<Event> events = {note_on(0, 33)};
    for (int step = 1; step <= 100; ++step) {
      events.push_back(parameter(static_cast<std::uint32_t>(480 * step), t60,
                                 10.0 * std::pow(0.05, step / 100.0)));
    }
    player.run(48000 + 24000, events);
    return cents(partial_of(player.y(), 48000.0, 55.0, 1.01, 0.2, 0.15).hz, 55.0);
  };
  INFO(found_at(true) << " cents, " << found_at(false) << " without");
  CHECK(std::fabs(found_at(true)) < 0.05);
  CHECK(std::fabs(found_at(false)) > 0.5);
}

TEST_CASE("an unreachable T60 is rejected with the reason", "[six_structures]") {
  Preset wide = preset();
  for (ParameterSetting& setting : wide.parameters) {
    if (setting.name == "t60") {
      setting.minimum = 0.05;
    }
  }
  const auto compiled = compile_network(network_of(text_of("/models/SixStructures.mdl")), wide, {});
  REQUIRE(compiled);
  REQUIRE(compiled->stability.narrowed.size() == 1);
  INFO(compiled->stability.narrowed[0].message);
  CHECK(compiled->stability.narrowed[0].message.find("t60") != std::string::npos);
}

TEST_CASE("the test detects 0.01 cents and 0.1 % of a decay", "[six_structures]") {
  std::vector<double> y(96000);
  for (std::size_t n = 0; n < y.size(); ++n) {
    const double t = static_cast<double>(n) / 48000.0;
    y[n] = std::sin(2.0 * std::numbers::pi * 110.0 * std::exp2(0.012 / 1200.0) * t) *
           std::pow(10.0, -3.0 * t / 3.0036);
  }
  const HeardPartial found = partial_of(y, 48000.0, 110.0, 0.1, 0.9, 0.9);
  CHECK(cents(found.hz, 110.0) == Approx(0.012).margin(1e-4));
  CHECK(found.t60_s == Approx(3.0036).epsilon(1e-5));
}

// Gains of the patch; 128 is 0 dB and a step is 0.6 dB.
TEST_CASE("mixes 1 to 6 equal the stored ones, linear in dB in between", "[six_structures]") {
  constexpr double table[6][structures] = {
      {107, 100, 36, 113, 36, 36}, {42, 69, 106, 106, 128, 106}, {30, 74, 129, 95, 95, 113},
      {98, 49, 44, 114, 98, 15},   {115, 117, 78, 84, 73, 50},   {25, 67, 78, 65, 124, 56}};
  const int timbre = index_of("timbre");
  for (int i = 0; i < static_cast<int>(structures); ++i) {
    const double plain = peak_of(played({.only = i, .has_levels = false}, 0.05, {note_on(0, 57)}));
    for (const double position : {1.0, 2.0, 2.5, 3.0, 4.0, 5.0, 5.25, 6.0}) {
      const auto below = static_cast<std::size_t>(std::min(position, 5.0)) - 1;
      const double way = position - static_cast<double>(below + 1);
      const double gain = (1.0 - way) * table[below][i] + way * table[below + 1][i];
      const double heard =
          peak_of(played({.only = i}, 0.05, {parameter(0, timbre, position), note_on(0, 57)}));
      INFO(names[static_cast<std::size_t>(i)] << " at " << position);
      const double louder = position > 5.0 ? 28.0 * std::min(way, 1.0 - way) : 0.0;
      CHECK(20.0 * std::log10(heard / plain) == Approx(0.6 * (gain - 128.0) + louder).margin(1e-6));
    }
  }
}

// The sound of all six together is audible everywhere. Linear interpolation of dB between the
// extremes would fade in between.
TEST_CASE("a key is audible at every mix", "[six_structures]") {
  const int timbre = index_of("timbre");
  const auto at = [&](double position) {
    return peak_of(played({}, 0.2, {parameter(0, timbre, position), note_on(0, 60)}));
  };
  const double loud = at(1.0);
  for (double position = 1.25; position <= 12.0; position += 0.25) {
    INFO(position << ": " << 20.0 * std::log10(at(position) / loud) << " dB");
    CHECK(at(position) > 0.4 * loud);  // The patch's own third and sixth mix are 4 dB softer.
  }
}

// Each descriptor of the frame at 0.33 s of A3, as `describe --at 14400` computes it: no other mix
// of the six structures, from 0 to -60 dB of the loudest, exceeds the extreme.
TEST_CASE("mixes 7 to 12 have the extrema of six descriptors", "[six_structures]") {
  constexpr double rate_hz = 44100.0;
  constexpr std::size_t size = 2048;
  const Network network = network_of(text_of("/models/SixStructures.mdl"));
  std::array<std::vector<double>, structures> alone;
  for (std::size_t i = 0; i < structures; ++i) {
    Network one = network;
    one.outputs = {network.outputs[i], network.outputs[structures + i]};
    for (Output& output : one.outputs) {
      output.number = 1;
      output.level = no_argument;
    }
    auto compiled = compile_network(one, preset(), {.rate_hz = rate_hz});
    REQUIRE(compiled);
    std::vector<double> sound(14400 + size);
    double* const to = sound.data();
    compiled->engine->process(std::vector<Event>{note_on(0, 57, 100.0 / 127.0)}, {},
                              std::span(&to, 1), sound.size());
    alone[i].assign(sound.end() - size, sound.end());
  }
  using Levels = std::array<double, structures>;
  FrameAnalysis analysis({.rate_hz = rate_hz, .size = size});
  const auto shape_of = [&](const Levels& gains) {
    std::vector<double> frame(size);
    for (std::size_t n = 0; n < size; ++n) {
      for (std::size_t i = 0; i < structures; ++i) {
        frame[n] += gains[i] * alone[i][n];
      }
    }
    return *analysis.next(frame).shape;
  };
  const auto gains_of = [](const Levels& db) {
    Levels gains{};
    for (std::size_t i = 0; i < structures; ++i) {
      gains[i] = std::pow(10.0, db[i] / 20.0);
    }
    return gains;
  };
  struct Extreme {
    const char* name;
    double (*of)(const SpectralShape& shape);  // The descriptor that has its maximum at this mix.
  };
  const Extreme extremes[] = {
      {"centroid", [](const SpectralShape& shape) { return shape.centroid_hz; }},
      {"spread, the least", [](const SpectralShape& shape) { return -shape.spread_hz; }},
      {"skewness", [](const SpectralShape& shape) { return *shape.skewness; }},
      {"kurtosis, the least", [](const SpectralShape& shape) { return -*shape.kurtosis; }},
      {"decrease", [](const SpectralShape& shape) { return *shape.decrease; }},
      {"rolloff", [](const SpectralShape& shape) { return shape.rolloff95_hz; }}};
  const int timbre = index_of("timbre");
  std::vector<double> values = parameter_values(network);
  Random random(20);
  for (std::size_t e = 0; e < std::size(extremes); ++e) {
    values[static_cast<std::size_t>(timbre)] = 7.0 + static_cast<double>(e);
    Levels db{};
    for (std::size_t i = 0; i < structures; ++i) {
      db[i] = 20.0 * std::log10(level_value(network, network.outputs[i], values));
    }
    const double loudest = *std::max_element(db.begin(), db.end());
    const double there = extremes[e].of(shape_of(gains_of(db)));
    double beyond = -1e300;
    const auto look = [&](Levels other) {
      const double most = *std::max_element(other.begin(), other.end());
      for (double& level : other) {
        level = std::max(level, most - 60.0);
      }
      beyond = std::max(beyond, extremes[e].of(shape_of(gains_of(other))));
    };
    for (std::size_t i = 0; i < structures; ++i) {
      for (double level = -60.0; level <= 0.0; level += 4.0) {
        Levels other = db;
        other[i] = loudest + level;
        look(other);
      }
    }
    for (int k = 0; k < 300; ++k) {
      Levels other{};
      for (double& level : other) {
        level = random.uniform(-60.0, 0.0);
      }
      look(other);
    }
    INFO(extremes[e].name << ": " << there << ", elsewhere up to " << beyond);
    CHECK(beyond <= there + 1e-4 * std::fabs(there));
  }
}

TEST_CASE("a sweep through the mixes keeps the pitch and has no steps", "[six_structures]") {
  constexpr double rate_hz = 48000.0;
  std::vector<Event> events = {controller(0, 1, 0.0), note_on(0, 45)};
  for (int step = 1; step <= 127; ++step) {  // A controller sweep of 5 s.
    events.push_back(
        controller(static_cast<std::uint32_t>(step * 5.0 * rate_hz / 127.0) - 1, 1, step / 127.0));
  }
  const std::vector<double> all = played({}, 5.5, events);
  for (const double from_s : {0.2, 1.0, 2.0, 3.0, 4.0}) {
    const HeardPartial found = partial_of(all, rate_hz, 110.0, from_s, 0.6, 0.6);
    INFO("from " << from_s << " s: " << cents(found.hz, 110.0) << " cents");
    CHECK(std::fabs(cents(found.hz, 110.0)) < 0.1);
  }
  const double peak = peak_of(all);
  for (int i = 0; i < static_cast<int>(structures); ++i) {
    // Removing the structure's own motion leaves the change of level from sample to sample.
    const std::vector<double> swept = played({.only = i}, 5.5, events);
    const std::vector<double> plain = played({.only = i, .has_levels = false}, 5.5, events);
    double worst = 0.0;
    for (std::size_t n = 1; n < swept.size(); ++n) {
      if (std::fabs(plain[n - 1]) > 1e-9) {
        const double kept = swept[n - 1] / plain[n - 1] * plain[n];
        worst = std::max(worst, std::fabs(swept[n] - kept));
      }
    }
    INFO(names[static_cast<std::size_t>(i)] << ": " << 20.0 * std::log10(worst / peak) << " dB");
    CHECK(worst < 1e-3 * peak);
  }
}

TEST_CASE("outputs of equal number add up, each times its level", "[six_structures]") {
  const std::string strings =
      "@p param 0.5\n@s string 12 1. 0.1 0.001 0. 0.\n@t string 12 1. 0.2 0.001 0. 0.\n"
      "@in1 frcInput [@s 0.3]\n@in2 frcInput [@t 0.3]\n";
  Preset preset = struck(1);
  preset.controls.push_back({.target = "in2", .gesture = Gesture::impulse, .high = 0.1});
  const auto sound = [&](const std::string& outputs) {
    Player player(strings + outputs, preset);
    player.run(4096, {note_on(0, 57)});
    return player.out;
  };
  const auto apart = sound("@out1 posOutput [@s 0.9]\n@out2 posOutput [@t 0.9]\n");
  const auto both = sound("@out1 posOutput [@s 0.9] p*3\n@out1 posOutput [@t 0.9] -0.25\n");
  REQUIRE(both.size() == 1);
  double worst = 0.0;
  for (std::size_t n = 0; n < both[0].size(); ++n) {
    worst = std::max(worst, std::fabs(both[0][n] - 1.5 * apart[0][n] + 0.25 * apart[1][n]));
  }
  CHECK(worst < 1e-14);
  CHECK(peak_of(both[0]) > 1e-4);
}

TEST_CASE("an invalid level is reported with its position", "[six_structures]") {
  const auto told = [](const std::string& line) {
    const ParsedNetwork parsed =
        parse_network("@l audioParam @in1\n@s string 12 1. 0.1 0. 0. 0.\n" + line + "\n");
    REQUIRE(!parsed.ok());
    return to_string(parsed.diagnostics[0], "x.mdl");
  };
  CHECK(told("@out1 posOutput @s 0.5 0.9").find("in brackets: [@s 0.3]") != std::string::npos);
  CHECK(told("@out1 posOutput [@s 0.9] l").find("x.mdl:3:26: error: an output's level cannot") ==
        0);
  CHECK(told("@out1 posOutput [@s 0.9] 1 2").find("takes 1 to 2 arguments") != std::string::npos);
}

}  // namespace ressort::six_structures_test
