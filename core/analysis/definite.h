// core/analysis: tests whether a diagonal minus the sum of an assembly is positive definite.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/analysis/assembly.h"
#include "core/progress.h"

namespace ressort::analysis {

// Tests D - sum over terms of w g g^T by sparse Cholesky factorisation. The pattern is analysed at
// the first use and kept. O(rows) for strings, about O(rows^1.5) for meshes. Keeps a reference to
// the assembly.
class Definite {
 public:
  explicit Definite(const Assembly& assembly, Progress progress = {});
  ~Definite();

  // Returns whether a factorisation stays within Cholesky::most_work, which it does not for
  // randomly connected rows. If false, no other member may be called.
  bool is_feasible();

  // Factors the matrix with D by row and w by term. Returns whether it is positive definite. [any
  // thread but audio]
  bool factor(std::span<const double> diagonal, std::span<const double> weights);

  // Tests the matrix with each moving end at one node at a time instead of at all of them. It is
  // positive definite if `together` is below 1, and not positive definite if `alone` is 1 or more,
  // since then a single end is too much. Infinite if the rest is not positive definite. Takes about
  // two factorisations, and one solution for every place of a body. [any thread but audio]
  struct Wandering {
    double together = 0.0;
    double alone = 0.0;
  };
  Wandering test_moving_ends(std::span<const double> diagonal, std::span<const double> weights);

  // Solves for x in place with the last matrix that factor() found positive definite.
  void solve(std::vector<double>& x) const;

 private:
  struct Matrix;
  void find_parts();

  const Assembly& assembly_;
  Progress progress_;
  std::unique_ptr<Matrix> matrix_;
  // [row] A representative row of the connected part, moving terms excluded.
  std::vector<std::uint32_t> part_;
};

}  // namespace ressort::analysis
