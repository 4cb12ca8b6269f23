#include "core/compile/accuracy/pitches.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/linear_algebra/complex.h"
#include "core/linear_algebra/eigen.h"

namespace ressort::compile {
namespace {

using Complex = std::complex<double>;

constexpr int most_newton_steps = 20;
constexpr int most_roundings = 8;
constexpr double converged = 1e-12;       // Newton step of a logarithm
constexpr double small_step = 1e-6;       // step of finite differences
constexpr double most_change = 0.5;       // largest change of a logarithm in one Newton step
constexpr double same_mode = 1e-6;        // relative difference of two stiffnesses
constexpr std::size_t most_sought = 320;  // masses of a part whose eigenvalues are computed

// The unknowns of Newton's method.
struct PolePosition {
  double log_factor = 0.0;
  double decay = 0.0;
};

// Finds the factor and the decay at which the pole has this angle per sample, by Newton's method
// with finite differences and a limited step.
std::optional<PolePosition> pole_near(const TunedMotion& motion, double theta, PolePosition at) {
  for (int i = 0; i < most_newton_steps; ++i) {
    const Complex here = motion.residual(at.log_factor, at.decay, theta);
    const Complex by_factor =
        (motion.residual(at.log_factor + small_step, at.decay, theta) - here) / small_step;
    const double way = small_step * theta;
    const Complex by_decay = (motion.residual(at.log_factor, at.decay + way, theta) - here) / way;
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
    at.log_factor += share * more;
    at.decay += share * faster;
    if (most < converged) {
      break;
    }
    if (i + 1 == most_newton_steps && !(most < 1e-9)) {
      return std::nullopt;
    }
  }
  return at;
}

// Returns the factor at which the pole has this angle per sample. Newton starts at the uncoupled
// mode's factor times `change`. If delays of whole samples leave no exact solution, returns the
// factor with the smallest residual.
std::optional<double> factor_at(TunedMotion& motion, double theta, double change) {
  const double factor = motion.alone_at(theta) * change;
  PolePosition at{std::log(factor), motion.decay_at(factor)};
  motion.round_at(at.log_factor);
  std::optional<double> best;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < most_roundings; ++i) {
    const std::optional<PolePosition> found = pole_near(motion, theta, at);
    if (!found) {
      break;
    }
    at = *found;
    const bool is_new = motion.round_at(at.log_factor);
    const double off = std::abs(motion.residual(at.log_factor, at.decay, theta));
    if (off < least) {
      least = off;
      best = std::exp(at.log_factor);
    }
    if (!is_new) {
      break;
    }
  }
  return best;
}

class TunedMode final : public TunedMotion {
 public:
  TunedMode(const LowestShapes& shapes, const Stepping& stepping, double rate_ratio)
      : stepping_(stepping) {
    const std::size_t n = shapes.stiffness.rows();
    springs_ = {shapes.stiffness, shapes.damping};
    springs_.stiffness.values *= rate_ratio * rate_ratio;
    springs_.damping.values *= rate_ratio;
    fixed_ = shapes.fixed.rows() == n ? shapes.fixed : Matrix(n, n);
    fixed_.values *= rate_ratio * rate_ratio;
    if (is_first_alone()) {
      for (Matrix* const matrix : {&springs_.stiffness, &springs_.damping, &fixed_}) {
        const double first = (*matrix)(0, 0);
        *matrix = Matrix(1, 1);
        (*matrix)(0, 0) = first;
      }
    }
  }

  // The factor of an uncoupled mode, exact for the published scheme and for exact modes:
  // cos(theta) = (2 - k - z) / (2 sqrt(1 - z)), or theta^2 = k - z^2/4.
  double alone_at(double theta) const override {
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
  double decay_at(double) const override { return 0.5 * springs_.damping(0, 0); }

  // (x - 1)^2 + x K + (x - 1) Z with x = e^(pole step), or pole^2 + K + pole Z.
  Complex residual(double log_factor, double decay, double theta) const override {
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
    ComplexMatrix matrix(n, n);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        matrix(i, j) = by_stiffness * k(i, j) + by_damping * z(i, j);
      }
      matrix(i, i) += by_mass;
    }
    return schur_complement_of_first(std::move(matrix)) / (theta * theta);
  }

 private:
  // Returns whether no other mode is coupled to the first. Coupling acts by its square, so rounding
  // errors do not count.
  bool is_first_alone() const {
    constexpr double rounding = 1e-12;
    const double k = rounding * springs_.stiffness(0, 0);
    const double z = rounding * springs_.damping(0, 0);
    for (std::size_t j = 1; j < springs_.stiffness.rows(); ++j) {
      if (std::fabs(springs_.stiffness(0, j)) > k || std::fabs(fixed_(0, j)) > k ||
          std::fabs(springs_.damping(0, j)) > z) {
        return false;
      }
    }
    return true;
  }

  Springs springs_;
  Matrix fixed_;  // stiffness that keys do not change
  Stepping stepping_;
};

}  // namespace

Pitches make_pitches(TunedMotion& motion, double rate_hz, const PitchWindow& window) {
  constexpr std::size_t half_an_octave = 6;
  Pitches pitches;
  double change = 1.0;  // change of the factor by coupled modes, at the semitone above
  const double nyquist = 0.5 * rate_hz * (1.0 - 1e-9);
  std::size_t count = 0;
  for (double hz = pitches.lowest_hz; hz < nyquist; hz *= std::exp2(1.0 / 12.0)) {
    ++count;
  }
  if (window.near != nullptr) {
    const double semitone = 12.0 * std::log2(window.frequency_hz / pitches.lowest_hz);
    const auto middle = static_cast<std::size_t>(
        std::lround(std::clamp(semitone, 0.0, static_cast<double>(count - 1))));
    const std::size_t first = middle - std::min(middle, half_an_octave);
    count = std::min(count, middle + half_an_octave + 1) - first;
    pitches.lowest_hz *= std::exp2(static_cast<double>(first) / 12.0);
    const double top_hz = pitches.lowest_hz * std::exp2(static_cast<double>(count - 1) / 12.0);
    change = window.ratio * window.near->factor_at(top_hz) /
             motion.alone_at(2.0 * std::numbers::pi * top_hz / rate_hz);
  }
  pitches.factors.resize(count);
  // From the top down, because dampers matter least there.
  for (std::size_t i = pitches.factors.size(); i-- > 0;) {
    const double hz = pitches.lowest_hz * std::exp2(static_cast<double>(i) / 12.0);
    const double theta = 2.0 * std::numbers::pi * hz / rate_hz;
    const double alone = motion.alone_at(theta);
    auto found = factor_at(motion, theta, change);
    found = found || change == 1.0 ? found : factor_at(motion, theta, 1.0);
    pitches.factors[i] = found.value_or(alone * change);
    change = pitches.factors[i] / alone;
  }
  return pitches;
}

Pitches make_pitches(const LowestShapes& shapes, const Stepping& stepping, double rate_hz,
                     double rate_ratio, const PitchWindow& window) {
  TunedMode mode(shapes, stepping, rate_ratio);
  return make_pitches(mode, rate_hz, window);
}

Stepping stepping_of_lowest(const Machine& machine, const LowestShapes& shapes,
                            std::span<const double> parameters) {
  constexpr double alone = 0.999;  // share of bodies above which masses hardly matter
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
    const Springs springs = springs_of(program, parameters, 1.0);
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

}  // namespace ressort::compile
