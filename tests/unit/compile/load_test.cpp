// The time of a load, stopping it at any stage, and the check of its memory.
#include <algorithm>
#include <chrono>
#include <functional>
#include <limits>
#include <new>
#include <string>

#include "app/session/load_progress.h"
#include "core/analysis/linear.h"
#include "core/analysis/stability.h"
#include "core/compile/make_engine.h"
#include "core/progress.h"
#include "tests/support/catch.h"
#include "tests/support/harness.h"
#include "tests/support/heap.h"
#include "tests/support/random.h"

namespace ressort::load_test {

namespace {

std::string at(const char* before, int i) {
  return before + std::to_string(i);
}

std::string masses(int n) {
  std::string text = "@K param 0.01\n@g ground 0.\n@in1 frcInput @m0\n@out1 posOutput @m0\n";
  for (int i = 0; i < n; ++i) {
    text += "@" + at("m", i) + " mass 1. 0. 0.\n";
  }
  return text;
}

std::string spring(int i, int a, int b, const std::string& stiffness) {
  return "@" + at("l", i) + " springDamper " + at("@m", a) + " " + at("@m", b) + " " + stiffness +
         " 0.\n";
}

std::string chain(int n) {
  std::string text = masses(n);
  for (int i = 1; i < n; ++i) {
    text += spring(i, i - 1, i, "K");
  }
  return text;
}

// Returns masses that are all linked to the first.
std::string star(int n) {
  std::string text = masses(n);
  for (int i = 1; i < n; ++i) {
    text += spring(i, 0, i, std::to_string(0.5 / n));
  }
  return text;
}

// Returns a chain whose masses are all linked to the first one too, by different springs.
std::string hub(int n) {
  std::string text = chain(n);
  for (int i = 2; i < n; ++i) {
    text += spring(n + i, 0, i, support::show(1e-6 + 1e-9 * i));
  }
  return text;
}

// Returns a chain and pairs of masses: rows of very different lengths.
std::string comb(int n) {
  std::string text = masses(n);
  for (int i = 1; i < n; ++i) {
    if (i < n / 2 || i % 2 == 1) {
      text += spring(i, i - 1, i, "K");
    }
  }
  return text;
}

std::string tangle(int n) {
  std::string text = masses(n);
  support::Random random(1);
  for (int i = 0; i < 3 * n; ++i) {
    const auto end = [&] { return static_cast<int>(random.below(static_cast<std::size_t>(n))); };
    const int a = end();
    text += spring(i, a, end(), "K");
  }
  return text;
}

// Returns a string with as many places as masses, each with a contact. `place`: their coordinates.
std::string places(int n, const std::string& place) {
  std::string text = "@u param 0.3\n@s string " + std::to_string(n) +
                     " 1. 0.01 0. 0. 0.\n@g ground 0.\n@out1 posOutput [@s 0.3]\n";
  for (int i = 0; i < n; ++i) {
    text += "@" + at("l", i) + " contact @g [@s " + place + "] 0.0001 0. 0.\n";
  }
  return text;
}

// Returns the steps that reading and compiling a model spend.
std::uint64_t steps_of(const std::string& text) {
  const Progress progress([](std::string_view) { return true; });
  const ParsedNetwork parsed = parse_network(text, {.progress = progress});
  REQUIRE(parsed.ok());
  const auto compiled = compile_network(parsed.network, default_preset(parsed.network, false),
                                        {.most_modes = quick_modes, .progress = progress});
  REQUIRE(compiled);
  return progress.steps();
}

// Returns a model with every kind of element.
const std::string varied = [] {
  std::string text =
      chain(90) + "@u param 0.4\n@s string 30 1. K 0.001 0. 0.\n@p mesh 6 6 1. K " +
      "0.001 0. 0.\n@o cel 1. 0.01 0.001 0. 0.\n@in2 posInput 0.\n@q mass 1. 0. 0.\n";
  text += "@pluck nlPluck @in2 @m3 0.01 0.1\n@hit contact @g [@s u] 0.01 0. 0.\n";
  text += "@bent nlSpring3 @m5 [@s 0.3] 0.001 0.001 0.\n@a springDamper @q @m7 K 0.\n";
  text += "@b springDamper @q @m7 K 0.\n@c springDamper @o [@p 0.3 0.2] K 0.\n";
  return text + "@out2 posOutput [@p 0.5 0.5]\n@out3 posOutput @q\n";
}();

}  // namespace

TEST_CASE("The time of a load grows hardly faster than the model", "[load]") {
  struct Shape {
    const char* name;
    std::function<std::string(int)> text;
    int size;
  };
  // Each of these was quadratic or worse. A tangle is too large for a factorisation at both sizes.
  const auto shape =
      GENERATE(Shape{"chain", chain, 2000}, Shape{"star", star, 2000}, Shape{"hub", hub, 1000},
               Shape{"comb", comb, 2000}, Shape{"tangle", tangle, 4000},
               Shape{"places", [](int n) { return places(n, "0.4"); }, 250},
               Shape{"live places", [](int n) { return places(n, "u"); }, 250});
  const auto small = static_cast<double>(steps_of(shape.text(shape.size)));
  const auto large = static_cast<double>(steps_of(shape.text(4 * shape.size)));
  CAPTURE(shape.name, small, large);
  // n log n grows 4.8 times from 1000 to 4000, n^1.5 8 times.
  CHECK(large < 6.0 * small);
}

TEST_CASE("A large random network is checked by the edge bound and has no lowest mode", "[load]") {
  const Network network = support::network_of(tangle(4000));
  const std::vector<double> values = {0.01};
  const Progress progress([](std::string_view) { return true; });
  CHECK_FALSE(lowest_shapes(network, values, progress));
  Stability stability(network, 1.0, Stability::most_exact_masses, progress);
  CHECK_FALSE(stability.is_exact());
  CHECK(stability.prove({values, values}) == Verdict::stable);
  // A chain of this size is easy.
  const Network straight = support::network_of(chain(4000));
  CHECK(lowest_shapes(straight, values, progress));
  CHECK(Stability(straight, 1.0).is_exact());
}

TEST_CASE("A load can be stopped at any point and frees all memory", "[load]") {
  constexpr std::uint64_t steps_per_look = 1500;
  const Preset preset = [] {
    const ParsedNetwork parsed = parse_network(varied);
    std::string all;
    for (const Diagnostic& diagnostic : parsed.diagnostics) {
      all += to_string(diagnostic, "varied") + "\n";
    }
    INFO(all);
    REQUIRE(parsed.ok());
    return default_preset(parsed.network, false);
  }();
  std::vector<std::string> stages;
  // Cancels the load after this number of progress calls, and returns the number of calls.
  const auto load = [&](std::size_t most) {
    std::size_t looks = 0;
    const Progress progress(
        [&](std::string_view stage) {
          if (most == std::numeric_limits<std::size_t>::max() &&
              (stages.empty() || stages.back() != stage)) {
            stages.emplace_back(stage);
          }
          return looks++ < most;
        },
        steps_per_look);
    const ParsedNetwork parsed = parse_network(varied, {.progress = progress});
    if (!parsed.ok()) {
      REQUIRE(parsed.diagnostics.size() == 1);
      CHECK(parsed.diagnostics[0].message == stopped);
      return looks;
    }
    const auto compiled = compile_network(
        parsed.network, preset,
        {.voices = 3, .most_modes = quick_modes, .find_gain = true, .progress = progress});
    CHECK(bool(compiled) == (looks <= most));
    if (!compiled) {
      CHECK(compiled.error().message == stopped);
    }
    return looks;
  };
  const std::size_t all = load(std::numeric_limits<std::size_t>::max());
  CAPTURE(stages);
  CHECK(stages.size() == 8);
  REQUIRE(all > 100);
  REQUIRE(all < 2000);
  load(all / 2);  // allocates static data
  const std::size_t before = support::heap_bytes();
  for (std::size_t most = 0; most < all; ++most) {
    CHECK(load(most) == most + 1);
  }
  CHECK(support::heap_bytes() == before);
}

TEST_CASE("The estimate of an engine's memory is within a factor of two", "[load]") {
  if (!support::heap_is_counted) {
    return;
  }
  struct Way {
    std::string text;
    Method method;
    Precision precision;
  };
  const std::string mesh =
      "@K param 0.01\n@s mesh 100 100 1. K 0.001 0. 0.\n@out1 posOutput [@s "
      "0.3 0.3]\n@in1 frcInput [@s 0.3 0.3]\n";
  const auto way = GENERATE_COPY(Way{chain(8000), Method::direct, Precision::float64},
                                 Way{chain(8000), Method::direct, Precision::float32},
                                 Way{chain(8000), Method::chains, Precision::float64},
                                 Way{mesh, Method::grid, Precision::float64},
                                 Way{chain(300), Method::modal, Precision::float64},
                                 Way{chain(8000), Method::oversampled, Precision::float64});
  const int voices = GENERATE(1, 16);
  const Network network = support::network_of(way.text);
  const auto compiled =
      compile_network(network, default_preset(network, true),
                      {.voices = voices, .precision = way.precision, .method = way.method});
  REQUIRE(compiled);
  REQUIRE(compiled->plan.parts.at(0).method == way.method);
  const Machine& machine = compiled->engine->machine();
  const std::size_t before = support::heap_bytes();
  const Engine again(machine, {.voices = voices}, way.precision);
  Machine copy = machine;
  const std::size_t held = support::heap_bytes();
  { const Machine gone = std::move(copy); }
  const auto of_machine = static_cast<double>(held - support::heap_bytes());
  const double taken = static_cast<double>(held - before) - 2.0 * of_machine;
  const auto predicted = static_cast<double>(engine_bytes(machine, voices, way.precision, nullptr));
  CAPTURE(method_name(way.method), voices, taken, predicted);
  CHECK(predicted > 0.5 * taken);
  CHECK(predicted < 2.0 * taken);
}

TEST_CASE("Voices that do not fit into memory are refused with the number that fits", "[load]") {
  const Network network = support::network_of(chain(8000));
  const Preset preset = default_preset(network, true);
  const auto compiled_in = [&](std::uint64_t most_bytes) {
    return compile_network(network, preset,
                           {.voices = 64, .method = Method::direct, .most_bytes = most_bytes});
  };
  const auto refused = compiled_in(5'000'000);
  REQUIRE_FALSE(refused);
  const std::string& text = refused.error().message;
  CAPTURE(text);
  CHECK(text.find("64 voices of 8000 masses need ") == 0);
  CHECK(text.find(" MB of memory, but only 5 MB are free; lower the voices to ") !=
        std::string::npos);
  const int fitting = std::stoi(text.substr(text.rfind(' ')));
  CHECK(fitting > 0);
  CHECK(compile_network(network, preset,
                        {.voices = fitting, .method = Method::direct, .most_bytes = 5'000'000}));
  const auto hopeless = compiled_in(1000);
  REQUIRE_FALSE(hopeless);
  CHECK(hopeless.error().message.find("use a smaller model") != std::string::npos);
}

}  // namespace ressort::load_test
