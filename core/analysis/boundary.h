// core/analysis: finds where stability ends along a line through the weights of an assembly.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "core/analysis/assembly.h"
#include "core/analysis/definite.h"

namespace ressort::analysis {

// The numbers that stability depends on, at one point of the parameter space.
struct Weights {
  std::vector<double> masses;  // [row]
  std::vector<double> terms;   // [term] Its w.
  bool gains_energy = false;   // A negative stiffness or damping makes the motion grow.
};

// The weights along a line, for example while one parameter moves.
using WeightLine = std::function<Weights(double)>;

struct Boundary {
  double value = 0.0;
  // [row] Shape of the motion that does not decay there; empty if unknown.
  std::vector<double> shape;
};

// The largest of sum |g_i| d_i / m_i over the terms, and its term, where d is the sum of |g| w at a
// mass; for a link this is d_a/m_a + d_b/m_b. It is Gershgorin's bound for the matrix of the terms,
// which has the spectrum of M^-1 (K + 2Z), so it is never below the largest eigenvalue.
struct Bound {
  double value = 0.0;
  std::size_t term = 0;
};
Bound edge_bound(const Assembly& assembly, const Weights& weights);

// Finds where 4M - K - 2Z stops being positive definite. Keeps a reference to the assembly and the
// pattern of the factorisation. [any thread but audio]
class BoundaryFinder {
 public:
  // If `is_exact` is false, or if factorisations would take too long, only the edge bound is used.
  BoundaryFinder(const Assembly& assembly, bool is_exact, Progress progress = {});
  bool is_exact();

  // Returns whether the weights are stable. The edge bound often decides at once. A `limit` below 4
  // leaves room for rounding.
  bool holds(const Weights& weights, double limit);

  // Finds the boundary between a safe and an unsafe point: to 13 digits with about eight
  // factorisations if the line is straight, to 6 digits if places move, to 3 digits and on the safe
  // side by the edge bound.
  Boundary between(const WeightLine& line, double safe, double bad);

  // Finds the first boundary beyond `safe`, away from 0 (upwards if `safe` is 0). Empty if there is
  // none up to 1e12.
  std::optional<Boundary> outwards(const WeightLine& line, double safe);

  // Finds the boundary by the edge bound alone, at or above 0 on either side of `safe`, with six
  // evaluations of the line. Empty if it would have to be searched for.
  std::optional<double> bound_crossing(const WeightLine& line, double safe);

  // Returns whether the weights are unstable wherever the moving places are. Call it only where
  // holds() is false.
  bool fails(const Weights& weights);

  // Returns whether D minus the sum over terms is positive definite, with D by row.
  bool is_definite(std::span<const double> diagonal, std::span<const double> terms);

 private:
  bool factors(const Weights& weights, double limit);
  struct Margin {
    double rest = 0.0;
    double size = 0.0;
  };
  Margin margin(const Weights& weights, std::span<const double> shape) const;
  double crossing(const WeightLine& line, std::span<const double> shape, double safe,
                  double bad) const;
  void refine(const Weights& weights, std::vector<double>& shape) const;

  const Assembly& assembly_;
  bool is_exact_;  // True until a factorisation proves too expensive.
  Progress progress_;
  Definite definite_;
};

}  // namespace ressort::analysis
