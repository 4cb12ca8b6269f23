#include "core/analysis/continuous.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/analysis/linear.h"
#include "core/analysis/places.h"
#include "core/laws/law.h"
#include "core/linear_algebra/eigen.h"
#include "core/model/topology.h"

namespace ressort::analysis {
namespace {

using Complex = std::complex<double>;

// Largest off-diagonal element of Z in the modes of K, relative to the largest element.
constexpr double shared_tolerance = 1e-9;
// A stiffness or damping below this share of the largest counts as 0.
constexpr double zero = 1e-13;

// A spring and damper between two weighted sums of masses; its force is k (sum of share x -
// offset).
struct Bar {
  std::vector<std::pair<std::size_t, double>> shares;
  double offset = 0.0;
  double k = 0.0;
  double z = 0.0;
};

// The network for unit masses: row i is mass i times the square root of its M.
class ContinuousBody {
 public:
  ContinuousBody(const Network& network, std::span<const double> parameters)
      : network_(network), parameters_(parameters), row_(network.masses.size(), held) {
    for (std::size_t i = 0; i < network.masses.size(); ++i) {
      if (moves(network.masses[i])) {
        row_[i] = root_.size();
        root_.push_back(std::sqrt(value(network.masses[i].mass)));
      }
    }
    force_.resize(size());
    for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
      const Mass& mass = network.masses[i];
      if (mass.kind == MassKind::oscillator) {
        Bar bar{.k = value(mass.stiffness), .z = value(mass.damping)};
        hang(bar, i, 1.0);
        bars_.push_back(bar);
      }
      if (mass.gravity != no_argument && row_[i] != held) {
        force_[row_[i]] -= value(mass.gravity) /
                           (mass.gravity_per_rate ? Network::reference_rate_hz : 1.0) /
                           root_[row_[i]];
      }
    }
    for (const Link& link : network.links) {
      const LinearPart part = linear_part(link);
      Bar bar{.k = value(part.stiffness), .z = value(part.damping)};
      hang(bar, link.a, 1.0);
      hang(bar, link.b, -1.0);
      bars_.push_back(bar);
    }
    for (const Bar& bar : bars_) {
      for (const auto& [row, share] : bar.shares) {
        force_[row] += bar.k * bar.offset * share;
      }
    }
  }

  std::size_t size() const { return root_.size(); }
  bool has_mass() const {
    return !root_.empty() && std::ranges::all_of(root_, [](double root) {
      return root > 0.0 && std::isfinite(root);
    });
  }
  const Vector& force() const { return force_; }

  Matrix matrix(double Bar::*of) const {
    Matrix sum(size(), size());
    for (const Bar& bar : bars_) {
      for (const auto& [i, a] : bar.shares) {
        for (const auto& [j, b] : bar.shares) {
          sum(i, j) += bar.*of * a * b;
        }
      }
    }
    return sum;
  }

  // Returns the stiffness or damping of a shape as a sum of squares, which is accurate for small
  // values, too.
  double along(double Bar::*of, const Vector& shape) const {
    double sum = 0.0;
    for (const Bar& bar : bars_) {
      double stretch = 0.0;
      for (const auto& [row, share] : bar.shares) {
        stretch += share * shape[row];
      }
      sum += bar.*of * stretch * stretch;
    }
    return sum;
  }

  std::pair<Vector, Vector> start() const {
    Vector x(size());
    Vector v(size());
    for (std::size_t i = 0; i < row_.size(); ++i) {
      if (row_[i] != held) {
        const double root = root_[row_[i]];
        x[row_[i]] = root * network_.masses[i].position;
        v[row_[i]] = root * initial_velocity(network_, network_.masses[i]);
      }
    }
    return {x, v};
  }

  // Returns the value of an output as a weighted sum of rows and a constant.
  Bar reading(const Output& output) const {
    Bar bar;
    hang(bar, output.mass, level_value(network_, output, parameters_));
    return bar;
  }

 private:
  static constexpr std::size_t held = static_cast<std::size_t>(-1);

  double value(ArgumentId id) const { return argument_value(network_, id, parameters_); }

