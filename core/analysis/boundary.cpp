#include "core/analysis/boundary.h"

#include <algorithm>
#include <cmath>

namespace ressort::analysis {
namespace {

constexpr double limit_of_scheme = 4.0;
constexpr double precision = 1e-13;
// Relative precision of the edge bound, which is an estimate anyway.
constexpr double bound_precision = 1e-3;
// Relative precision of the bisection with moving places (twenty halvings).
constexpr double wandering_precision = 1e-6;
constexpr double rounding = 1e-9;

bool is_usable(const Weights& weights) {
  const auto finite = [](double w) { return std::isfinite(w); };
  return !weights.gains_energy && std::ranges::all_of(weights.masses, [](double m) {
    return m > 0.0 && std::isfinite(m);
  }) && std::ranges::all_of(weights.terms, finite);
}

std::vector<double> diagonal(const Weights& weights, double limit) {
  std::vector<double> all;
  for (const double mass : weights.masses) {
    all.push_back(limit * mass);
  }
  return all;
}

// Calls `use(term, its bound)`.
template <class Use>
void each_bound(const Assembly& assembly, const Weights& weights, Use&& use) {
  std::vector<double> sums(assembly.masses.size(), 0.0);
  for (std::size_t t = 0; t < assembly.terms.size(); ++t) {
    for (const Assembly::Entry& entry : assembly.of(assembly.terms[t])) {
      sums[entry.row] += std::fabs(entry.share) * weights.terms[t];
    }
  }
  for (std::size_t t = 0; t < assembly.terms.size(); ++t) {
    double sum = 0.0;
    for (const Assembly::Entry& entry : assembly.of(assembly.terms[t])) {
      sum += std::fabs(entry.share) * sums[entry.row] / weights.masses[entry.row];
    }
    use(t, weights.terms[t] > 0.0 ? sum : 0.0);
  }
}

}  // namespace

Bound edge_bound(const Assembly& assembly, const Weights& weights) {
  Bound bound;
  each_bound(assembly, weights, [&](std::size_t term, double value) {
    if (value > bound.value) {
      bound = {value, term};
    }
  });
  return bound;
}

BoundaryFinder::BoundaryFinder(const Assembly& assembly, bool is_exact, Progress progress)
    : assembly_(assembly),
      is_exact_(is_exact && assembly.is_complete),
      progress_(std::move(progress)),
      definite_(assembly, progress_) {}

bool BoundaryFinder::is_exact() {
  is_exact_ = is_exact_ && definite_.is_feasible();
  return is_exact_;
}

bool BoundaryFinder::holds(const Weights& weights, double limit) {
  progress_.spend(assembly_.entries.size());
  return assembly_.is_complete && is_usable(weights) &&
         (edge_bound(assembly_, weights).value < limit || factors(weights, limit));
}

bool BoundaryFinder::fails(const Weights& weights) {
  if (!is_exact() || weights.gains_energy) {
    return false;
  }
  return assembly_.wandering_ends == 0 || !is_usable(weights) ||
         definite_.test_moving_ends(diagonal(weights, limit_of_scheme), weights.terms).alone >= 1.0;
}

bool BoundaryFinder::is_definite(std::span<const double> diagonal, std::span<const double> terms) {
  return definite_.factor(diagonal, terms);
}

bool BoundaryFinder::factors(const Weights& weights, double limit) {
  if (!is_exact_ || !is_usable(weights)) {
    return false;
  }
  const std::vector<double> diagonal = analysis::diagonal(weights, limit);
  // A diagonal element that is not positive decides without a factorisation.
  std::vector<double> rest = diagonal;
  for (std::size_t t = 0; t < assembly_.terms.size(); ++t) {
    for (const Assembly::Entry& entry : assembly_.of(assembly_.terms[t])) {
      rest[entry.row] -= weights.terms[t] * entry.share * entry.share;
    }
  }
  if (std::ranges::all_of(rest, [](double d) { return d > 0.0; }) && is_exact() &&
      definite_.factor(diagonal, weights.terms)) {
    return true;
  }
  return assembly_.wandering_ends > 0 && is_exact() &&
         definite_.test_moving_ends(diagonal, weights.terms).together < 1.0 - rounding;
}

// Returns x^T (4M - K - 2Z) x, and the larger of the two terms of that difference.
BoundaryFinder::Margin BoundaryFinder::margin(const Weights& weights,
                                              std::span<const double> shape) const {
  double inertia = 0.0;
  for (std::size_t i = 0; i < shape.size(); ++i) {
    inertia += limit_of_scheme * weights.masses[i] * shape[i] * shape[i];
  }
  double pull = 0.0;
  for (std::size_t t = 0; t < assembly_.terms.size(); ++t) {
    double stretch = 0.0;
    for (const Assembly::Entry& entry : assembly_.of(assembly_.terms[t])) {
      stretch += entry.share * shape[entry.row];
    }
    pull += weights.terms[t] * stretch * stretch;
  }
  return {inertia - pull, std::max(inertia, pull)};
}

// Finds where the margin of this shape is 0: directly if the line is straight, else by bisection.
double BoundaryFinder::crossing(const WeightLine& line, std::span<const double> shape, double safe,
                                double bad) const {
  constexpr double rounding = 1e-14;
  double inside = margin(line(safe), shape).rest;
  double outside = margin(line(bad), shape).rest;
  if (!(inside > 0.0 && outside < 0.0 && std::isfinite(outside))) {
    return bad;
  }
  const double straight = safe + (bad - safe) * inside / (inside - outside);
  const Margin there = margin(line(straight), shape);
  if (std::fabs(there.rest) < rounding * there.size) {
    return straight;
  }
  // The Illinois method: a secant through both ends, where an end that stays twice counts half
  // (Dowell and Jarratt 1971). Both ends converge to the crossing.
  int stayed = 0;  // 1: the bad end, -1: the safe end
  for (int i = 0; i < 100; ++i) {
    const double middle = safe + 0.5 * (bad - safe);
    if (middle == safe || middle == bad) {
      break;
    }
    double next = safe + (bad - safe) * inside / (inside - outside);
    next = std::min(safe, bad) < next && next < std::max(safe, bad) ? next : middle;
    const double here = margin(line(next), shape).rest;
    if (std::fabs(here) < rounding * there.size) {
      return next;
    }
    if (here > 0.0) {
      safe = next;
      inside = here;
      outside *= stayed == 1 ? 0.5 : 1.0;
      stayed = 1;
    } else {
      bad = next;
      outside = here;
      inside *= stayed == -1 ? 0.5 : 1.0;
      stayed = -1;
    }
  }
  return bad;
}

// Moves the shape towards the eigenvector of the smallest eigenvalue of the last factored matrix,
// by inverse iteration.
void BoundaryFinder::refine(const Weights& weights, std::vector<double>& shape) const {
  for (int i = 0; i < 3; ++i) {
    double largest = 0.0;
    for (std::size_t row = 0; row < shape.size(); ++row) {
      shape[row] *= weights.masses[row];
    }
    definite_.solve(shape);
    for (const double x : shape) {
      largest = std::max(largest, std::fabs(x));
    }
    for (double& x : shape) {
      x /= largest;
    }
  }
}

// Each term's bound is affine in the weights, or in their inverse if the weight is a mass. Two
// points therefore give the place where the first bound reaches the limit.
std::optional<double> BoundaryFinder::bound_crossing(const WeightLine& line, double safe) {
  const double other = safe > 0.0 ? 0.5 * safe : 1.0;
  const auto bounds_at = [&](double at) {
    std::vector<double> bounds(assembly_.terms.size());
    each_bound(assembly_, line(at), [&](std::size_t term, double value) { bounds[term] = value; });
    return bounds;
  };
  const std::vector<double> here = bounds_at(safe);
  const std::vector<double> there = bounds_at(other);
  const auto first_meeting = [&](double from, double to) {
    double nearest = HUGE_VAL;
    for (std::size_t t = 0; t < here.size(); ++t) {
      const double slope = (there[t] - here[t]) / (to - from);
      const double meets = from + (limit_of_scheme - here[t]) / slope;
      nearest = meets > from ? std::min(nearest, meets) : nearest;
    }
    return nearest;
  };
  constexpr double step = 1e-9;
  const auto is_boundary = [&](double at) {
    const double outwards = at > safe ? 1.0 + step : 1.0 - step;
    return std::isfinite(at) && at > 0.0 && holds(line(at / outwards), limit_of_scheme) &&
           !holds(line(at * outwards), limit_of_scheme);
  };
  if (const double up = first_meeting(safe, other); is_boundary(up)) {
    return up;
  }
  if (safe > 0.0) {
    if (const double down = 1.0 / first_meeting(1.0 / safe, 1.0 / other); is_boundary(down)) {
      return down;
    }
  }
  return std::nullopt;
}

Boundary BoundaryFinder::between(const WeightLine& line, double safe, double bad) {
  const bool is_exact = this->is_exact() && assembly_.wandering_ends == 0;
  std::vector<double> shape(is_exact ? assembly_.masses.size() : 0);
  for (std::size_t i = 0; i < shape.size(); ++i) {
    shape[i] = std::cos(static_cast<double>(i * i));  // A start vector that favours no mode.
  }
  const auto is_safe = [&](double at) {
    const Weights weights = line(at);
    return is_exact ? factors(weights, limit_of_scheme) : holds(weights, limit_of_scheme);
  };
  // True while the factor of the matrix at `safe` is available.
  bool has_factor = is_exact && is_safe(safe);
  for (int round = 0; round < 100; ++round) {
    const double enough = is_exact           ? precision
                          : this->is_exact() ? wandering_precision
                                             : bound_precision;
    if (std::fabs(bad - safe) <= enough * std::max(std::fabs(bad), std::fabs(safe))) {
      break;
    }
    double next = safe + 0.5 * (bad - safe);
    if (has_factor) {
      refine(line(safe), shape);
      // This shape is unstable beyond the crossing, so the boundary is not farther. Most of the way
      // to it is safe; the better the shape, the more of it.
      bad = crossing(line, shape, safe, bad);
      next = bad - 0.01 * (bad - safe);
    }
    has_factor = is_safe(next);
    (has_factor ? safe : bad) = next;
    has_factor &= is_exact;
  }
  return {is_exact ? bad : safe, std::move(shape)};
}

std::optional<Boundary> BoundaryFinder::outwards(const WeightLine& line, double safe) {
  const double direction = safe < 0.0 ? -1.0 : 1.0;
  const auto is_safe = [&](double at) { return holds(line(at), limit_of_scheme); };
  if (is_safe(safe + direction * 1e12 * std::max(std::fabs(safe), 1.0))) {
    return std::nullopt;
  }
  double step = direction * std::max(std::fabs(safe), 1e-9);
  double before = safe;
  while (is_safe(safe + step)) {
    before = safe + step;
    step *= 16.0;
  }
  return between(line, before, safe + step);
}

}  // namespace ressort::analysis
