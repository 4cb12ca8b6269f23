#include "core/identification/fit.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "core/linear_algebra/complex.h"
#include "core/linear_algebra/eigen.h"
#include "core/ranges.h"

namespace ressort::identification {
namespace {

// Added to the diagonal, relative to it, so that nearly equal poles keep finite amplitudes.
constexpr double ridge = 1e-13;
constexpr Complex i_unit{0.0, 1.0};

// Inner products, over all samples, of two columns Re(f n^p z^n) and Re(g n^q w^n). The sums of the
// two poles are computed once and serve all factors f, g and powers p, q.
struct PairSums {
  PairSums(const Powers& z, const Powers& w, std::size_t frames)
      : straight(power_sums(z * w, frames)), turned(power_sums(z * w.conjugate(), frames)) {}
  double product(Complex f, Complex g, int power) const {
    return 0.5 * times(f, times(g, straight.of_power[power]) +
                              times(std::conj(g), turned.of_power[power]))
                     .real();
  }

  PowerSums straight;
  PowerSums turned;
};

// The normal equations of one Gauss-Newton step. The linear columns are, for each mode, Re(z^n) and
// Re(i z^n), and then the constant. The columns of the poles are, for each channel and mode, Re(n c
// z^n), the derivative by -alpha, and Re(i n c z^n), the derivative by omega.
struct Normal {
  Normal(const std::vector<DampedMode>& modes, std::size_t channels, std::size_t frames,
         bool with_poles)
      : linear(2 * modes.size() + 1, 2 * modes.size() + 1),
        poles(2 * modes.size(), 2 * modes.size()) {
    const std::size_t count = modes.size();
    constexpr Complex factor[] = {1.0, i_unit};
    if (with_poles) {
      mixed.assign(channels, Matrix(2 * count + 1, 2 * count));
    }
    std::vector<Powers> powers;
    for (const DampedMode& mode : modes) {
      powers.emplace_back(mode.log_z, frames);
    }
    powers.emplace_back(Complex(), frames);  // The constant is a mode with log z = 0.
    for (std::size_t j = 0; j <= count; ++j) {
      for (std::size_t k = j; k <= count; ++k) {
        const PairSums sums(powers[j], powers[k], frames);
        for (std::size_t a = 0; a < (j < count ? 2 : 1); ++a) {
          for (std::size_t b = 0; b < (k < count ? 2 : 1); ++b) {
            const std::size_t row = 2 * j + a;
            const std::size_t column = 2 * k + b;
            const double both = sums.product(factor[a], factor[b], 0);
            linear(row, column) = both;
            linear(column, row) = both;
            for (std::size_t c = 0; c < mixed.size(); ++c) {
              const Complex moved_j = j < count ? times(factor[a], modes[j].c[c]) : Complex();
              const Complex moved_k = k < count ? times(factor[b], modes[k].c[c]) : Complex();
              if (k < count) {
                mixed[c](row, column) = sums.product(factor[a], moved_k, 1);
                const double of_poles = sums.product(moved_j, moved_k, 2);
                poles(row, column) += of_poles;
                poles(column, row) += j == k ? 0.0 : of_poles;
              }
              if (j < count && j != k) {
                mixed[c](column, row) = sums.product(moved_j, factor[b], 1);
              }
            }
          }
        }
      }
    }
    for (std::size_t i = 0; i < linear.rows(); ++i) {
      linear(i, i) *= 1.0 + ridge;
    }
  }

  Matrix linear;
  Matrix poles;               // Sum over all channels.
  std::vector<Matrix> mixed;  // [channel][linear column, pole's column]
};

// Products of one channel's residual with all columns.
struct Gradient {
  Gradient(const std::vector<double>& rest, const std::vector<DampedMode>& modes,
           std::size_t channel)
      : linear(2 * modes.size() + 1, 1), poles(2 * modes.size()) {
    const std::vector<Moments> moments = moments_of(rest, poles_of(modes));
    for (std::size_t k = 0; k < modes.size(); ++k) {
      linear(2 * k, 0) = moments[k].zeroth.real();
      linear(2 * k + 1, 0) = -moments[k].zeroth.imag();
      const Complex moved = modes[k].c[channel] * moments[k].first;
      poles[2 * k] = moved.real();
      poles[2 * k + 1] = -moved.imag();
    }
    linear(2 * modes.size(), 0) = std::reduce(rest.begin(), rest.end());
  }