  void hang(Bar& bar, std::uint32_t mass, double sign) const {
    each_share(network_, mass, [&](std::uint32_t i, double share) {
      if (row_[i] == held) {
        bar.offset -= sign * share * network_.masses[i].position;
      } else {
        bar.shares.emplace_back(row_[i], sign * share / root_[row_[i]]);
      }
    });
  }

  const Network& network_;
  std::span<const double> parameters_;
  std::vector<std::size_t> row_;  // [mass]
  std::vector<double> root_;      // [row] Square root of its M.
  std::vector<Bar> bars_;
  Vector force_;  // [row] Force with every mass at 0.
};

class Solver {
 public:
  Solver(const Network& network, const ContinuousBody& body) : body_(body) {
    for (const Output& output : network.outputs) {
      reading_.push_back(body.reading(output));
      outputs_.push_back({.rest = -reading_.back().offset});
    }
    std::tie(x_, v_) = body.start();
  }

  std::optional<std::vector<ContinuousOutput>> solve() {
    const Matrix k = body_.matrix(&Bar::k);
    const Matrix z = body_.matrix(&Bar::z);
    const double k_scale = std::max(largest(k.values), 1e-300);
    const double z_scale = std::max(largest(z.values), 1e-300);
    // Diagonalises a combination with an irrational ratio, because Z can separate modes that are
    // degenerate in K.
    Matrix mixture = k;
    mixture.values = k.values / k_scale + 0.6180339887498949 / z_scale * z.values;
    const Matrix shapes = symmetric_eigenpairs(mixture).vectors;
    const auto is_diagonal = [&](const Matrix& matrix, double scale) {
      Matrix rest = in_basis(matrix, shapes);
      for (std::size_t j = 0; j < rest.rows(); ++j) {
        rest(j, j) = 0.0;
      }
      return largest(rest.values) <= shared_tolerance * scale;
    };
    if (is_diagonal(k, k_scale) && is_diagonal(z, z_scale)) {
      for (std::size_t j = 0; j < shapes.columns(); ++j) {
        add_mode(shapes.column(j), k_scale, z_scale);
      }
    } else if (body_.size() > most_crossed_modes || !add_crossed_modes(k, z)) {
      return std::nullopt;
    }
    return std::move(outputs_);
  }

 private:
  double read(std::size_t output, const Vector& shape) const {
    double sum = 0.0;
    for (const auto& [row, share] : reading_[output].shares) {
      sum += share * shape[row];
    }
    return sum;
  }

  // Solves q'' + damping q' + stiffness q = force for an independent mode.
  void add_mode(const Vector& shape, double k_scale, double z_scale) {
    double stiffness = body_.along(&Bar::k, shape);
    double damping = body_.along(&Bar::z, shape);
    stiffness = stiffness < zero * k_scale ? 0.0 : stiffness;
    damping = damping < zero * z_scale ? 0.0 : damping;
    const double force = dot(shape, body_.force());
    const double q = dot(shape, x_);
    const double v = dot(shape, v_);
    if (stiffness == 0.0) {
      return add_free(shape, damping, force, q, v);
    }
    const double still = force / stiffness;
    for (std::size_t o = 0; o < reading_.size(); ++o) {
      outputs_[o].rest += read(o, shape) * still;
    }
    double inner = stiffness - 0.25 * damping * damping;
    if (std::fabs(inner) < 1e-12 * stiffness) {
      inner = 1e-12 * stiffness;  // Critical damping is perturbed, which gives two distinct poles.
    }
    const Complex omega = std::sqrt(Complex(inner));
    const Complex pole(Complex(-0.5 * damping) + Complex(0.0, 1.0) * omega);
    if (inner > 0.0) {
      const Complex amplitude(q - still, -(v + 0.5 * damping * (q - still)) / omega.real());
      return add_terms(shape, {{amplitude, pole}});
    }
    const double slow = -stiffness / (0.5 * damping + omega.imag());  // Avoids cancellation.
    const double fast = -0.5 * damping - omega.imag();
    const double a = (v - fast * (q - still)) / (slow - fast);
    add_terms(shape, {{a, slow}, {q - still - a, fast}});
  }

