#include "core/analysis/timbre/window.h"

#include <cmath>
#include <numbers>

namespace ressort::analysis {
namespace {

using Complex = std::complex<double>;

// Returns e^z - 1 without cancellation near 0.
Complex expm1(Complex z) {
  const double half = std::sin(0.5 * z.imag());
  return {std::expm1(z.real()) * std::cos(z.imag()) - 2.0 * half * half,
          std::exp(z.real()) * std::sin(z.imag())};
}

// Returns the sum of e^(log_z m) over m < size.
Complex geometric_sum(Complex log_z, double size) {
  // Reduces the angle to half a turn, so that whole turns are near 0.
  const Complex near(log_z.real(), std::remainder(log_z.imag(), 2.0 * std::numbers::pi));
  const Complex step = expm1(near);
  return std::abs(step) * size < 1e-12 ? Complex(size) : expm1(size * near) / step;
}

}  // namespace

std::vector<double> window_weights(Window window, std::size_t size) {
  const auto cosines = window_cosines(window);
  std::vector<double> weights(size);
  for (std::size_t m = 0; m < size; ++m) {
    const double turn = 2.0 * std::numbers::pi * static_cast<double>(m) / static_cast<double>(size);
    weights[m] = cosines[0] + cosines[1] * std::cos(turn) + cosines[2] * std::cos(2.0 * turn);
  }
  return weights;
}

std::complex<double> window_response(Window window, std::size_t size, std::complex<double> log_z) {
  const auto cosines = window_cosines(window);
  const auto length = static_cast<double>(size);
  Complex sum = cosines[0] * geometric_sum(log_z, length);
  for (std::size_t j = 1; j < cosines.size(); ++j) {
    if (cosines[j] != 0.0) {
      const Complex turn(0.0, 2.0 * std::numbers::pi * static_cast<double>(j) / length);
      sum += 0.5 * cosines[j] *
             (geometric_sum(log_z + turn, length) + geometric_sum(log_z - turn, length));
    }
  }
  return sum / (cosines[0] * length);
}

}  // namespace ressort::analysis
