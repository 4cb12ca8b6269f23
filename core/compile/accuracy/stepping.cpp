#include "core/compile/accuracy/stepping.h"

#include <cmath>

#include "core/kernels/modal/modal_form.h"
#include "core/kernels/oversampled/oversampled_form.h"
#include "core/kernels/program.h"
#include "core/linear_algebra/eigen.h"

namespace ressort::compile {
namespace {

using Complex = std::complex<double>;

Matrix times(double factor, Matrix matrix) {
  matrix.values *= factor;
  return matrix;
}

// Returns the matrix of one step of symplectic Euler on (x, v): v += -K x - Z v, x += v.
Matrix step_of(const Matrix& k, const Matrix& z) {
  const std::size_t n = k.rows();
  Matrix step(2 * n, 2 * n);
  for (std::size_t j = 0; j < n; ++j) {
    step(j, j) = 1.0;
    step(j, n + j) = 1.0;
    step(n + j, n + j) = 1.0;
    for (std::size_t i = 0; i < n; ++i) {
      step(i, j) -= k(i, j);
      step(n + i, j) -= k(i, j);
      step(i, n + j) -= z(i, j);
      step(n + i, n + j) -= z(i, j);
    }
  }
  return step;
}

}  // namespace

std::optional<Complex> continuous_pole(double stiffness, double damping) {
  const double square = stiffness - 0.25 * damping * damping;
  return square > 0.0 ? std::optional(Complex(-0.5 * damping, std::sqrt(square))) : std::nullopt;
}

Stepping stepping_of(const Form& form) {
  if (const auto* modes = form.get_if<Modes>()) {
    return {modes->is_exact ? Stepping::Scheme::exact : Stepping::Scheme::published};
  }
  if (const auto* oversampled = form.get_if<Oversampled>()) {
    Stepping fine = stepping_of(oversampled->fine->form);
    fine.step /= oversampled->times;
    return fine;
  }
  return {};
}

std::optional<Complex> Stepping::pole(double stiffness, double damping) const {
  if (scheme == Scheme::exact) {
    return continuous_pole(stiffness, damping);
  }
  const double k = stiffness * step * step;
  const double z = damping * step;
  const double cosine = (2.0 - k - z) / (2.0 * std::sqrt(1.0 - z));
  if (!(z < 1.0) || !(std::fabs(cosine) < 1.0)) {
    return std::nullopt;
  }
  return Complex(0.5 * std::log1p(-z), std::acos(cosine)) / step;
}

std::pair<Matrix, Matrix> Stepping::as_published(const Springs& springs) const {
  return {times(step * step, springs.stiffness), times(step, springs.damping)};
}

std::vector<Complex> Stepping::poles(const Springs& springs) const {
  const auto [k, z] = as_published(springs);
  std::vector<Complex> poles;
  for (const Complex& factor : eigenvalues(step_of(k, z))) {
    if (factor.imag() > 0.0) {
      poles.push_back(std::log(factor) / step);
    }
  }
  return poles;
}

}  // namespace ressort::compile
