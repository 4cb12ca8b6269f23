#include "core/analysis/continuous.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/analysis/modes/linear_system.h"
#include "core/analysis/modes/quadratic.h"
#include "core/analysis/places.h"
#include "core/linear_algebra/eigen.h"
#include "core/model/topology.h"

namespace ressort::analysis {
namespace {

using Complex = std::complex<double>;

// A stiffness or damping below this share of the largest counts as 0.
constexpr double zero = 1e-13;

// Solves a network whose arguments are numbers. Rows are those of its linear system.
class Solver {
 public:
  Solver(const Network& network, const LinearSystem& system)
      : network_(network),
        system_(system),
        x_(system.size()),
        v_(system.size()),
        force_(system.size()) {
    std::vector<std::size_t> row(network.masses.size());
    for (std::size_t i = 0; i < system.size(); ++i) {
      const Mass& mass = network.masses[system.masses[i]];
      const double root = system.root[i];
      row[system.masses[i]] = i;
      x_[i] = root * mass.position;
      v_[i] = root * initial_velocity(network, mass);
      if (mass.gravity != no_argument) {
        force_[i] = -argument_value(network, mass.gravity, {}) /
                    (mass.gravity_per_rate ? Network::reference_rate_hz : 1.0) / root;
      }
    }
    for (const ModalSpring& spring : system.springs) {
      if (spring.is_link) {
        const Link& link = network.links[spring.element];
        const double pull = spring.stiffness * (held(link.b) - held(link.a));
        for (const auto& [i, share] : system.of(spring)) {
          force_[i] += pull * share;
        }
      }
    }
    for (const Output& output : network.outputs) {
      const double level = level_value(network, output, {});
      outputs_.push_back({.rest = level * held(output.mass)});
      auto& shares = readings_.emplace_back();
      each_share(network, output.mass, [&](std::uint32_t mass, double share) {
        if (moves(network.masses[mass])) {
          shares.emplace_back(row[mass], level * share / system.root[row[mass]]);
        }
      });
    }
  }

  std::optional<std::vector<ContinuousOutput>> solve() {
    const Matrix k = dense(system_.stiffness());
    const Matrix z = dense(system_.damping());
    const double stiffest = std::max(largest(k.values), 1e-300);
    const double most_damped = std::max(largest(z.values), 1e-300);
    const auto swings = swings_of(k, z, 0.0, zero * stiffest, system_.size() <= most_crossed_modes);
    if (!swings) {
      return std::nullopt;
    }
    for (std::size_t j = 0; j < swings->basis.columns(); ++j) {
      add_mode(swings->basis.column(j), zero * stiffest, zero * most_damped);
    }
    if (!swings->is_proportional && !add_swings(swings->all, k, z)) {
      return std::nullopt;
    }
    return std::move(outputs_);
  }

 private:
  // Returns the part of a position that masses which do not move contribute.
  double held(std::uint32_t mass) const {
    double sum = 0.0;
    each_share(network_, mass, [&](std::uint32_t i, double share) {
      sum += moves(network_.masses[i]) ? 0.0 : share * network_.masses[i].position;
    });
    return sum;
  }

  // Returns the stiffness or damping of a shape as a sum of squares, which is accurate for small
  // values, too.
  double along(double ModalSpring::*of, const Vector& shape) const {
    double sum = 0.0;
    for (const ModalSpring& spring : system_.springs) {
      double stretch = 0.0;
      for (const auto& [row, share] : system_.of(spring)) {
        stretch += share * shape[row];
      }
      sum += spring.*of * stretch * stretch;
    }
    return sum;
  }

  template <class Shape>
  auto read(std::size_t output, const Shape& shape) const {
    auto sum = 0.0 * shape[0];
    for (const auto& [row, share] : readings_[output]) {
      sum += share * shape[row];
    }
    return sum;
  }

  // Solves q'' + damping q' + stiffness q = force for an independent mode.
  void add_mode(const Vector& shape, double least_stiffness, double least_damping) {
    double stiffness = along(&ModalSpring::stiffness, shape);
    double damping = along(&ModalSpring::damping, shape);
    stiffness = stiffness < least_stiffness ? 0.0 : stiffness;
    damping = damping < least_damping ? 0.0 : damping;
    const double force = dot(shape, force_);
    const double q = dot(shape, x_);
    const double v = dot(shape, v_);
    if (stiffness == 0.0) {
      return add_free(shape, damping, force, q, v);
    }
    const double still = force / stiffness;
    for (std::size_t o = 0; o < readings_.size(); ++o) {
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
    for (std::size_t o = 0; o < readings_.size(); ++o) {
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
    for (std::size_t o = 0; o < readings_.size(); ++o) {
      for (const ContinuousOutput::Term& term : terms) {
        outputs_[o].terms.push_back({read(o, shape) * term.amplitude, term.pole});
      }
    }
  }

  // Adds the modes of non-proportional damping. Returns false if some motions do not oscillate.
  bool add_swings(const std::vector<Swing>& swings, const Matrix& k, const Matrix& z) {
    const std::optional<Vector> still = solution(k, force_);
    if (!still || swings.size() != system_.size()) {
      return false;
    }
    const Vector x = x_ - *still;
    Vector rubbed(x.size());
    for (std::size_t j = 0; j < x.size(); ++j) {
      rubbed += x[j] * z.column(j);
    }
    for (std::size_t o = 0; o < readings_.size(); ++o) {
      outputs_[o].rest += read(o, *still);
    }
    for (const auto& [mu, shape] : swings) {
      Complex start;
      for (std::size_t i = 0; i < x.size(); ++i) {
        start += shape[i] * (mu * x[i] + rubbed[i] + v_[i]);
      }
      for (std::size_t o = 0; o < readings_.size(); ++o) {
        outputs_[o].terms.push_back({read(o, shape) * start / Complex(0.0, mu.imag()), mu});
      }
    }
    return true;
  }

  const Network& network_;
  const LinearSystem& system_;
  std::vector<std::vector<std::pair<std::size_t, double>>> readings_;  // [output] Row and weight.
  Vector x_;      // [row] Position at the start.
  Vector v_;      // [row]
  Vector force_;  // [row] Force with every mass at 0.
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
  const Network whole = evaluated(expand_macros(network), parameters);
  const LinearSystem system = make_linear_system(whole, 1.0, false);
  if (!whole.waveguides.empty() || !system.is_linear || !system.is_sound || system.size() == 0 ||
      system.size() > most_exact_modes ||
      std::ranges::any_of(whole.outputs, [](const Output& output) {
        return output.is_force || output.derivative > 0;
      })) {
    return std::nullopt;
  }
  return Solver(whole, system).solve();
}

}  // namespace ressort::analysis
