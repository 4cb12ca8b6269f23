#include "core/compile/accuracy/stepping.h"

#include <cmath>

#include "core/kernels/program.h"
#include "core/linear_algebra/eigen.h"

namespace ressort::compile {
namespace {

using Complex = std::complex<double>;

Matrix times(double factor, Matrix matrix) {
  matrix.values *= factor;
  return matrix;
}

Matrix difference(Matrix a, const Matrix& b) {
  a.values -= b.values;
  return a;
}

// v += -K x - Z v, x += v
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
  if (const auto* modes = std::get_if<Modes>(&form)) {
    return {modes->is_exact ? Stepping::Scheme::exact : Stepping::Scheme::published};
  }
  if (const auto* slow = std::get_if<Slow>(&form)) {
    return {Stepping::Scheme::fourth, static_cast<double>(slow->frames)};
  }
  if (const auto* oversampled = std::get_if<Oversampled>(&form)) {
    Stepping fine = stepping_of(oversampled->fine->form);
    fine.step /= oversampled->times;
    return fine;
  }
  return {std::holds_alternative<Fourth>(form) ? Stepping::Scheme::fourth
                                               : Stepping::Scheme::published};
}

std::optional<Complex> Stepping::pole(double stiffness, double damping) const {
  if (scheme == Scheme::exact) {
    return continuous_pole(stiffness, damping);
  }
  double k = stiffness * step * step;
  double z = damping * step;
  if (scheme == Scheme::fourth) {
    const double full = k;
    k = full * (1.0 - full / 12.0 - z / 2.0);
    z = z * (1.0 - z / 2.0);
  }
  const double cosine = (2.0 - k - z) / (2.0 * std::sqrt(1.0 - z));
  if (!(z < 1.0) || !(std::fabs(cosine) < 1.0)) {
    return std::nullopt;
  }
  return Complex(0.5 * std::log1p(-z), std::acos(cosine)) / step;
}

std::pair<Matrix, Matrix> Stepping::as_published(const Springs& springs) const {
  Matrix k = times(step * step, springs.stiffness);
  Matrix z = times(step, springs.damping);
  if (scheme == Scheme::fourth) {
    // F = -K x - Z v; own springs besides where F/12 without their dampers' share and F/2 lead.
    const Matrix other_z = times(step, springs.relayed_damping);
    const Matrix own_k = difference(k, times(step * step, springs.relayed_stiffness));
    const Matrix own_z = difference(z, other_z);
    const Matrix full_k = k;
    const Matrix full_z = z;
    k.values -= product(own_k, full_k).values / 12.0 + product(own_z, full_k).values / 2.0;
    z.values -= product(own_k, other_z).values / 12.0 + product(own_z, full_z).values / 2.0;
  }
  return {std::move(k), std::move(z)};
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