  Matrix linear;
  Vector poles;
};

Matrix identity(std::size_t size) {
  Matrix unit(size, size);
  for (std::size_t i = 0; i < size; ++i) {
    unit(i, i) = 1.0;
  }
  return unit;
}

Matrix beside(const Matrix& a, const Matrix& b) {
  Matrix both(a.rows(), a.columns() + b.columns());
  std::copy(std::begin(a.values), std::end(a.values), std::begin(both.values));
  std::copy(std::begin(b.values), std::end(b.values), std::begin(both.values) + a.values.size());
  return both;
}

}  // namespace

std::vector<Complex> poles_of(std::span<const DampedMode> modes) {
  return mapped(modes, &DampedMode::log_z);
}

DampedFit::DampedFit(std::span<const std::vector<double>> sound)
    : sound_(sound), constant_(sound.size()), rest_(sound.begin(), sound.end()) {}

Complex DampedFit::allowed(Complex log_z) const {
  const double omega = std::max(log_z.imag(), lowest_omega_);
  return lowest_omega_ > 0.0 ? Complex(std::clamp(log_z.real(), -omega, -least_alpha_), omega)
                             : log_z;
}

void DampedFit::find_rest() {
  ++version_;
  for (std::size_t c = 0; c < sound_.size(); ++c) {
    rest_[c] = sound_[c];
    for (double& x : rest_[c]) {
      x -= constant_[c];
    }
    const auto subtracted = mapped(modes_, [&](const DampedMode& mode) { return -mode.c[c]; });
    add_damped(rest_[c], subtracted, poles_of(modes_));
  }
}

double DampedFit::rest_energy() const {
  return energy_in(rest_);
}

bool DampedFit::set_poles(const std::vector<Complex>& log_z) {
  const std::size_t channels = sound_.size();
  constant_.assign(channels, 0.0);
  set_modes({});
  for (const Complex pole : log_z) {
    modes_.push_back({allowed(pole), std::vector<Complex>(channels)});
  }
  const Normal normal(modes_, channels, sound_[0].size(), false);
  for (std::size_t c = 0; c < channels; ++c) {
    const auto step = positive_solution(normal.linear, Gradient(rest_[c], modes_, c).linear);
    if (!step) {
      return false;
    }
    for (std::size_t k = 0; k < modes_.size(); ++k) {
      modes_[k].c[c] = Complex((*step)(2 * k, 0), (*step)(2 * k + 1, 0));
    }
    constant_[c] = (*step)(2 * modes_.size(), 0);
  }
  find_rest();
  return true;
}

std::size_t DampedFit::eliminate(
    const std::function<std::size_t(const std::vector<double>& drops)>& next) {
  const std::size_t count = modes_.size();
  const std::size_t columns = 2 * count + 1;
  const Normal normal(modes_, 0, sound_[0].size(), false);
  Matrix amplitudes(columns, sound_.size());
  for (std::size_t c = 0; c < sound_.size(); ++c) {
    for (std::size_t k = 0; k < count; ++k) {
      amplitudes(2 * k, c) = modes_[k].c[c].real();
      amplitudes(2 * k + 1, c) = modes_[k].c[c].imag();
    }
    amplitudes(columns - 1, c) = constant_[c];
  }
  const Matrix wanted = product(normal.linear, amplitudes);
  std::vector<bool> is_removed(count);
  Matrix inverse(columns, columns);
  // Inverts the equations without the removed modes. Returns whether this succeeds.
  const auto invert = [&] {
    Matrix left = normal.linear;
    Matrix right = beside(identity(columns), wanted);
    for (std::size_t i = 0; i < columns - 1; ++i) {
      for (std::size_t j = 0; j < columns && is_removed[i / 2]; ++j) {
        left(i, j) = left(j, i) = i == j ? 1.0 : 0.0;
      }
      for (std::size_t c = 0; c < sound_.size() && is_removed[i / 2]; ++c) {
        right(i, columns + c) = 0.0;
      }
    }
    const auto solved = positive_solution(left, right);
    if (solved) {
      const auto middle =
          std::begin(solved->values) + static_cast<std::ptrdiff_t>(inverse.values.size());
      std::copy(std::begin(solved->values), middle, std::begin(inverse.values));
      std::copy(middle, std::end(solved->values), std::begin(amplitudes.values));
    }
    return solved.has_value();
  };
  if (count == 0 || !invert()) {
    return 0;
  }
  // Returns the determinant of the block of mode k, 0 if rounding errors exceed it.
  const auto determinant = [&](std::size_t k) {
    const double ad = inverse(2 * k, 2 * k) * inverse(2 * k + 1, 2 * k + 1);
    const double b = inverse(2 * k + 1, 2 * k);
    return inverse(2 * k, 2 * k) > 0.0 && ad - b * b > 1e-9 * ad ? ad - b * b : 0.0;
  };
  // Solves the equation of the block of mode k in the inverse for each channel's amplitude.
  const auto solved = [&](std::size_t k, double re, double im) {
    const double a = inverse(2 * k, 2 * k);
    const double b = inverse(2 * k + 1, 2 * k);
    const double d = inverse(2 * k + 1, 2 * k + 1);
    return std::pair((d * re - b * im) / determinant(k), (a * im - b * re) / determinant(k));
  };
  std::vector<double> drops(count);
  std::size_t removed = 0;
  for (;; ++removed) {
    for (std::size_t k = 0; k < count; ++k) {
      drops[k] = is_removed[k] ? HUGE_VAL : 0.0;
      // The other modes can replace a mode whose determinant is lost in rounding errors.
      const bool counts = !is_removed[k] && determinant(k) > 0.0;
      for (std::size_t c = 0; c < sound_.size() && counts; ++c) {
        const double re = amplitudes(2 * k, c);
        const double im = amplitudes(2 * k + 1, c);
        const auto [x, y] = solved(k, re, im);
        drops[k] += x * re + y * im;
      }
    }
    const std::size_t gone = next(drops);
    if (gone >= count) {
      break;
    }
    is_removed[gone] = true;
    if (!(determinant(gone) > 0.0)) {
      if (invert()) {
        continue;
      }
      ++removed;
      break;
    }
    // The Schur complement of the removed columns.
    const auto take = [&](double* column) {
      const auto [x, y] = solved(gone, column[2 * gone], column[2 * gone + 1]);
      const double* const first = &inverse.values[2 * gone * columns];
      for (std::size_t i = 0; i < columns; ++i) {
        column[i] -= x * first[i] + y * first[i + columns];
      }
    };
    for (std::size_t c = 0; c < sound_.size(); ++c) {
      take(&amplitudes.values[c * columns]);
    }
    for (std::size_t j = 0; j < columns; ++j) {
      if (j / 2 != gone && (j / 2 == count || !is_removed[j / 2])) {
        take(&inverse.values[j * columns]);
      }
    }
  }
  if (removed > 0) {
    for (std::size_t c = 0; c < sound_.size(); ++c) {
      for (std::size_t k = 0; k < count; ++k) {
        modes_[k].c[c] = {amplitudes(2 * k, c), amplitudes(2 * k + 1, c)};
      }
      constant_[c] = amplitudes(columns - 1, c);
    }
    std::size_t k = 0;
    std::erase_if(modes_, [&](const DampedMode&) { return is_removed[k++]; });
    find_rest();
  }
  return removed;
}

void DampedFit::set_modes(std::vector<DampedMode> modes) {
  modes_ = std::move(modes);
  find_rest();
}

void DampedFit::refine(int steps, double settled, const Progress& progress) {
  const std::size_t count = modes_.size();
  const std::size_t channels = sound_.size();
  const std::size_t frames = sound_[0].size();
  double energy = rest_energy();
  double damping = 1e-4;
  for (int done = 0; done < steps && count > 0; ++done) {
    const Normal normal(modes_, channels, frames, true);
    Matrix schur = normal.poles;
    Matrix wanted(2 * count, 1);
    std::vector<Matrix> linear;  // [channel] The gradient by the amplitudes.
    for (std::size_t c = 0; c < channels; ++c) {
      const Gradient gradient(rest_[c], modes_, c);
      const auto taken = positive_form(normal.linear, beside(normal.mixed[c], gradient.linear));
      if (!taken) {
        return;
      }
      for (std::size_t j = 0; j < 2 * count; ++j) {
        for (std::size_t i = 0; i < 2 * count; ++i) {
          schur(i, j) -= (*taken)(i, j);
        }
        wanted(j, 0) += gradient.poles[j] - (*taken)(j, 2 * count);
      }
      linear.push_back(gradient.linear);
      progress.spend(count * frames + 16 * count * count * count);
    }
    const std::vector<DampedMode> before = modes_;
    const std::vector<double> constant_before = constant_;
    bool is_better = false;
    for (int attempt = 0; attempt < 6 && !is_better; ++attempt) {
      Matrix damped = schur;
      for (std::size_t i = 0; i < 2 * count; ++i) {
        damped(i, i) += (damping + ridge) * normal.poles(i, i) + 1e-300;
      }
      auto step = positive_solution(damped, wanted);
      if (step) {
        // The amplitudes below are the best ones for the limited step.
        for (std::size_t k = 0; k < count; ++k) {
          const Complex from = before[k].log_z;
          const Complex moved =
              allowed(from + Complex((*step)(2 * k, 0), (*step)(2 * k + 1, 0))) - from;
          (*step)(2 * k, 0) = moved.real();
          (*step)(2 * k + 1, 0) = moved.imag();
        }
        for (std::size_t c = 0; c < channels; ++c) {
          Matrix left = linear[c];
          left.values -= product(normal.mixed[c], *step).values;
          const auto moved = positive_solution(normal.linear, left);
          for (std::size_t k = 0; moved && k < count; ++k) {
            modes_[k].c[c] = before[k].c[c] + Complex((*moved)(2 * k, 0), (*moved)(2 * k + 1, 0));
          }
          constant_[c] = constant_before[c] + (moved ? (*moved)(2 * count, 0) : 0.0);
        }
        for (std::size_t k = 0; k < count; ++k) {
          modes_[k].log_z = before[k].log_z + Complex((*step)(2 * k, 0), (*step)(2 * k + 1, 0));
        }
        const bool is_sound = std::ranges::all_of(modes_, [&](const DampedMode& mode) {
          return mode.log_z.real() * static_cast<double>(frames) < 1.0 && mode.log_z.real() > -3.0;
        });
        if (is_sound) {
          find_rest();
          is_better = rest_energy() < energy;
        }
      }
      damping = is_better ? 0.03 * damping : std::max(10.0 * damping, 1e-6);
    }
    if (!is_better) {
      modes_ = before;
      constant_ = constant_before;
      find_rest();
      return;
    }
    const double now = rest_energy();
    const bool is_done = energy - now < settled * now;
    energy = now;
    if (is_done) {
      return;
    }
  }
}

std::vector<DampedDeviation> DampedFit::deviations(bool with_poles) const {
  const std::size_t count = modes_.size();
  const std::size_t channels = sound_.size();
  const std::vector<double> none(channels);
  std::vector<DampedDeviation> all(
      count, {HUGE_VAL, HUGE_VAL, std::vector<double>(channels, HUGE_VAL), none, none});
  if (count == 0) {
    return all;
  }
  const Normal normal(modes_, channels, sound_[0].size(), with_poles);
  const auto inverse = positive_solution(normal.linear, identity(2 * count + 1));
  if (!inverse) {
    return all;
  }
  for (std::size_t k = 0; k < count; ++k) {
    const double variance = 0.5 * ((*inverse)(2 * k, 2 * k) + (*inverse)(2 * k + 1, 2 * k + 1));
    all[k] = {0.0, 0.0, std::vector<double>(channels, std::sqrt(std::max(0.0, variance))), none,
              none};
  }
  if (!with_poles) {
    return all;
  }
  Matrix schur = normal.poles;
  std::vector<Matrix> moved;  // [channel] Change of the amplitudes caused by a change of the poles.
  for (std::size_t c = 0; c < channels; ++c) {
    moved.push_back(product(*inverse, normal.mixed[c]));
    schur.values -= transposed_product(normal.mixed[c], moved[c]).values;
  }
  // Poles that cannot be distinguished get finite, large deviations.
  std::optional<Matrix> covariance;
  for (double added = ridge; !covariance && added < 1e-3; added *= 100.0) {
    for (std::size_t i = 0; i < 2 * count; ++i) {
      schur(i, i) += added * normal.poles(i, i) + 1e-300;
    }
    covariance = positive_solution(schur, identity(2 * count));
  }
  for (std::size_t k = 0; k < count; ++k) {
    all[k].alpha = covariance ? std::sqrt((*covariance)(2 * k, 2 * k)) : HUGE_VAL;
    all[k].omega = covariance ? std::sqrt((*covariance)(2 * k + 1, 2 * k + 1)) : HUGE_VAL;
  }
  for (std::size_t c = 0; c < channels && covariance; ++c) {
    const Matrix spread = product(moved[c], *covariance);
    for (std::size_t k = 0; k < count; ++k) {
      double variance = 0.0;
      for (std::size_t row = 2 * k; row < 2 * k + 2; ++row) {
        for (std::size_t j = 0; j < 2 * count; ++j) {
          variance += 0.5 * spread(row, j) * moved[c](row, j);
        }
      }
      all[k].c[c] = std::hypot(all[k].c[c], std::sqrt(std::max(0.0, variance)));
      const double size = std::abs(modes_[k].c[c]);
      const Complex turn = size > 0.0 ? std::conj(modes_[k].c[c]) / size : 1.0;
      const auto turned = [&](std::size_t pole) {
        return Complex(-spread(2 * k, pole), -spread(2 * k + 1, pole)) * turn;
      };
      all[k].with_alpha[c] = turned(2 * k).real();
      all[k].with_omega[c] = turned(2 * k + 1).imag();
    }
  }
  return all;
}

}  // namespace ressort::identification
