// Outputs give positions, velocities and accelerations. A mode that turns by theta per sample with
// the amplitude A has differences of the amplitude 2 A sin(theta/2), and second differences of the
// amplitude 4 A sin(theta/2)^2. Both are in units per sample at 44 100 Hz, whatever the rate.
#include <numbers>

#include "tests/support/player.h"

namespace ressort::derivatives_test {
namespace {

using namespace support;

constexpr double reference_hz = 44100.0;
constexpr double mode_hz = 500.0;

const std::string bell =
    "@bell body 1. rim\n@b mode @bell 500. 100. 1.\n@in1 frcInput [@bell rim]\n"
    "@out1 posOutput [@bell rim]\n@out2 velOutput [@bell rim]\n@out3 accOutput [@bell rim] 2.\n";

double peak_of(const std::vector<double>& samples) {
  double most = 0.0;
  for (const double sample : samples) {
    most = std::max(most, std::fabs(sample));
  }
  return most;
}

}  // namespace

TEST_CASE("outputs give the velocity and the acceleration of a mode", "[derivatives]") {
  for (const double rate_hz : {44100.0, 96000.0}) {
    for (const Precision precision : {Precision::float32, Precision::float64}) {
      CompileOptions options;
      options.rate_hz = rate_hz;
      options.precision = precision;
      Preset preset = struck(1);
      preset.keyboard = false;
      Player player(bell, preset, options);
      player.run(4000, {note_on(0, 60)}, {64, 3, 200});
      const double half = std::numbers::pi * mode_hz / rate_hz;
      const double slope = 2.0 * std::sin(half) * rate_hz / reference_hz;
      const double position = peak_of(player.out[0]);
      // The highest of 88 samples a period is within 1 - cos(pi/88) of the peak.
      constexpr double tolerance = 1e-3;
      INFO(rate_hz << " Hz, " << (precision == Precision::float32 ? "float" : "double"));
      CHECK(peak_of(player.out[1]) == Approx(slope * position).epsilon(tolerance));
      // The level of the third output is 2. A blow of one sample is an acceleration of its own, so
      // the peak of the vibration is taken after it.
      const std::vector<double> later(player.out[2].begin() + 1000, player.out[2].end());
      CHECK(peak_of(later) == Approx(2.0 * slope * slope * position).epsilon(2.0 * tolerance));
    }
  }
}

TEST_CASE("an output of velocity is the difference of the positions", "[derivatives]") {
  Preset preset = struck(4);
  Player player(bell, preset);
  player.run(3000, {note_on(0, 60), note_on(700, 67), note_off(1500, 60)}, {64, 17});
  const std::vector<double>& x = player.out[0];
  double worst = std::fabs(player.out[1][0] - x[0]);
  for (std::size_t n = 1; n < x.size(); ++n) {
    worst = std::max(worst, std::fabs(player.out[1][n] - (x[n] - x[n - 1])));
  }
  CHECK(worst < 1e-12 * peak_of(x));
  CHECK(peak_of(x) > 1e-3);
}

TEST_CASE("a falling mass has the acceleration of its gravity", "[derivatives]") {
  // Gravity written as an argument of a mass is a force of G/44100, towards -x.
  Player player("@m mass 2. 4.41 0. 0.\n@f ground 0.\n@s spring @m @f 0. 0.\n@out1 accOutput @m\n",
                Preset{});
  player.run(100);
  for (std::size_t n = 2; n < 100; ++n) {
    REQUIRE(player.out[0][n] == Approx(-0.5 * 4.41 / reference_hz).epsilon(1e-9));
  }
}

}  // namespace ressort::derivatives_test
