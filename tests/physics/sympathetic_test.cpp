// Open strings in a body: they resonate to partials that they share with a note, until dampers
// fall on them, and they never add energy.
#include <numbers>

#include "core/engine/energy.h"
#include "core/kernels/registry.h"
#include "tests/support/harness.h"
#include "tests/support/player.h"

namespace ressort::sympathetic_test {
namespace {

using support::Player;

// A board with two modes and the first two partials of a string at C3 (T60 60 s open, 0.33 s
// damped). All modes have a mass of 10 at the bridge.
constexpr double octave_hz = 261.626;
constexpr double open_t60_s = 60.0;
constexpr double mass = 10.0;
const std::string board =
    "@dampers param 1.\n@b body 10. bridge\n@b1 mode @b 97. 0.3 1.\n@b2 mode @b 353. 0.2 -0.8\n"
    "@C3_1 mode @b 130.813 1/(1/60+3*dampers) 0.05\n"
    "@C3_2 mode @b 261.626 1/(1/60+3*dampers) 0.04\n"
    "@in1 frcInput [@b bridge]\n@out1 posOutput [@b bridge]\n";

Compiled compiled(double dampers, Method method, double rate_hz) {
  Preset preset{.keyboard = false};
  preset.parameters.push_back(
      {.name = "dampers", .value = dampers, .minimum = 0.0, .maximum = 1.0});
  preset.controls.push_back({.source = ControlSource::audio, .number = 1, .target = "in1"});
  auto made =
      compile_network(support::network_of(board), preset, {.rate_hz = rate_hz, .method = method});
  REQUIRE(made);
  return *std::move(made);
}

// Returns the amplitude of the string's octave a second after a sine of force 1 at `hz` for
// `seconds`, by a Hann window of 0.3 s.
double halo(double dampers, double hz, double seconds, double rate_hz) {
  Player player(compiled(dampers, Method::modal, rate_hz));
  const auto frames = static_cast<std::size_t>(std::lround(seconds * rate_hz));
  const auto window = static_cast<std::size_t>(0.3 * rate_hz);
  std::vector<double> force(frames + static_cast<std::size_t>(0.9 * rate_hz) + window);
  for (std::size_t n = 0; n < frames; ++n) {
    force[n] = std::sin(2.0 * std::numbers::pi * hz / rate_hz * static_cast<double>(n));
  }
  const std::vector<const double*> channels = {force.data()};
  player.run(force.size(), {}, {256}, channels);
  const auto heard = std::span(player.y()).last(window);
  std::complex<double> sum;
  for (std::size_t n = 0; n < window; ++n) {
    const double turns = static_cast<double>(n) / static_cast<double>(window);
    sum += heard[n] * (1.0 - std::cos(2.0 * std::numbers::pi * turns)) *
           std::polar(1.0, -2.0 * std::numbers::pi * octave_hz / rate_hz * static_cast<double>(n));
  }
  return 2.0 * std::abs(sum) / static_cast<double>(window);
}

double db(double ratio) {
  return 20.0 * std::log10(ratio);
}

}  // namespace

// A mode M of frequency w, driven at its place (displacement u) by a force F sin(w t) for a time t
// that is short against its decay, swings by F u t/(2 M w). A force beside w by W swings it by
// 2 |sin(W t/2)| F u/(2 M w W).
TEST_CASE("an open string rings to the octave's note, and not to a foreign pitch",
          "[sympathetic]") {
  constexpr double foreign_hz = octave_hz * 1.0594631;  // a semitone higher
  constexpr double seconds = 7.5 / (foreign_hz - octave_hz);
  constexpr double displacement = 0.04;
  for (const double rate_hz : {44100.0, 48000.0, 96000.0}) {
    const double w = 2.0 * std::numbers::pi * octave_hz;
    const double decay = std::log(1000.0) / open_t60_s;
    const double unit = 44100.0 * 44100.0;  // per sample squared
    const double expected = displacement * displacement * unit * seconds / (2.0 * mass * w) *
                            std::exp(-decay * (0.5 * seconds + 1.05));
    const double octave = halo(0.0, octave_hz, seconds, rate_hz);
    CHECK(db(octave / expected) == Approx(0.0).margin(0.2));
    const double foreign = halo(0.0, foreign_hz, seconds, rate_hz);
    CHECK(db(octave / foreign) == Approx(db(7.5 * std::numbers::pi)).margin(0.5));
    // Dampers end it: 60 dB in a third of a second.
    CHECK(db(octave / halo(1.0, octave_hz, seconds, rate_hz)) > 150.0);
  }
}

TEST_CASE("dampers that move leave a body in modal form, equal to the direct form",
          "[sympathetic]") {
  std::vector<double> force(6000);
  support::Random random(3);
  for (double& sample : force) {
    sample = random.uniform(-1.0, 1.0);
  }
  std::vector<double> found[2];
  for (const Method method : {Method::direct, Method::modal}) {
    Player player(compiled(1.0, method, 44100.0));
    CHECK(player.compiled.plan.parts.at(0).method == method);
    const std::vector<const double*> channels = {force.data()};
    player.run(6000,
               {support::parameter(1000, 0, 0.0), support::parameter(3000, 0, 0.7),
                support::parameter(3100, 0, 0.2)},
               {256}, channels);
    CHECK(player.heap_calls == 0);
    found[method == Method::modal ? 1 : 0] = player.y();
  }
  support::Comparison comparison;
  for (std::size_t n = 0; n < 6000; ++n) {
    comparison.add(found[0][n], found[1][n]);
  }
  CHECK(comparison.relative() < 1e-9);
}

TEST_CASE("a board with open strings has no more energy than the force gave it, over 1e7 samples",
          "[sympathetic]") {
  support::Bare<double> bare(support::program_of(board));
  const Program& program = bare.program();
  std::vector<double> x(program.position.size());
  std::vector<double> v(x.size());
  const auto energy = [&] {
    const LaneValues<double> values{bare.kernel().coefficients.value.data(), bare.lanes()};
    return energy_of(program, values, x.data(), v.data()).value;
  };
  constexpr double shape[] = {1.0, -0.8, 0.05, 0.04};
  constexpr int rounds = 10;
  constexpr int driven = 20'000;
  constexpr int period = 1'000'000;
  constexpr int interval = 441;  // longer than a period of the lowest mode
  support::Random random(1);
  double work = 0.0;
  double most = 0.0;
  for (int round = 0; round < rounds; ++round) {
    double last = 0.0;
    for (int n = 0; n < period; ++n) {
      if (n % 5000 == 0 && n <= 2 * driven) {  // the pedal moves, driven and free
        bare.set_coefficients(0, {random.uniform(0.0, 1.0) < 0.5 ? 0.0 : 1.0}, 1.0, true);
      }
      const double force = n < driven ? random.uniform(-1.0, 1.0) : 0.0;
      double speed = 0.0;
      for (std::size_t i = 0; n < driven && i < std::size(shape); ++i) {
        speed += 0.5 * shape[i] * v[i];
      }
      bare.step({force});
      if (n >= driven && n % interval != 0) {
        continue;
      }
      REQUIRE(bare.kernel().save(0, x.data(), v.data()));
      for (std::size_t i = 0; n < driven && i < std::size(shape); ++i) {
        speed += 0.5 * shape[i] * v[i];
      }
      work += force * speed;
      if (n % interval != 0) {
        continue;
      }
      const double now = energy();
      most = std::max(most, now);
      if (!(now <= work * (1.0 + 1e-9) + 1e-300)) {
        FAIL("energy " << now << " of " << work << " in round " << round << ", sample " << n);
      }
      if (n > driven + interval && !(now <= last * (1.0 + 1e-9) + 1e-300)) {
        FAIL("energy rises from " << last << " to " << now << " in sample " << n);
      }
      last = now;
    }
  }
  CHECK(most > 0.01 * work / rounds);
}

}  // namespace ressort::sympathetic_test
