#include "core/compile/accuracy/accuracy.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/compile/accuracy/springs.h"
#include "core/linear_algebra/eigen.h"

namespace ressort::compile {
namespace {

using Complex = std::complex<double>;
using Poles = std::vector<Complex>;

constexpr double endless = std::numeric_limits<double>::infinity();
constexpr double highest_hz = 20'000.0;
constexpr double longest_s = 3600.0;
constexpr double most_work = 1.5e10;  // multiplications for eigenvalues: some seconds
constexpr std::size_t most_bounded_steps = 400;
constexpr double damping_weight = 6.0;  // of Z beside K, in the ranking of corners

Accuracy unknown() {
  return {.is_known = false};
}

bool is_heard(Complex pole, double rate_hz) {
  const double most = std::min(std::numbers::pi, 2.0 * std::numbers::pi * highest_hz / rate_hz);
  return pole.imag() < most &&
         -pole.real() * 2.0 * std::numbers::pi <= 3.0 * std::numbers::ln10 * pole.imag();
}

Accuracy difference(Complex wanted, Complex found, double rate_hz) {
  const double slowest = -3.0 * std::numbers::ln10 / (longest_s * rate_hz);
  if (found.real() > -slowest) {
    return {endless, endless};  // it grows
  }
  const double decay = std::min(wanted.real(), slowest);
  return {.cents = std::fabs(1200.0 * std::log2(found.imag() / wanted.imag())),
          .t60_percent = std::fabs(100.0 * (decay / std::min(found.real(), slowest) - 1.0))};
}

// Assigns a found pole to each expected one: greedily by relative distance, then by exchanging two
// assignments while that lowers the sum of squared distances. A pole without a partner gets
// `nobody`.
std::vector<std::size_t> pair_up(const Poles& expected, const Poles& found) {
  constexpr std::size_t nobody = static_cast<std::size_t>(-1);
  struct Pair {
    double distance;
    std::size_t from;
    std::size_t to;
  };
  const auto distance = [&](std::size_t i, std::size_t j) {
    return std::abs(found[j] - expected[i]) / std::abs(expected[i]);
  };
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    for (std::size_t j = 0; j < found.size(); ++j) {
      pairs.push_back({distance(i, j), i, j});
    }
  }
  std::ranges::sort(pairs, {}, &Pair::distance);
  std::vector<std::size_t> of(expected.size(), nobody);
  std::vector<bool> is_taken(found.size());
  for (const Pair& pair : pairs) {
    if (of[pair.from] == nobody && !is_taken[pair.to]) {
      of[pair.from] = pair.to;
      is_taken[pair.to] = true;
    }
  }
  const auto square = [&](std::size_t i, std::size_t j) {
    return std::norm(found[j] - expected[i]) / std::norm(expected[i]);
  };
  bool has_changed = true;
  for (std::size_t round = 0; has_changed && round < expected.size(); ++round) {
    has_changed = false;
    for (std::size_t a = 0; a < of.size(); ++a) {
      for (std::size_t b = a + 1; b < of.size(); ++b) {
        if (of[a] != nobody && of[b] != nobody &&
            square(a, of[b]) + square(b, of[a]) < square(a, of[a]) + square(b, of[b])) {
          std::swap(of[a], of[b]);
          has_changed = true;
        }
      }
    }
  }
  return of;
}

// Returns the largest error of the audible partials. `expected`: estimates of where the scheme
// moves the `wanted` poles, which `found` is paired with.
Accuracy compare(const Poles& wanted, const Poles& expected, const Poles& found, double rate_hz) {
  const std::vector<std::size_t> of = pair_up(expected, found);
  Accuracy worst;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (of[i] < found.size()) {
      worst = is_heard(wanted[i], rate_hz)
                  ? worse_of(worst, difference(wanted[i], found[of[i]], rate_hz))
                  : worst;
    } else if (is_heard(wanted[i], rate_hz)) {
      worst = {endless, endless};
    }
  }
  return worst;
}

// Returns the eigenvalues of [0 1; -K -Z] with a positive imaginary part.
Poles continuous_poles(const Springs& springs) {
  const std::size_t n = springs.size();
  Matrix flow(2 * n, 2 * n);
  for (std::size_t j = 0; j < n; ++j) {
    flow(j, n + j) = 1.0;
    for (std::size_t i = 0; i < n; ++i) {
      flow(n + i, j) = -springs.stiffness(i, j);
      flow(n + i, n + j) = -springs.damping(i, j);
    }
  }
  Poles poles;
  for (const Complex& pole : eigenvalues(flow)) {
    if (pole.imag() > 0.0) {
      poles.push_back(pole);
    }
  }
  return poles;
}

}  // namespace

Accuracy worse_of(const Accuracy& a, const Accuracy& b) {
  return {.cents = std::max(a.cents, b.cents),
          .t60_percent = std::max(a.t60_percent, b.t60_percent),
          .is_known = a.is_known && b.is_known,
          .is_bound = a.is_bound || b.is_bound};
}

