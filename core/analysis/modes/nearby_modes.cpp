#include "core/analysis/modes/nearby_modes.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/linear_algebra/eigen.h"

namespace ressort::analysis {
namespace {

using Complex = std::complex<double>;

// Relative difference of squared poles below which they count as nearly degenerate.
constexpr double nearly_alike = 1e-6;
constexpr double unheard = 1e-6;  // Modes below this share of the loudest keep their shape.

double inner_product(const double* a, const double* b, std::size_t size) {
  double sum = 0.0;
  for (std::size_t i = 0; i < size; ++i) {
    sum += a[i] * b[i];
  }
  return sum;
}

double largest_of(const SparseMatrix& matrix) {
  double most = 0.0;
  for (const double value : matrix.value) {
    most = std::max(most, std::fabs(value));
  }
  return most;
}

// Applies stiffness and damping to one shape after the other.
class Pulled {
 public:
  explicit Pulled(const LinearSystem& system)
      : stiffness_(system.stiffness()),
        damping_(system.damping()),
        pulled(system.size()),
        rubbed(system.size()) {
    const double share = shared_tolerance(system.size());
    most_pulled = share * largest_of(stiffness_);
    most_rubbed = share * largest_of(damping_);
    rigid = rigid_below(stiffness_);
  }

  void take(const double* shape) {
    multiply(stiffness_, shape, pulled.data());
    multiply(damping_, shape, rubbed.data());
    k = inner_product(shape, pulled.data(), pulled.size());
    z = inner_product(shape, rubbed.data(), rubbed.size());
  }

  // Returns whether the shape is an eigenvector of both, up to rounding.
  bool is_kept(const double* shape) const {
    double left_pulled = 0.0;
    double left_rubbed = 0.0;
    for (std::size_t row = 0; row < pulled.size(); ++row) {
      const double a = pulled[row] - k * shape[row];
      const double b = rubbed[row] - z * shape[row];
      left_pulled += a * a;
      left_rubbed += b * b;
    }
    return left_pulled <= most_pulled * most_pulled && left_rubbed <= most_rubbed * most_rubbed;
  }

 private:
  SparseMatrix stiffness_;
  SparseMatrix damping_;

