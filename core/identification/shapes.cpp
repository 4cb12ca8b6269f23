#include "core/identification/shapes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace ressort::identification {

std::vector<BodyShape> body_shapes(const std::vector<IdentifiedMode>& modes, double mass) {
  constexpr double reference_rate_hz = 44100.0;
  std::vector<BodyShape> shapes;
  std::vector<double> moved;  // [mode] p q / M, summed over the channels.
  for (const IdentifiedMode& mode : modes) {
    const double r = std::pow(10.0, -3.0 / (reference_rate_hz * mode.t60_s.value));
    const double theta = 2.0 * std::numbers::pi * mode.frequency_hz.value / reference_rate_hz;
    BodyShape shape;
    double square = 0.0;
    for (std::size_t c = 0; c < mode.amplitude.size(); ++c) {
      const double gain = mode.amplitude[c].value * r * std::sin(theta);
      const bool is_turned = std::cos(mode.phase_rad[c].value + 0.5 * std::numbers::pi) < 0.0;
      shape.heard.push_back(is_turned ? -gain : gain);
      const double phase = mode.phase_rad[c].value;
      const double velocity = r * std::cos(phase) / std::sin(theta);
      const double position = -std::sin(phase) - velocity * (1.0 - std::cos(theta) / r);
      shape.position.push_back(gain * position);
      shape.velocity.push_back(gain * velocity);
      square += gain * gain;
    }
    moved.push_back(std::sqrt(square));
    shapes.push_back(std::move(shape));
  }
  const double most = moved.empty() ? 1.0 : *std::ranges::max_element(moved);
  for (std::size_t k = 0; k < shapes.size(); ++k) {
    shapes[k].hit = std::sqrt(moved[k] / most);
    for (auto* const heard : {&shapes[k].heard, &shapes[k].position, &shapes[k].velocity}) {
      for (double& each : *heard) {
        each *= mass / shapes[k].hit;
      }
    }
  }
  return shapes;
}

}  // namespace ressort::identification