std::vector<Corner> corners_of(const Program& program, std::span<const double> start_in,
                               std::span<const double> lowest, std::span<const double> highest,
                               double highest_factor) {
  const std::vector<double> start(start_in.begin(), start_in.end());
  std::vector<Corner> corners = {{start, 1.0}};
  std::vector<double> stiffest = start;
  std::size_t moved = 0;
  for (std::size_t i = 0; i < lowest.size(); ++i) {
    if (program.depending[i].empty()) {
      continue;
    }
    double most = steepness_of(program, stiffest, damping_weight);
    for (const double end : {lowest[i], highest[i]}) {
      std::vector<double> turned = start;
      turned[i] = end;
      if (end != start[i] && moved < most_single_parameters) {
        corners.push_back({turned, 1.0});
      }
      std::vector<double> candidate = stiffest;
      candidate[i] = end;
      if (const double both = steepness_of(program, candidate, damping_weight); both > most) {
        most = both;
        stiffest = std::move(candidate);
      }
    }
    moved += lowest[i] < highest[i] ? 1 : 0;
  }
  if (stiffest != start) {
    corners.push_back({stiffest, 1.0});
  }
  if (highest_factor > 1.0) {
    corners.push_back({stiffest, highest_factor});
  }
  return corners;
}

AccuracyMeter::AccuracyMeter(const Program& program, std::vector<Corner> corners,
                             std::size_t most_masses, const Progress& progress)
    : program_(program),
      corners_(std::move(corners)),
      most_masses_(most_masses),
      progress_(progress),
      continuous_(corners_.size()) {}

Accuracy AccuracyMeter::of(const Form& form) {
  const Stepping stepping = stepping_of(form);
  if (stepping.scheme == Stepping::Scheme::exact) {
    // Exact modes apply the linear spring of a nonlinear link as published.
    return contains_bent_springs(program_) ? unknown() : Accuracy{};
  }
  Accuracy worst;
  for (std::size_t i = 0; i < corners_.size() && worst.is_known; ++i) {
    worst = worse_of(worst, at(i, stepping));
  }
  return worst;
}

Poles AccuracyMeter::Continuous::all_poles() const {
  Poles all = poles;
  for (const SpringMode& mode : modes) {
    if (const auto pole = continuous_pole(mode.stiffness, mode.damping)) {
      all.push_back(*pole);
    }
  }
  return all;
}

const AccuracyMeter::Continuous& AccuracyMeter::continuous_at(std::size_t corner) {
  if (continuous_[corner]) {
    return *continuous_[corner];
  }
  Continuous& continuous = continuous_[corner].emplace();
  const std::size_t n = program_.moving;
  if (n > std::max(most_masses_, most_coupled_masses)) {
    continuous.is_known = false;
    return continuous;
  }
  progress_.spend(n * n);
  const Springs springs =
      springs_of(program_, corners_[corner].parameters, corners_[corner].stiffness_factor);
  if (!springs.is_sound) {
    continuous.is_known = false;
    return continuous;
  }
  if (auto modes = modes_of(springs)) {
    continuous.modes = *std::move(modes);
    return continuous;
  }
  continuous.is_proportional = false;
  const double work = 10.0 * std::pow(2.0 * static_cast<double>(n), 3.0);
  if (n > most_coupled_masses || work * 2.0 * static_cast<double>(corners_.size()) > most_work) {
    continuous.is_known = false;
    return continuous;
  }
  progress_.spend(8 * n * n * n);
  continuous.poles = continuous_poles(springs);
  return continuous;
}

Accuracy AccuracyMeter::at(std::size_t corner, const Stepping& stepping) {
  const Program& program = program_;
  const double rate_hz = program.rate_hz;
  const auto compare_modes = [&](const std::vector<SpringMode>& modes) {
    Accuracy worst;
    for (const SpringMode& mode : modes) {
      const auto wanted = continuous_pole(mode.stiffness, mode.damping);
      if (wanted && is_heard(*wanted, rate_hz)) {
        const auto found = stepping.pole(mode.stiffness, mode.damping);
        worst = worse_of(worst,
                         found ? difference(*wanted, *found, rate_hz) : Accuracy{endless, endless});
      }
    }
    return worst;
  };
  const Corner& numbers = corners_[corner];
  // The modes of bodies are exact in the published scheme; the springs between bodies are not.
  const bool has_bodies = !program.modes.empty();
  if (has_bodies && !has_linear_springs(program)) {
    return {};
  }
  if (!has_bodies && program.moving > std::max(most_masses_, most_coupled_masses)) {
    // Rayleigh damping needs no modes: scan all stiffnesses up to the edge bound (Gershgorin).
    const auto proportion = rayleigh_of(program, numbers.parameters, numbers.stiffness_factor);
    if (!proportion) {
      return unknown();
    }
    const double most = numbers.stiffness_factor * steepness_of(program, numbers.parameters, 0.0);
    std::vector<SpringMode> modes;
    for (std::size_t i = 0; i < most_bounded_steps; ++i) {
      const double k = most * std::pow(10.0, -6.0 * static_cast<double>(i) / most_bounded_steps);
      modes.push_back({k, proportion->by_mass + proportion->by_stiffness * k});
    }
    Accuracy bound = compare_modes(modes);
    bound.is_bound = true;
    return bound;
  }
  const Continuous& continuous = continuous_at(corner);
  if (!continuous.is_known) {
    return unknown();
  }
  if (continuous.is_proportional && !has_bodies) {
    return compare_modes(continuous.modes);
  }
  const Poles wanted = continuous.all_poles();
  if (program.moving > most_coupled_masses) {
    return unknown();
  }
  Poles expected;
  for (const Complex& pole : wanted) {
    expected.push_back(
        has_bodies ? pole : stepping.pole(std::norm(pole), -2.0 * pole.real()).value_or(pole));
  }
  progress_.spend(std::size_t{8} * program.moving * program.moving * program.moving);
  const Springs springs =
      springs_of(program, numbers.parameters, numbers.stiffness_factor, has_bodies);
  return compare(wanted, expected, stepping.poles(springs), rate_hz);
}

}  // namespace ressort::compile