 public:
  std::vector<double> pulled;  // [row]
  std::vector<double> rubbed;
  double k = 0.0;  // Rayleigh quotients of the shape.
  double z = 0.0;
  double rigid = 0.0;
  double most_pulled = 0.0;  // Bound on the rounding error.
  double most_rubbed = 0.0;
};

void sort_by_frequency(std::vector<HeardMode>& modes) {
  std::sort(modes.begin(), modes.end(), [](const HeardMode& a, const HeardMode& b) {
    return a.tone.frequency_hz < b.tone.frequency_hz;
  });
}

}  // namespace

std::vector<HeardMode> heard_modes(const NetworkModes& modes, std::span<const std::size_t> pushed) {
  std::vector<HeardMode> heard;
  heard.reserve(modes.modes.size());
  for (const NetworkMode& mode : modes.modes) {
    HeardMode& one = heard.emplace_back(
        HeardMode{.mu = mode.mu, .tone = {mode.frequency_hz, mode.t60_s}, .residues = {}});
    for (const std::size_t input : pushed) {
      Complex sum;
      for (std::size_t output = 0; output < modes.outputs; ++output) {
        sum += mode.residues[input * modes.outputs + output];
      }
      one.residues.push_back(sum / static_cast<double>(modes.outputs));
    }
  }
  return heard;
}

NearbyModes::NearbyModes(NetworkModes modes, std::vector<std::size_t> pushed, ModeOptions options)
    : options_(std::move(options)),
      e_(scheme_e(options_.scheme)),
      basis_(std::move(modes.basis)),
      system_(std::move(modes.system)),
      pushed_(std::move(pushed)) {
  Pulled pulled(system_);
  for (std::size_t i = 0; i < basis_.columns(); ++i) {
    pulled.take(shape(i));
    stiffness_.push_back(pulled.k);
    damping_.push_back(pulled.z);
    mu_.push_back(swing_root(pulled.k, pulled.z, e_, pulled.rigid));
  }
}

bool NearbyModes::has_rows_of(const LinearSystem& system) const {
  return system.masses == system_.masses;
}

// Returns the excited inputs, then the mean of all outputs.
std::vector<ModalPort> NearbyModes::ports_of(const LinearSystem& system) const {
  std::vector<ModalPort> ports;
  for (const std::size_t input : pushed_) {
    ports.push_back(system.inputs[input]);
  }
  ModalPort& heard = ports.emplace_back();
  const auto add = [&](ModalPort::Shares& to, const ModalPort::Shares& from) {
    for (const auto& [row, share] : from) {
      to.emplace_back(row, share / static_cast<double>(system.outputs.size()));
    }
  };
  for (const ModalPort& output : system.outputs) {
    add(heard.direct, output.direct);
    add(heard.stiff, output.stiff);
    add(heard.damped, output.damped);
  }
  return ports;
}

HeardMode NearbyModes::mode_of(Complex mu, std::span<const Complex> moved) const {
  HeardMode mode{.mu = mu, .tone = tone_of(mu, options_), .residues = {}};
  for (std::size_t input = 0; input + 1 < moved.size(); ++input) {
    mode.residues.push_back(moved[input] * moved.back() / mu.imag());
  }
  return mode;
}

std::optional<std::vector<HeardMode>> NearbyModes::exactly(const LinearSystem& system) const {
  if (!has_rows_of(system)) {
    return std::nullopt;
  }
  const std::vector<ModalPort> ports = ports_of(system);
  Pulled pulled(system);
  std::vector<Complex> moved(ports.size());
  std::vector<HeardMode> modes;
  for (std::size_t i = 0; i < basis_.columns(); ++i) {
    pulled.take(shape(i));
    if (!pulled.is_kept(shape(i))) {
      return std::nullopt;
    }
    if (const auto mu = swing_root(pulled.k, pulled.z, e_, pulled.rigid)) {
      for (std::size_t p = 0; p < ports.size(); ++p) {
        moved[p] = along(ports[p], shape(i), speed_of(*mu, options_.scheme));
      }
      modes.push_back(mode_of(*mu, moved));
    }
  }
  sort_by_frequency(modes);
  return modes;
}

// First-order perturbation. For a mode mu with vector v, (mu^2 + (1 + e mu) K + mu Z) v = 0, a
// force f on the rows changes the shape by w, where (mu^2 + (1 + e mu) K + mu Z) w = -f. In the
// basis of all shapes this is -f_j / Q_j with Q_j = mu^2 + mu (z_j + e k_j) + k_j for every other
// vector j.
void NearbyModes::prepare() {
  const std::vector<ModalPort> ports = ports_of(system_);
  std::vector<double> level(basis_.columns());
  for (std::size_t i = 0; i < level.size(); ++i) {
    if (mu_[i]) {
      const Complex speed = speed_of(*mu_[i], options_.scheme);
      const double heard = std::abs(along(ports.back(), shape(i), speed)) / mu_[i]->imag();
      for (std::size_t p = 0; p + 1 < ports.size(); ++p) {
        level[i] = std::max(level[i], heard * std::abs(along(ports[p], shape(i), speed)));
      }
    }
  }
  const double loudest = *std::max_element(level.begin(), level.end());
  for (std::size_t i = 0; i < level.size(); ++i) {
    if (level[i] > unheard * loudest) {
      loud_.push_back(i);
    }
  }
  for (std::size_t c = 0; c < loud_.size(); ++c) {
    for (std::size_t j = 0; j < level.size(); ++j) {
      if (j != loud_[c] && is_alike(*mu_[loud_[c]], j)) {
        alike_.push_back({c, j});
      }
    }
  }
  for (const ModalPort& port : ports) {
    answers_.push_back(answer_of(port));
  }
}

Complex NearbyModes::apart(Complex mu, std::size_t other) const {
  return mu * mu + mu * (damping_[other] + e_ * stiffness_[other]) + stiffness_[other];
}

bool NearbyModes::is_alike(Complex mu, std::size_t other) const {
  return std::abs(apart(mu, other)) <= nearly_alike * std::norm(mu);
}

NearbyModes::Answer NearbyModes::answer_of(const ModalPort& port) const {
  const std::size_t shapes = basis_.columns();
  Matrix real(shapes, loud_.size());
  Matrix imaginary(shapes, loud_.size());
  const ModalPort still{port.direct, port.stiff, {}};
  const ModalPort moving{port.damped, {}, {}};
  std::vector<double> still_in(shapes);
  std::vector<double> moving_in(shapes);
  for (std::size_t j = 0; j < shapes; ++j) {
    still_in[j] = along(still, shape(j), 0.0).real();
    moving_in[j] = along(moving, shape(j), 0.0).real();
  }
  for (std::size_t c = 0; c < loud_.size(); ++c) {
    const Complex mu = *mu_[loud_[c]];
    const Complex speed = speed_of(mu, options_.scheme);
    for (std::size_t j = 0; j < shapes; ++j) {
      if (j != loud_[c] && !is_alike(mu, j)) {
        const Complex share = -(still_in[j] + speed * moving_in[j]) / apart(mu, j);
        real(j, c) = share.real();
        imaginary(j, c) = share.imag();
      }
    }
  }
  return {product(basis_, real), product(basis_, imaginary)};
}

std::optional<std::vector<HeardMode>> NearbyModes::nearly(const LinearSystem& system) {
  if (auto modes = exactly(system)) {
    return modes;
  }
  if (!has_rows_of(system)) {
    return std::nullopt;
  }
  if (answers_.empty()) {
    prepare();
  }
  const std::size_t rows = basis_.rows();
  const std::vector<ModalPort> ports = ports_of(system);
  Pulled pulled(system);
  std::vector<Complex> moved(ports.size());
  std::vector<HeardMode> modes;
  std::size_t loud = 0;        // Index into `loud_`, which is ascending.
  auto next = alike_.begin();  // Also ascending.
  for (std::size_t i = 0; i < basis_.columns(); ++i) {
    pulled.take(shape(i));
    const auto mu = swing_root(pulled.k, pulled.z, e_, pulled.rigid);
    if (mu.has_value() != mu_[i].has_value()) {
      return std::nullopt;
    }
    if (!mu) {
      continue;
    }
    for (std::size_t p = 0; p < ports.size(); ++p) {
      moved[p] = along(ports[p], shape(i), speed_of(*mu, options_.scheme));
    }
    if (loud < loud_.size() && loud_[loud] == i) {
      const auto force = [&](const double* along_row) {
        return (1.0 + e_ * *mu) * inner_product(along_row, pulled.pulled.data(), rows) +
               *mu * inner_product(along_row, pulled.rubbed.data(), rows);
      };
      for (; next != alike_.end() && next->loud == loud; ++next) {
        if (std::abs(force(shape(next->other))) > pulled.most_pulled + pulled.most_rubbed) {
          return std::nullopt;
        }
      }
      for (std::size_t p = 0; p < ports.size(); ++p) {
        moved[p] += force(&answers_[p].real.values[loud * rows]) +
                    Complex(0.0, 1.0) * force(&answers_[p].imaginary.values[loud * rows]);
      }
      ++loud;
    }
    modes.push_back(mode_of(*mu, moved));
  }
  sort_by_frequency(modes);
  return modes;
}

}  // namespace ressort::analysis
