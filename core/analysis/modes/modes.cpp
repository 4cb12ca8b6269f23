#include "core/analysis/modes/modes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "core/analysis/modes/lowest_swings.h"
#include "core/analysis/modes/quadratic.h"
#include "core/model/topology.h"

namespace ressort {
namespace {

using Complex = std::complex<double>;

constexpr double rigid = 1e-13;  // of the largest stiffness: what is below is rounding

Matrix dense(const SparseMatrix& lower) {
  const auto size = static_cast<std::size_t>(lower.size());
  Matrix matrix(size, size);
  for (std::size_t j = 0; j < size; ++j) {
    for (auto i = static_cast<std::size_t>(lower.first[j]);
         i < static_cast<std::size_t>(lower.first[j + 1]); ++i) {
      const auto row = static_cast<std::size_t>(lower.row[i]);
      matrix(row, j) = matrix(j, row) = lower.value[i];
    }
  }
  return matrix;
}

// K and Z per sample of the rate that plays.
SparseMatrix scaled(SparseMatrix matrix, double factor) {
  for (double& value : matrix.value) {
    value *= factor;
  }
  return matrix;
}

class ModeFinder {
 public:
  ModeFinder(NetworkModes& made, const ModeOptions& options)
      : made_(made),
        options_(options),
        e_(options.scheme == ModeScheme::published ? 1.0 : 0.0),
        ratio_(options.scheme == ModeScheme::published
                   ? Network::reference_rate_hz / options.rate_hz
                   : 1.0),
        stiffness_(scaled(made.system.stiffness(), ratio_ * ratio_)),
        damping_(scaled(made.system.damping(), ratio_)) {
    for (const double value : stiffness_.value) {
      rigid_ = std::max(rigid_, rigid * std::fabs(value));
    }
  }

  Result<Done> find() {
    const std::size_t size = made_.system.size();
    std::size_t count = options_.count;
    std::optional<Swings> swings;
    const bool is_small = size <= most_crossing_modes;
    if (is_small || (count == 0 && size <= most_listed_modes)) {
      options_.progress.stage("finding the modes");
      swings = dense_swings();
      if (swings && !swings->is_proportional && !is_small) {
        swings.reset();
      }
    }
    if (!swings) {
      made_.is_all = false;
      count = std::min(count == 0 ? default_modes : count, size - 1);
      auto lowest = lowest_swings(stiffness_, damping_, e_, rigid_, count, options_.progress);
      if (!lowest) {
        return lowest.error();
      }
      swings = *std::move(lowest);
    }
    std::sort(swings->all.begin(), swings->all.end(), [&](const Swing& a, const Swing& b) {
      return pole(a.mu).imag() < pole(b.mu).imag();
    });
    if (count > 0 && swings->all.size() > count) {
      swings->all.resize(count);
      made_.is_all = false;
    }
    made_.is_proportional = swings->is_proportional;
    for (Swing& swing : swings->all) {
      made_.residual = std::max(made_.residual, residual(stiffness_, damping_, e_, swing));
      made_.modes.push_back(mode_of(std::move(swing)));
    }
    return Done{};
  }

 private:
  std::optional<Swings> dense_swings() const {
    const Matrix stiffness = dense(stiffness_);
    const Matrix damping = dense(damping_);
    if (made_.system.size() == 0) {
      return Swings{};
    }
    return swings_of(stiffness, damping, e_, rigid_);
  }

  // The logarithm of what it grows by in a sample.
  Complex pole(Complex mu) const {
    return e_ == 0.0 ? mu
                     : Complex(0.5 * std::log1p(2.0 * mu.real() + std::norm(mu)),
                               std::atan2(mu.imag(), 1.0 + mu.real()));
  }

  double rate_hz() const { return Network::reference_rate_hz / ratio_; }

  Complex along(const ModalPort& port, const Swing& swing) const {
    const auto sum = [&](const ModalPort::Shares& shares) {
      Complex total;
      for (const auto& [row, share] : shares) {
        total += share * swing.shape[row];
      }
      return total;
    };
    // Forces at the reference rate, as the engine takes and gives them.
    const Complex speed = swing.mu / (1.0 + e_ * swing.mu) / ratio_;
    return sum(port.direct) + sum(port.stiff) + speed * sum(port.damped);
  }

  NetworkMode mode_of(Swing swing) const {
    const Complex at = pole(swing.mu);
    NetworkMode mode;
    mode.frequency_hz = at.imag() * rate_hz() / (2.0 * std::numbers::pi);
    mode.t60_s = at.real() == 0.0 ? std::numeric_limits<double>::infinity()
                                  : -3.0 * std::numbers::ln10 / (at.real() * rate_hz());
    std::vector<Complex> heard;
    for (const ModalPort& port : made_.system.outputs) {
      heard.push_back(along(port, swing));
    }
    for (const ModalPort& port : made_.system.inputs) {
      const Complex pushed = along(port, swing) * ratio_ * ratio_;
      for (const Complex& out : heard) {
        mode.levels.push_back(std::abs(pushed * out) / swing.mu.imag());
      }
    }
    mode.mu = swing.mu;
    mode.shape = std::move(swing.shape);
    return mode;
  }

  NetworkModes& made_;
  const ModeOptions& options_;
  double e_;
  double ratio_;
  SparseMatrix stiffness_;
  SparseMatrix damping_;
  double rigid_ = 0.0;
};

}  // namespace

Result<NetworkModes> find_modes(const Network& network, std::span<const double> parameters,
                                const ModeOptions& options) {
  NetworkModes made;
  made.network = settled(expand_macros(network, options.progress), parameters);
  made.system = make_linear_system(made.network);
  made.inputs = network.inputs.size();
  made.outputs = network.outputs.size();
  made.scheme = options.scheme;
  made.rate_hz = options.rate_hz;
  if (!made.system.is_sound) {
    return Error{"a mass is not above 0, or a stiffness or damping is no finite number"};
  }
  if (auto found = ModeFinder(made, options).find(); !found) {
    return found.error();
  }
  return made;
}

}  // namespace ressort
