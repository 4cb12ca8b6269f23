// Modal strings: partials, places, the force on the bridge, and the two slopes of coupled strings
// (Weinreich 1977).
#include <complex>
#include <numbers>
#include <numeric>

#include "core/engine/energy.h"
#include "core/model/language/expression.h"
#include "tests/support/partial.h"
#include "tests/support/passive.h"
#include "tests/support/player.h"

namespace ressort::modal_string_test {
namespace {

using namespace support;

constexpr double pi = std::numbers::pi;
using Complex = std::complex<double>;

std::string digits(double value) {
  return print_number(value);
}

std::vector<double> struck(const Program& program, std::size_t frames) {
  Bare<double> bare(program);
  std::vector<double> sound;
  for (std::size_t n = 0; n < frames; ++n) {
    sound.push_back(bare.step({n == 0 ? 1.0 : 0.0})[0]);
  }
  return sound;
}

std::vector<double> struck(const std::string& text, double rate_hz, std::size_t frames) {
  return struck(make_program(network_of(text), rate_hz, true), frames);
}

// The mean motion of strings that start alike, relative to its start: 1/N 1^T exp(A t) 1. String k
// turns by `offsets[k]` (rad/s) from the mean, and all lose the rate g of their common motion.
double level_of_strings(const std::vector<double>& offsets, double g, double seconds) {
  const std::size_t count = offsets.size();
  std::vector<Complex> x(count, 1.0);
  // Taylor series of exp(A dt), whose next term is below 1e-18 for |A| dt < 1.
  constexpr int terms = 20;
  double most = static_cast<double>(count) * g;
  for (const double offset : offsets) {
    most = std::max(most, static_cast<double>(count) * g + std::fabs(offset));
  }
  const int steps = 1 + static_cast<int>(most * seconds);
  for (int step = 0; step < steps; ++step) {
    std::vector<Complex> term = x;
    for (int n = 1; n <= terms; ++n) {
      const Complex common = -g * std::accumulate(term.begin(), term.end(), Complex());
      for (std::size_t k = 0; k < count; ++k) {
        term[k] = (common + Complex(0.0, offsets[k]) * term[k]) * (seconds / steps / n);
        x[k] += term[k];
      }
    }
  }
  return std::abs(std::accumulate(x.begin(), x.end(), Complex())) / static_cast<double>(count);
}

// The level of a partial in a Hann window around a time.
double level_at(const std::vector<double>& y, double rate_hz, double hz, double seconds,
                double window_s) {
  const auto half = static_cast<std::ptrdiff_t>(0.5 * window_s * rate_hz);
  const auto middle = static_cast<std::ptrdiff_t>(seconds * rate_hz);
  Complex sum;
  for (std::ptrdiff_t n = -half; n <= half; ++n) {
    const double turn = pi * static_cast<double>(n) / static_cast<double>(half);
    const double window = 0.5 + 0.5 * std::cos(turn);
    sum += window * y[static_cast<std::size_t>(middle + n)] *
           std::polar(1.0, -2.0 * pi * hz * static_cast<double>(middle + n) / rate_hz);
  }
  return 2.0 * std::abs(sum) / static_cast<double>(half);
}

}  // namespace

TEST_CASE("a modal string sounds its partials with their decay at every rate", "[modal_string]") {
  constexpr double b = 3.2e-4;
  const std::string text =
      "@s modalString 16 3. 261.6 3.2e-4 0.88 0.35 1e-4\n@in1 frcInput [@s 0.123]\n"
      "@out1 posOutput [@s bridge]\n";
  for (const double rate_hz : {44100.0, 48000.0, 96000.0}) {
    const std::vector<double> sound =
        struck(text, rate_hz, static_cast<std::size_t>(2.1 * rate_hz));
    for (const int n : {1, 2, 5, 10, 16}) {
      const double hz = n * 261.6 * std::sqrt((1.0 + b * n * n) / (1.0 + b));
      const double sigma = 0.88 + 0.35 * n + 1e-4 * n * n * n;
      const HeardPartial heard = partial_of(sound, rate_hz, hz, 0.0, 1.0, 1.0);
      INFO(n << " at " << rate_hz);
      CHECK(std::fabs(cents(heard.hz, hz)) < 0.01);
      CHECK(heard.t60_s == Approx(std::log(1000.0) / sigma).epsilon(0.002));
    }
  }
}

TEST_CASE("a steady force at x presses on the bridge with the share x", "[modal_string]") {
  // The mode of partial n yields by F sin(n pi x) / (n^2 K) without stiffness, K that of partial 1.
  // The bridge's place therefore reads F/K times the sum of (-1)^(n+1) sin(n pi x) / n, which is pi
  // x / 2.
  constexpr double omega = 2.0 * pi * 100.0 / 44100.0;
  constexpr double sigma = 60.0 / 44100.0;
  for (const double x : {0.1, 0.35, 0.6}) {
    Bare<double> bare(
        make_program(network_of("@s modalString 200 2. 100. 0 60 0 0\n@in1 frcInput [@s " +
                                digits(x) + "]\n@out1 posOutput [@s bridge]\n"),
                     44100.0, true));
    double pressed = 0.0;
    for (int n = 0; n < 10000; ++n) {
      pressed = bare.step({1.0})[0];
    }
    double expected = 0.0;
    for (int n = 1; n <= 200; ++n) {
      expected += (n % 2 == 1 ? 1.0 : -1.0) * n * std::sin(n * pi * x) /
                  (n * n * omega * omega + sigma * sigma);
    }
    INFO(x);
    // Modes far above 0.456 of the rate are static. The loss adds to the stiffness.
    CHECK(pressed == Approx(expected).epsilon(0.01));
    CHECK(pressed * omega * omega == Approx(0.5 * pi * x).epsilon(0.03));
  }
}

TEST_CASE("a place that a parameter sets is the place of that number", "[modal_string]") {
  const std::string head = "@u param 0.137\n@s modalString 12 2. 300. 1e-4 1 0.2 0\n";
  const std::string tail = "]\n@out1 posOutput [@s 0.7]\n";
  const std::vector<double> fixed = struck(head + "@in1 frcInput [@s 0.137" + tail, 44100.0, 9000);
  const std::vector<double> set = struck(head + "@in1 frcInput [@s u" + tail, 44100.0, 9000);
  for (int n = 1; n <= 12; ++n) {
    const double hz = n * 300.0 * std::sqrt((1.0 + 1e-4 * n * n) / (1.0 + 1e-4));
    const auto level = [&](const std::vector<double>& y) {
      return level_at(y, 44100.0, hz, 0.1, 0.19);
    };
    // A line between points that are h apart misses a sine by at most (n pi h)^2 / 8.
    const double miss = std::pow(n * pi / (8.0 * 12.0), 2) / 8.0;
    INFO(n);
    const double share = std::fabs(std::sin(n * pi * 0.137));
    CHECK(level(set) == Approx(level(fixed)).epsilon(miss / share + 1e-4));
  }
}

TEST_CASE("all keys sound at a place that a parameter sets", "[modal_string]") {
  // Partials above half the rate must not silence a key. Masses step the moving place, exact modes
  // the fixed one: they scale a force by the ratio of the sampled stiffness to the continuous one,
  // 4 sin^2(w/2) / w^2.
  constexpr double rate_hz = 44100.0;
  const auto played = [&](const std::string& in, const std::string& out, int key) {
    const Preset preset = support::struck(1);
    Player player(
        "@u param 0.137\n@s modalString 64 2. 110. 0 1 0 0\n"
        "@in1 frcInput [@s " +
            in + "]\n@out1 posOutput [@s " + out + "]\n",
        preset);
    player.run(14000, {note_on(0, key)});
    return player.out[0];
  };
  for (const int key : {48, 72, 96}) {
    const double hz = 440.0 * std::exp2((key - 69) / 12.0);
    const std::vector<double> fixed = played("0.137", "0.3", key);
    for (const bool is_heard : {false, true}) {
      const std::vector<double> set = is_heard ? played("0.3", "u", key) : played("u", "0.3", key);
      for (int n = 1; n <= 6; ++n) {
        const auto level = [&](const std::vector<double>& y) {
          return level_at(y, rate_hz, n * hz, 0.2, 0.2);
        };
        const double half = pi * n * hz / rate_hz;
        const double miss = std::pow(n * pi / (8.0 * 64.0), 2) / 8.0;
        const double share = std::fabs(std::sin(n * pi * 0.137));
        INFO("key " << key << ", partial " << n << (is_heard ? ", heard" : ", struck"));
        CHECK(
            level(set) ==
            Approx(level(fixed) * std::pow(half / std::sin(half), 2)).epsilon(miss / share + 1e-3));
      }
    }
  }
}

TEST_CASE("strings over one bridge have the slopes of Weinreich's matrix", "[modal_string]") {
  struct Case {
    int strings;
    double cents;
    double g;
    int partial;
  };
  for (const Case& c : {Case{1, 0.0, 1.4, 1}, Case{2, 0.8, 0.7, 1}, Case{2, 4.0, 0.7, 1},
                        Case{3, 1.2, 0.5, 1}, Case{2, 0.25, 0.7, 3}, Case{3, 0.25, 0.5, 4}}) {
    constexpr double hz = 261.6;
    constexpr double rate_hz = 44100.0;
    constexpr double loss = 0.2;
    const std::vector<double> sound = struck(
        "@s modalString 5 3. 261.6 0 0.2 0 0 " + std::to_string(c.strings) + " " + digits(c.cents) +
            " " + digits(c.g) + "\n@in1 frcInput [@s 0.13]\n@out1 posOutput [@s bridge]\n",
        rate_hz, static_cast<std::size_t>(9.5 * rate_hz));
    std::vector<double> offsets;
    for (int k = 0; k < c.strings; ++k) {
      const double by = c.strings > 1 ? k / (c.strings - 1.0) - 0.5 : 0.0;
      offsets.push_back(2.0 * pi * c.partial * hz * (std::exp2(c.cents * by / 1200.0) - 1.0));
    }
    const auto expected = [&](double s) {
      return level_of_strings(offsets, c.g, s) * std::exp(-loss * s);
    };
    const auto level = [&](double s) { return level_at(sound, rate_hz, c.partial * hz, s, 0.05); };
    const double first = level(0.1) / expected(0.1);
    INFO(c.strings << " strings, " << c.cents << " cents, partial " << c.partial);
    double largest = 0.0;
    for (double s = 0.1; s < 9.3; s += 0.31) {
      if (expected(s) < 0.6 * std::max(expected(std::max(0.0, s - 0.3)), expected(s + 0.3))) {
        continue;  // beside a zero of the beat, which the window does not resolve
      }
      largest = std::max(largest, std::fabs(20.0 * std::log10(level(s) / first / expected(s))));
    }
    CHECK(largest < 0.5);
    // The early and the late T60, and the aftersound's level.
    const auto t60 = [&](auto&& of, double from, double to) {
      return 60.0 * (to - from) / (20.0 * std::log10(of(from) / of(to)));
    };
    if (c.cents < 2.0) {
      CHECK(t60(level, 0.1, 0.6) == Approx(t60(expected, 0.1, 0.6)).epsilon(0.02));
      CHECK(t60(level, 7.0, 9.3) == Approx(t60(expected, 7.0, 9.3)).epsilon(0.02));
    }
    if (c.strings > 1 && c.cents == 0.8 && c.partial == 1) {
      const double d = offsets[1] - offsets[0];
      const double s = std::sqrt(c.g * c.g - d * d / 4.0);
      CHECK(t60(level, 7.0, 9.3) == Approx(std::log(1000.0) / (loss + c.g - s)).epsilon(0.02));
      CHECK(t60(level, 7.0, 9.3) > 3.0 * t60(level, 0.1, 0.6));
    }
  }
}

TEST_CASE("a felt that lies on a string damps each partial by its motion there", "[modal_string]") {
  // To first order, a damper Z at x adds Z sin(n pi x)^2 / M per sample to the decay rate of
  // partial n: its mode has the mass M/2. A mode that rests at x keeps its own rate. The felt may
  // press with any Z without more steps: a hard one decouples the two sides of x.
  constexpr double loss = 0.5;
  constexpr double mass = 3.0;
  constexpr double felt = 2e-4;
  const auto with_felt = [&](double z) {
    return struck(program_of("@s modalString 12 3. 220. 0 0.5 0 0\n@in1 frcInput [@s 0.13]\n"
                             "@g ground 0.\n@felt contact @g [@s 0.2] 1e-9 " +
                                 digits(z) + " 1000.\n@out1 posOutput [@s bridge]\n",
                             Passivity::always),
                  30000);
  };
  const std::vector<double> sound = with_felt(felt);
  for (int n = 1; n <= 6; ++n) {
    const double fall = std::log(level_at(sound, 44100.0, n * 220.0, 0.1, 0.1) /
                                 level_at(sound, 44100.0, n * 220.0, 0.5, 0.1)) /
                        0.4;
    INFO(n);
    CHECK(fall ==
          Approx(loss + 44100.0 * felt / mass * std::pow(std::sin(0.2 * n * pi), 2)).margin(2e-4));
  }
  const std::vector<double> hard = with_felt(1e3);
  CHECK(
      level_at(hard, 44100.0, 5.0 * 220.0, 0.5, 0.1) ==
      Approx(level_at(hard, 44100.0, 5.0 * 220.0, 0.1, 0.1) * std::exp(-0.4 * loss)).epsilon(1e-5));
}

TEST_CASE("a hammer on coupled strings never gains energy", "[modal_string]") {
  // A hammer falls on three strings again and again, for a million samples.
  Stepper<double> lab(
      "@h massG 20. 2e-7 0.3 0.3\n@s modalString 6 3. 261.6 3e-4 0.05 0.02 0 3 1. 0.02\n"
      "@k powerContact [@s 0.12] @h 0.4 2.5\n@out1 posOutput [@s bridge]\n",
      Passivity::always);
  std::vector<double> values;
  for (const Coefficient& coefficient : lab.program().coefficients) {
    values.push_back(coefficient_value(lab.program(), coefficient, lab.program().parameters, 1.0));
  }
  const engine::LaneValues<double> lane{.value = values.data()};
  const auto energy = [&] {
    return engine::energy_of(lab.program(), lane, lab.x.data(), lab.v.data());
  };
  lab.go();
  double before = energy().value;
  const double start = before;
  double gained = 0.0;
  for (int n = 0; n < 1000000; ++n) {
    lab.go();
    const double now = energy().value;
    gained = std::max(gained, now - before);
    before = now;
  }
  CHECK(before < start);
  CHECK(gained < 1e-9 * start);
}

}  // namespace ressort::modal_string_test
