#include "core/compile/accuracy/pitches.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/linear_algebra/eigen.h"

namespace ressort {
namespace {

using Complex = std::complex<double>;

constexpr int most_newton_steps = 20;
constexpr double arrived = 1e-12;         // a step, of a logarithm
constexpr double small_step = 1e-6;       // for a derivative
constexpr double most_change = 0.5;       // of a logarithm in a step
constexpr double same_mode = 1e-6;        // two stiffnesses
constexpr std::size_t most_sought = 320;  // masses of a part

// What is left at the first coordinate of a matrix once all others are eliminated: 0 where the
// matrix is singular by a motion that this coordinate takes part in.
Complex first_schur(std::vector<std::vector<Complex>> matrix) {
  for (std::size_t last = matrix.size(); last-- > 1;) {
    std::size_t pivot = last;
    for (std::size_t i = 1; i < last; ++i) {
      pivot = std::abs(matrix[i][last]) > std::abs(matrix[pivot][last]) ? i : pivot;
    }
    std::swap(matrix[pivot], matrix[last]);
    for (std::size_t i = 0; i < last; ++i) {
      const Complex share = matrix[i][last] / matrix[last][last];
      for (std::size_t j = 0; j < last; ++j) {
        matrix[i][j] -= share * matrix[last][j];
      }
    }
  }
  return matrix[0][0];
}

class Tuner {
 public:
  Tuner(const LowestShapes& shapes, const Stepping& stepping, double rate_ratio)
      : stepping_(stepping) {
    const std::size_t n = shapes.stiffness.rows();
    springs_ = {shapes.stiffness, shapes.damping, Matrix(n, n), Matrix(n, n)};
    springs_.stiffness.values *= rate_ratio * rate_ratio;
    springs_.damping.values *= rate_ratio;
    fixed_ = shapes.fixed.rows() == n ? shapes.fixed : Matrix(n, n);
    fixed_.values *= rate_ratio * rate_ratio;
  }

  // The factor and the decay at which the pole's angle is `theta` a sample; from where they are as
  // if the mode swung alone, times `change`.
  std::optional<double> factor_at(double theta, double change) const {
    double log_factor = std::log(alone_at(theta) * change);
    double decay = 0.5 * springs_.damping(0, 0);
    for (int i = 0; i < most_newton_steps; ++i) {
      const Complex here = residual(log_factor, decay, theta);
      const Complex by_factor =
          (residual(log_factor + small_step, decay, theta) - here) / small_step;
      const double way = small_step * theta;
      const Complex by_decay = (residual(log_factor, decay + way, theta) - here) / way;
      const double determinant =
          by_factor.real() * by_decay.imag() - by_factor.imag() * by_decay.real();
      const double more =
          -(here.real() * by_decay.imag() - here.imag() * by_decay.real()) / determinant;
      const double faster =
          -(by_factor.real() * here.imag() - by_factor.imag() * here.real()) / determinant;
      if (!std::isfinite(more) || !std::isfinite(faster)) {
        return std::nullopt;
      }
      const double most = std::max(std::fabs(more), std::fabs(faster) / theta);
      const double share = std::min(1.0, most_change / most);
      log_factor += share * more;
      decay += share * faster;
      if (most < arrived) {
        break;
      }
      if (i + 1 == most_newton_steps && !(most < 1e-9)) {
        return std::nullopt;
      }
    }
    return std::exp(log_factor);
  }

  // The same of a mode that swings alone: exactly for the published scheme and exact modes.
  double alone_at(double theta) const {
    const double k = springs_.stiffness(0, 0);
    const double z = springs_.damping(0, 0);
    if (stepping_.scheme == Stepping::Scheme::published) {
      const double steps = stepping_.step;
      const double lost = std::clamp(z * steps, 0.0, 0.999);
      return (2.0 - lost - 2.0 * std::sqrt(1.0 - lost) * std::cos(theta * steps)) /
             (k * steps * steps);
    }
    return (theta * theta + 0.25 * z * z) / k;
  }

 private:
  // (x - 1)^2 + x K + (x - 1) Z with x = e^(pole step), or pole^2 + K + pole Z.
  Complex residual(double log_factor, double decay, double theta) const {
    const Complex pole(-decay, theta);
    Springs stiffer = springs_;
    stiffer.stiffness.values *= std::exp(log_factor);
    stiffer.stiffness.values += fixed_.values;
    const bool is_exact = stepping_.scheme == Stepping::Scheme::exact;
    const auto [k, z] =
        is_exact ? std::pair(stiffer.stiffness, stiffer.damping) : stepping_.as_published(stiffer);
    const Complex x = is_exact ? pole : std::exp(pole * stepping_.step);
    const Complex by_mass = is_exact ? x * x : (x - 1.0) * (x - 1.0);
    const Complex by_stiffness = is_exact ? Complex(1.0) : x;
    const Complex by_damping = is_exact ? x : x - 1.0;
    const std::size_t n = k.rows();
    std::vector<std::vector<Complex>> matrix(n, std::vector<Complex>(n));
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        matrix[i][j] = by_stiffness * k(i, j) + by_damping * z(i, j);
      }
      matrix[i][i] += by_mass;
    }
    return first_schur(std::move(matrix)) / (theta * theta);
  }

  Springs springs_;
  Matrix fixed_;  // stiffness that no key moves
  Stepping stepping_;
};

}  // namespace

Pitches make_pitches(const LowestShapes& shapes, const Stepping& stepping, double rate_hz,
                     double rate_ratio) {
  const Tuner tuner(shapes, stepping, rate_ratio);
  Pitches pitches;
  double change = 1.0;  // by what swings together, at the semitone above
  const double nyquist = 0.5 * rate_hz * (1.0 - 1e-9);
  for (double hz = pitches.lowest_hz; hz < nyquist; hz *= std::exp2(1.0 / 12.0)) {
    pitches.factors.push_back(0.0);
  }
  // Dampers matter the least at the top.
  for (std::size_t i = pitches.factors.size(); i-- > 0;) {
    const double hz = pitches.lowest_hz * std::exp2(static_cast<double>(i) / 12.0);
    const double theta = 2.0 * std::numbers::pi * hz / rate_hz;
    const double alone = tuner.alone_at(theta);
    const auto found = tuner.factor_at(theta, change);
    pitches.factors[i] = found.value_or(alone * change);
    change = pitches.factors[i] / alone;
  }
  return pitches;
}

Stepping stepping_of_lowest(const Machine& machine, const LowestShapes& shapes) {
  constexpr double alone = 0.999;  // what ties it to other masses hardly matters
  if (shapes.share_of_modes > alone) {
    return {Stepping::Scheme::exact};
  }
  const Program* best = nullptr;
  double nearest = std::numeric_limits<double>::infinity();
  const double wanted = shapes.mode.stiffness * machine.rate_ratio * machine.rate_ratio;
  for (const Program& program : machine.parts) {
    if (program.moving == 0) {
      continue;
    }
    const bool is_alike = best != nullptr && stepping_of(program.form) == stepping_of(best->form);
    if (best == nullptr) {
      best = &program;
    }
    if (is_alike || machine.parts.size() == 1 || program.moving > most_sought) {
      continue;
    }
    const Springs springs = springs_of(program, machine.parameters, 1.0);
    for (const double stiffness : symmetric_eigenpairs(springs.stiffness).values) {
      const double off = std::fabs(stiffness / wanted - 1.0);
      if (off < same_mode && off < nearest) {
        nearest = off;
        best = &program;
      }
    }
  }
  return best == nullptr ? Stepping{} : stepping_of(best->form);
}

}  // namespace ressort