  void add_free(const Vector& shape, double damping, double force, double q, double v) {
    for (std::size_t o = 0; o < reading_.size(); ++o) {
      ContinuousOutput& output = outputs_[o];
      const double share = read(o, shape);
      if (damping == 0.0) {
        output.rest += share * q;
        output.drift += share * v;
        output.fall += share * force;
      } else {
        const double final = force / damping;  // Terminal velocity.
        output.rest += share * (q + (v - final) / damping);
        output.drift += share * final;
        output.terms.push_back({-share * (v - final) / damping, -damping});
      }
    }
  }

  void add_terms(const Vector& shape, const std::vector<ContinuousOutput::Term>& terms) {
    for (std::size_t o = 0; o < reading_.size(); ++o) {
      for (const ContinuousOutput::Term& term : terms) {
        outputs_[o].terms.push_back({read(o, shape) * term.amplitude, term.pole});
      }
    }
  }

  // Uses the eigenvectors of the first-order system (x, v)' = (v, f - K x - Z v).
  bool add_crossed_modes(const Matrix& k, const Matrix& z) {
    const std::size_t n = body_.size();
    Matrix flow(2 * n, 2 * n);
    for (std::size_t j = 0; j < n; ++j) {
      flow(j, n + j) = 1.0;
      for (std::size_t i = 0; i < n; ++i) {
        flow(n + i, j) = -k(i, j);
        flow(n + i, n + j) = -z(i, j);
      }
    }
    const std::optional<Vector> still = solution(k, body_.force());
    if (!still) {
      return false;
    }
    Vector state(2 * n);
    state[std::slice(0, n, 1)] = x_ - *still;
    state[std::slice(n, n, 1)] = v_;
    const std::optional<ComplexEigenpairs> pairs = eigenpairs_of_state(flow, state);
    if (!pairs) {
      return false;
    }
    for (std::size_t o = 0; o < reading_.size(); ++o) {
      outputs_[o].rest += read(o, *still);
    }
    for (std::size_t j = 0; j < 2 * n; ++j) {
      const Complex pole = pairs->values[j];
      if (pole.imag() < 0.0) {
        continue;  // Included with its conjugate.
      }
      const std::complex<double> share = pairs->shares[j] * (pole.imag() > 0.0 ? 2.0 : 1.0);
      for (std::size_t o = 0; o < reading_.size(); ++o) {
        Complex amplitude = 0.0;
        for (const auto& [row, part] : reading_[o].shares) {
          amplitude += part * pairs->vectors[j][row] * share;
        }
        outputs_[o].terms.push_back({amplitude, pole});
      }
    }
    return true;
  }

  const ContinuousBody& body_;
  std::vector<Bar> reading_;  // [output]
  Vector x_;                  // [row] Position at the start.
  Vector v_;
  std::vector<ContinuousOutput> outputs_;
};

}  // namespace

std::vector<double> ContinuousOutput::play(std::size_t frames, double step) const {
  // Number of products after which e^(pole t) is computed again, to limit rounding errors.
  constexpr std::size_t anew = 256;
  std::vector<double> sound(frames);
  for (std::size_t n = 0; n < frames; ++n) {
    const double t = step * static_cast<double>(n + 1);
    sound[n] = rest + t * (drift + 0.5 * t * fall);
  }
  for (const Term& term : terms) {
    const std::complex<double> turn = std::exp(term.pole * step);
    std::complex<double> value;
    for (std::size_t n = 0; n < frames; ++n) {
      value = n % anew == 0
                  ? term.amplitude * std::exp(term.pole * (step * static_cast<double>(n + 1)))
                  : value * turn;
      sound[n] += value.real();
    }
  }
  return sound;
}

std::optional<std::vector<ContinuousOutput>> solve_continuous(const Network& network,
                                                              std::span<const double> parameters) {
  if (!network.macros.empty()) {
    return solve_continuous(expand_macros(network), parameters);
  }
  const ContinuousBody body(network, parameters);
  if (!is_linear(network) || !body.has_mass() || body.size() > most_exact_modes ||
      std::ranges::any_of(network.outputs, [](const Output& output) {
        return output.is_force || output.derivative > 0;
      })) {
    return std::nullopt;
  }
  return Solver(network, body).solve();
}

}  // namespace ressort::analysis
