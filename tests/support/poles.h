// tests: the step matrix of a kernel on a linear network, the network's matrices, and the poles of
// both. Needs Eigen.
#pragma once

#include <algorithm>
#include <complex>
#include <vector>

#include "core/laws/laws.h"
#include "tests/support/dense.h"
#include "tests/support/harness.h"

namespace ressort::support {

// Returns the map of (x, v) of the moving nodes over one sample, found by stepping the kernel from
// each unit vector. Links act from the second sample on.
template <class T = double>
Eigen::MatrixXd transition(const Program& program, Isa isa = best_isa()) {
  Bare<T> bare(program, 1, isa);
  const auto n = static_cast<Eigen::Index>(program.moving);
  Eigen::MatrixXd first(2 * n, 2 * n);
  Eigen::MatrixXd second(2 * n, 2 * n);
  std::vector<double> x(program.position.size());
  std::vector<double> v(x.size());
  const std::vector<double> hands(program.inputs.size(), 0.0);
  const auto save_to = [&](auto column) {
    REQUIRE(bare.kernel().save(0, x.data(), v.data()));
    for (Eigen::Index i = 0; i < n; ++i) {
      column(i) = x[static_cast<std::size_t>(i)];
      column(n + i) = v[static_cast<std::size_t>(i)];
    }
  };
  for (Eigen::Index i = 0; i < 2 * n; ++i) {
    std::fill(x.begin(), x.end(), 0.0);
    std::fill(v.begin(), v.end(), 0.0);
    (i < n ? x[static_cast<std::size_t>(i)] : v[static_cast<std::size_t>(i - n)]) = 1.0;
    bare.kernel().set_state(0, x.data(), v.data());
    bare.step(hands);
    save_to(first.col(i));
    bare.step(hands);
    save_to(second.col(i));
  }
  return second * inverse_of(first);
}

struct Pole {
  double hertz = 0.0;
  double t60_s = 0.0;
  std::complex<double> z;
};

inline Pole pole_of(std::complex<double> z, double rate_hz = Network::reference_rate_hz) {
  return {.hertz = std::arg(z) * rate_hz / (2.0 * std::numbers::pi),
          .t60_s = -std::log(1000.0) / (rate_hz * std::log(std::abs(z))),
          .z = z};
}

// Returns the oscillating poles by frequency.
inline std::vector<Pole> poles_of(const Eigen::MatrixXd& step) {
  std::vector<Pole> poles;
  const Eigen::VectorXcd values = eigenvalues_of(step);
  for (const std::complex<double>& z : values) {
    if (z.imag() > 0.0) {
      poles.push_back(pole_of(z));
    }
  }
  std::sort(poles.begin(), poles.end(),
            [](const Pole& a, const Pole& b) { return a.hertz < b.hertz; });
  return poles;
}

inline double spectral_radius(const Eigen::MatrixXd& step) {
  return eigenvalues_of(step).cwiseAbs().maxCoeff();
}

// Masses, springs and dampers of a Program with springs only, at its own rate.
struct Matrices {
  Eigen::VectorXd mass;
  Eigen::MatrixXd stiffness;
  Eigen::MatrixXd damping;
};

inline Matrices matrices_of(const Program& program) {
  const auto n = static_cast<Eigen::Index>(program.moving);
  const auto value = [&](std::uint32_t c) {
    return coefficient_value(program, program.coefficients[c], program.parameters, 1.0);
  };
  Matrices matrices{Eigen::VectorXd(n), Eigen::MatrixXd::Zero(n, n), Eigen::MatrixXd::Zero(n, n)};
  for (const MassRun& run : program.mass_runs) {
    for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
      matrices.mass(i) = 1.0 / value(run.inverse_mass);
      matrices.stiffness(i, i) += run.is_oscillator ? value(run.stiffness) : 0.0;
      matrices.damping(i, i) += run.is_oscillator ? value(run.damping) : 0.0;
    }
  }
  for (const LinkRun& run : program.link_runs) {
    REQUIRE(run.law == Law::spring);
    for (std::uint32_t link = run.first; link < run.first + run.count; ++link) {
      const std::uint32_t ends[] = {program.ends[link].a, program.ends[link].b};
      for (const std::uint32_t a : ends) {
        for (const std::uint32_t b : ends) {
          if (a < program.moving && b < program.moving) {
            const double sign = a == b ? 1.0 : -1.0;
            matrices.stiffness(a, b) += sign * value(run.coefficients[0]);
            matrices.damping(a, b) += sign * value(run.coefficients[1]);
          }
        }
      }
    }
  }
  return matrices;
}

