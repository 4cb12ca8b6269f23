// A model sounds the same at every sample rate, except for the deviation of the explicit scheme.
// All figures are derived. Let k and z be the lowest mode's stiffness and damping over its mass,
// and r = 44100 / rate. The scheme steps k r^2 and z r, so a mode turns by theta per sample and
// shrinks by rho with rho^2 = 1 - z r,   cos(theta) = (2 - k r^2 - z r) / (2 rho), and a force of r
// for one sample makes it ring with the amplitude r / sin(theta).
#include <complex>

#include "core/model/language/expression.h"
#include "tests/support/player.h"

namespace ressort::rate_test {
namespace {

using namespace support;
using std::numbers::pi;

constexpr double reference_hz = 44100.0;
constexpr double rates_hz[] = {44100.0, 48000.0, 88200.0, 96000.0, 192000.0};

struct Scene {
  std::string name;
  std::string text;
  double k = 0.0;      // stiffness of the lowest mode, over its mass
  double z = 0.0;      // the same for damping
  double share = 1.0;  // share of the mode's amplitude from the input to the output
};

// A continuous oscillator at 1000 Hz with a T60 of one second.
Scene oscillator() {
  const double z = 2.0 * std::log(1000.0) / reference_hz;
  const double turn = 2.0 * pi * 1000.0 / reference_hz;
  const double k = turn * turn + z * z / 4.0;
  return {"oscillator",
          "@o osc 1 " + print_number(k) + " " + print_number(z) +
              " 0 0\n@in1 frcInput @o\n@out1 posOutput @o\n",
          k, z};
}

// A sine over 20 masses between two grounds.
Scene string() {
  const auto shape = [](int i) { return std::sqrt(2.0 / 21.0) * std::sin(pi * (i + 1) / 21.0); };
  const double curvature = 2.0 * std::sin(pi / 42.0);
  const double stretch = curvature * curvature;
  return {
      "string",
      scenes::string("s", 20, "0.1", "0.02") + "@in1 frcInput @s_m3\n" + scenes::output(1, "s_m12"),
      0.1 * stretch, 0.02 * stretch, shape(3) * shape(12)};
}

// Three masses on a ground by half a spring: the shape (1, y, y) belongs to the smaller root of
// l^2 - 3.5 l + 0.5, with y = (2.5 - l)/2.
Scene triangle() {
  const double stretch = (3.5 - std::sqrt(10.25)) / 2.0;
  const double y = (2.5 - stretch) / 2.0;
  return {"triangle",
          "@g ground 0\n@a mass 1 0 0\n@b mass 1 0 0\n@c mass 1 0 0\n"
          "@ga springDamper @g @a 0.05 0.001\n@ab springDamper @a @b 0.1 0.002\n"
          "@bc springDamper @b @c 0.1 0.002\n@ca springDamper @c @a 0.1 0.002\n"
          "@in1 frcInput @b\n@out1 posOutput @c\n",
          0.1 * stretch, 0.002 * stretch, y * y / (1.0 + 2.0 * y * y)};
}

// Returns output 1 after an impulse of force 1, as a bare model is rendered.
std::vector<double> struck_once(const Scene& scene, double rate_hz, double seconds,
                                bool rescale = true) {
  const Preset preset = default_preset(network_of(scene.text), true);
  Player player(scene.text, preset, {.rate_hz = rate_hz, .rescale = rescale, .bare = true});
  const Event impulse{
      .kind = EventKind::gesture, .gesture = Gesture::force, .index = 1, .value = 1.0};
  player.run(static_cast<std::size_t>(std::llround(seconds * rate_hz)), {impulse});
  return player.y();
}

struct Ring {
  double hz = 0.0;
  double decay = 0.0;      // 1/s
  double amplitude = 0.0;  // amplitude at the start
};

// Measures pitch and decay of the mode near a guess, from its phase and level in two windows 0.1 s
// apart. The Blackman-Harris window keeps the other modes 92 dB down.
Ring measured(std::span<const double> y, double rate_hz, double guess_hz) {
  const auto width = static_cast<std::size_t>(0.1 * rate_hz);
  const auto apart = static_cast<std::size_t>(0.2 * rate_hz);
  const auto window = [&](std::size_t n) {
    const double a = 2.0 * pi * static_cast<double>(n) / static_cast<double>(width);
    return 0.35875 - 0.48829 * std::cos(a) + 0.14128 * std::cos(2 * a) - 0.01168 * std::cos(3 * a);
  };
  const auto heard = [&](std::size_t from, double hz) {
    const double turn = 2.0 * pi * hz / rate_hz;
    std::complex<double> sum = 0.0;
    for (std::size_t n = 0; n < width; ++n) {
      sum += window(n) * y[from + n] * std::polar(1.0, -turn * static_cast<double>(from + n));
    }
    return sum;
  };
  const std::complex<double> change = heard(apart, guess_hz) / heard(0, guess_hz);
  const double seconds = static_cast<double>(apart) / rate_hz;
  Ring ring{.hz = guess_hz + std::arg(change) / (2.0 * pi * seconds),
            .decay = -std::log(std::abs(change)) / seconds};
  double whole = 0.0;
  for (std::size_t n = 0; n < width; ++n) {
    whole += 0.5 * window(n) * std::exp(-ring.decay * static_cast<double>(n) / rate_hz);
  }
  ring.amplitude = std::abs(heard(0, ring.hz)) / whole;
  return ring;
}

Ring by_formula(const Scene& scene, double rate_hz) {
  const double r = reference_hz / rate_hz;
  const double left = 1.0 - scene.z * r;
  const double theta = std::acos((2.0 - scene.k * r * r - scene.z * r) / (2.0 * std::sqrt(left)));
  return {.hz = rate_hz * theta / (2.0 * pi),
          .decay = -0.5 * std::log(left) * rate_hz,
          .amplitude = scene.share * r / std::sin(theta)};
}

// The solution of m x'' + z x' + k x = 0, which the scheme approaches as the rate grows.
Ring continuous(const Scene& scene) {
  const double turn = std::sqrt(scene.k - scene.z * scene.z / 4.0);
  return {.hz = reference_hz * turn / (2.0 * pi),
          .decay = reference_hz * scene.z / 2.0,
          .amplitude = scene.share / turn};
}

double cents(double hz, double against_hz) {
  return 1200.0 * std::log2(hz / against_hz);
}

}  // namespace

TEST_CASE("pitch, decay and impulse amplitude follow the scheme's formulas at every rate",
          "[rate]") {
  for (const Scene& scene : {oscillator(), string(), triangle()}) {
    for (const double rate_hz : rates_hz) {
      const Ring expected = by_formula(scene, rate_hz);
      const Ring found = measured(struck_once(scene, rate_hz, 0.31), rate_hz, continuous(scene).hz);
      INFO(scene.name << " at " << rate_hz << " Hz: " << show(found.hz) << " Hz, "
                      << show(cents(found.hz, expected.hz)) << " cents, decay "
                      << show(found.decay / expected.decay - 1.0) << ", amplitude "
                      << show(found.amplitude / expected.amplitude - 1.0));
      CHECK(std::fabs(cents(found.hz, expected.hz)) < 1e-5);
      CHECK(found.decay == Approx(expected.decay).epsilon(1e-6));
      CHECK(found.amplitude == Approx(expected.amplitude).epsilon(1e-5));
    }
  }
}

TEST_CASE("a model differs between rates only by the scheme's deviation", "[rate]") {
  // First-order formulas of the scheme: a mode is sharp by k r^2/24 + z r/4, decays faster by z
  // r/2, and an impulse is louder by k r^2/8 - z r/4.
  const double cent = std::log(2.0) / 1200.0;
  for (const Scene& scene : {oscillator(), string(), triangle()}) {
    const Ring limit = continuous(scene);
    for (const double rate_hz : rates_hz) {
      const double r = reference_hz / rate_hz;
      const double stiffness = scene.k * r * r;
      const double damping = scene.z * r;
      const Ring found = measured(struck_once(scene, rate_hz, 0.31), rate_hz, limit.hz);
      INFO(scene.name << " at " << rate_hz << " Hz: sharp by " << show(cents(found.hz, limit.hz))
                      << " cents, decay " << show(found.decay / limit.decay - 1.0) << ", amplitude "
                      << show(found.amplitude / limit.amplitude - 1.0));
      const double sharp = (stiffness / 24.0 + damping / 4.0) / cent;
      CHECK(cents(found.hz, limit.hz) == Approx(sharp).epsilon(0.003));
      CHECK(found.decay / limit.decay - 1.0 == Approx(damping / 2.0).margin(1e-6));
      const double louder = stiffness / 8.0 - damping / 4.0;
      CHECK(found.amplitude / limit.amplitude - 1.0 == Approx(louder).margin(2e-5));
    }
  }
  // The figures in the manual, for a mode at 1 kHz that rings for a second.
  const Scene scene = oscillator();
  const auto at = [&](double rate_hz) {
    return measured(struck_once(scene, rate_hz, 0.31), rate_hz, 1000.0);
  };
  const Ring low = at(44100.0);
  const Ring high = at(192000.0);
  CHECK(cents(low.hz, high.hz) > 1.4);
  CHECK(cents(low.hz, high.hz) < 1.5);
  CHECK(low.decay / high.decay - 1.0 == Approx(1.2e-4).margin(1e-6));
  CHECK(low.amplitude / high.amplitude - 1.0 == Approx(0.0024).margin(1e-4));
}

TEST_CASE("raw numbers give the same samples at every rate", "[rate]") {
  for (const Scene& scene : {oscillator(), string(), triangle()}) {
    const std::vector<double> expected = struck_once(scene, reference_hz, 0.05);
    for (const double rate_hz : rates_hz) {
      const double seconds = 0.05 * reference_hz / rate_hz;
      INFO(scene.name << " at " << rate_hz << " Hz");
      CHECK(struck_once(scene, rate_hz, seconds, false) == expected);
    }
  }
}

}  // namespace ressort::rate_test
