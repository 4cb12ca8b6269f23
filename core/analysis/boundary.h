// core/analysis: where stability ends on a line through what a assembly's weights may be.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "core/analysis/assembly.h"
#include "core/analysis/definite.h"

namespace ressort::analysis {

// What stability depends on, at one point.
struct Weights {
  std::vector<double> masses;  // [row]
  std::vector<double> terms;   // [term] w
  bool feeds = false;          // negative stiffness or damping makes motion grow by itself
};

// The weights along a line: where one parameter goes, for instance.
using WeightLine = std::function<Weights(double)>;

struct Boundary {
  double value = 0.0;
  std::vector<double> shape;  // of the motion that does not decay there; [row], empty where unknown
};

// The largest of sum |g_i| d_i / m_i over the terms, and whose it is; d is the sum of |g| w at a
// mass, so for a link it is d_a/m_a + d_b/m_b. Never below the largest eigenvalue of
// M^-1 (K + 2Z): Gershgorin's bound on the terms' own matrix, which has the same spectrum.
struct Bound {
  double value = 0.0;
  std::size_t term = 0;
};
Bound edge_bound(const Assembly& assembly, const Weights& weights);

// Looks for where 4M - K - 2Z stops being positive definite. Keeps a reference to the assembly, and
// the factorisation's pattern. [any thread but audio]
class BoundaryFinder {
 public:
  // Not exact, as wanted or because factorisations would take too long: by the edge bound alone.
  BoundaryFinder(const Assembly& assembly, bool is_exact, Progress progress = {});
  bool is_exact();

  // Is it stable there? At once where the edge bound says so. A `limit` below 4 is for rounding.
  bool holds(const Weights& weights, double limit);

  // The edge between a place that holds and one that does not: to 13 digits, with about eight
  // factorisations where the line is straight; to 6 where places move, by the bound to 3, on the
  // safe side.
  Boundary between(const WeightLine& line, double safe, double bad);

  // The first edge beyond `safe`, going away from 0, upwards if `safe` is 0; nothing up to 1e12.
  std::optional<Boundary> outwards(const WeightLine& line, double safe);

  // The edge by the bound alone, on either side of `safe` and 0 or above; at once, with six looks
  // at the line. Nothing where it has to be searched for.
  std::optional<double> met(const WeightLine& line, double safe);

  // Whether it is surely not, wherever it is that places move. Asked where it does not hold.
  bool fails(const Weights& weights);

  // Is D less the sum over terms positive definite, with D by row?
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
  bool is_exact_;  // as far as is known yet
  Progress progress_;
  Definite definite_;
};

}  // namespace ressort::analysis