// Poles of the sampled continuous network: e^s for every root of M s^2 + Z s + K.
inline std::vector<Pole> continuous_poles(const Matrices& matrices) {
  const Eigen::Index n = matrices.mass.size();
  Eigen::MatrixXd motion = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  motion.topRightCorner(n, n).setIdentity();
  const Eigen::VectorXd w = matrices.mass.cwiseInverse();
  motion.bottomLeftCorner(n, n) = -(w.asDiagonal() * matrices.stiffness);
  motion.bottomRightCorner(n, n) = -(w.asDiagonal() * matrices.damping);
  std::vector<Pole> poles;
  const Eigen::VectorXcd values = eigenvalues_of(motion);
  for (const std::complex<double>& s : values) {
    if (s.imag() > 0.0) {
      poles.push_back(pole_of(std::exp(s)));
    }
  }
  std::sort(poles.begin(), poles.end(),
            [](const Pole& a, const Pole& b) { return a.hertz < b.hertz; });
  return poles;
}

// The continuous network's motion in closed form, for proportional dampers and equal masses. Each
// mode has the given values at the start and one sample later.
class Continuous {
 public:
  explicit Continuous(const Program& program) {
    const Matrices matrices = matrices_of(program);
    const Eigenbasis modes = eigenbasis_of(matrices.stiffness / matrices.mass(0));
    shapes_ = modes.vectors;
    const Eigen::MatrixXd damping =
        shapes_.transpose() * matrices.damping * shapes_ / matrices.mass(0);
    REQUIRE((damping - Eigen::MatrixXd(damping.diagonal().asDiagonal())).norm() < 1e-12);
    const Eigen::Index n = matrices.mass.size();
    Eigen::VectorXd x(n);
    Eigen::VectorXd v(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      x(i) = program.position[static_cast<std::size_t>(i)];
      v(i) = program.velocity[static_cast<std::size_t>(i)];
    }
    const Eigen::VectorXd before = shapes_.transpose() * x;
    const Eigen::VectorXd after = shapes_.transpose() * (x + v);
    for (Eigen::Index j = 0; j < n; ++j) {
      const double sigma = 0.5 * damping(j, j);
      const double omega = std::sqrt(modes.values(j) - sigma * sigma);
      step_.emplace_back(std::polar(std::exp(-sigma), omega));
      const double sine =
          (after(j) * std::exp(sigma) - before(j) * std::cos(omega)) / std::sin(omega);
      start_.emplace_back(before(j), -sine);
    }
  }

  // Returns the position of a node at samples 0, 1, 2, ...
  std::vector<double> at(std::uint32_t node, std::size_t frames) const {
    std::vector<double> sum(frames, 0.0);
    for (std::size_t j = 0; j < step_.size(); ++j) {
      std::complex<double> q = start_[j] * shapes_(node, static_cast<Eigen::Index>(j));
      for (double& x : sum) {
        x += q.real();
        q *= step_[j];
      }
    }
    return sum;
  }

 private:
  Eigen::MatrixXd shapes_;
  std::vector<std::complex<double>> step_;   // [mode] e^s
  std::vector<std::complex<double>> start_;  // [mode]
};

}  // namespace ressort::support
