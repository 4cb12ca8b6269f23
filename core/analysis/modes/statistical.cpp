#include "core/analysis/modes/statistical.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>

#include "core/random.h"

namespace ressort::analysis {
namespace {

// Distributions by the inverse of their function and by the Box-Muller transform, because those of
// the standard libraries differ.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  // Above 0, at most 1.
  double share() { return static_cast<double>((splitmix64(state_) >> 11) + 1) * 0x1p-53; }
  double gaussian() {
    const double radius = std::sqrt(-2.0 * std::log(share()));
    return radius * std::cos(2.0 * std::numbers::pi * share());
  }
  // Rayleigh distributed with mean 1.
  double spacing() { return std::sqrt(-4.0 / std::numbers::pi * std::log(share())); }

 private:
  std::uint64_t state_;
};

double at_frequency(std::vector<CurvePoint> points, double frequency_hz) {
  for (CurvePoint& point : points) {
    point[0] = std::log(point[0]);
  }
  return value_at(points, std::log(frequency_hz));
}

// Returns points of the mean number of modes below a frequency, and this frequency.
std::vector<CurvePoint> frequency_by_number(const std::vector<CurvePoint>& density) {
  constexpr int steps = 4096;
  const double low_hz = density.front()[0];
  const double high_hz = density.back()[0];
  std::vector<CurvePoint> points{{0.0, low_hz}};
  double before = density.front()[1];
  for (int k = 1; k <= steps; ++k) {
    const double hz = low_hz * std::pow(high_hz / low_hz, static_cast<double>(k) / steps);
    const double now = at_frequency(density, hz);
    points.push_back({points.back()[0] + 0.5 * (before + now) * (hz - points.back()[1]), hz});
    before = now;
  }
  return points;
}

// Six digits are far finer than any ear, and keep the files short.
double rounded(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return std::strtod(text, nullptr);
}

}  // namespace

double mean_mode_count(const std::vector<CurvePoint>& density) {
  return frequency_by_number(density).back()[0];
}

PlacedModes statistical_modes(const BodyStatistics& body) {
  PlacedModes out{.mass = body.mass, .places = {"bridge", "left", "right"}};
  const auto add = [&](double hz, double loss, double bridge, double left, double right) {
    const double db = body.radiation.empty() ? 0.0 : at_frequency(body.radiation, hz);
    const double heard = hz / velocity_reference_hz * std::pow(10.0, db / 20.0);
    const double t60_s = 3.0 * std::numbers::ln10 / (std::numbers::pi * hz * loss);
    out.modes.push_back(
        {.frequency_hz = rounded(hz),
         .t60_s = rounded(t60_s),
         .displacement = {rounded(bridge), rounded(left * heard), rounded(right * heard)}});
  };
  for (const GivenMode& mode : body.given) {
    add(mode.frequency_hz, 1.0 / mode.q, mode.bridge, mode.left, mode.right);
  }
  const std::vector<CurvePoint> frequencies = frequency_by_number(body.density);
  Random random(body.seed);
  // The first distance is the rest of one that began below the range, so that the density is the
  // same from the start: its distribution is half a Gaussian.
  double number = std::sqrt(2.0 / std::numbers::pi) * std::fabs(random.gaussian());
  while (number < frequencies.back()[0]) {
    const double hz = value_at(frequencies, number);
    const double bridge = random.gaussian();
    const double left = random.gaussian();
    const double right = random.gaussian();
    add(hz, at_frequency(body.loss, hz), bridge, left, right);
    number += random.spacing();
  }
  return out;
}

}  // namespace ressort::analysis
