#include "core/identification/shapes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace ressort::identification {

std::vector<BodyShape> body_shapes(const Identification& found, double mass) {
  constexpr double reference_rate_hz = 44100.0;
  std::vector<BodyShape> shapes;
  std::vector<double> moved;  // [mode] p q / M, summed over the channels.
  for (const IdentifiedMode& mode : found.modes) {
    const double r = std::pow(10.0, -3.0 / (reference_rate_hz * mode.t60_s.value));
    const double theta = 2.0 * std::numbers::pi * mode.frequency_hz.value / reference_rate_hz;
    BodyShape shape;
    double square = 0.0;
    for (std::size_t c = 0; c < mode.amplitude.size(); ++c) {
      const double gain = mode.amplitude[c].value * r * std::sin(theta);
      const bool is_turned = std::cos(mode.phase_rad[c].value + 0.5 * std::numbers::pi) < 0.0;
      shape.heard.push_back(is_turned ? -gain : gain);
      square += gain * gain;
    }
    moved.push_back(std::sqrt(square));
    shapes.push_back(std::move(shape));
  }
  const double most = moved.empty() ? 1.0 : *std::max_element(moved.begin(), moved.end());
  for (std::size_t k = 0; k < shapes.size(); ++k) {
    shapes[k].hit = std::sqrt(moved[k] / most);
    for (double& heard : shapes[k].heard) {
      heard *= mass / shapes[k].hit;
    }
  }
  return shapes;
}

}  // namespace ressort::identification
