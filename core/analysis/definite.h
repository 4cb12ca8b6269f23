// core/analysis: whether a diagonal less a assembly's sum is positive definite.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/analysis/assembly.h"
#include "core/progress.h"

namespace ressort::analysis {

// D - sum over terms of w g gT by a sparse Cholesky factorisation. Where the zeros are is found out
// at the first use and kept. O(rows) for strings, about O(rows^1.5) for meshes. Keeps a reference.
class Definite {
 public:
  explicit Definite(const Assembly& assembly, Progress progress = {});
  ~Definite();

  // Whether a factorisation takes no more than Cholesky::most_work: not where rows hang together
  // at random. Else nothing else may be asked.
  bool is_feasible();

  // With D by row and w by term: is the matrix positive definite? [any thread but audio]
  bool factor(std::span<const double> diagonal, std::span<const double> weights);

  // With each end that wanders at one node at a time, wherever that is, instead of at all of them:
  // positive definite where `together` is below 1, and surely not where `alone` is 1 or more, as
  // one end is too much by itself. Infinite where the rest is not positive definite. About two
  // factorisations, and a solution for every place of bodies. [any thread but audio]
  struct Wandering {
    double together = 0.0;
    double alone = 0.0;
  };
  Wandering wander(std::span<const double> diagonal, std::span<const double> weights);

  // Solves for x in place, with the last matrix that factor() found positive definite.
  void solve(std::vector<double>& x) const;

 private:
  struct Matrix;
  void find_parts();

  const Assembly& assembly_;
  Progress progress_;
  std::unique_ptr<Matrix> matrix_;
  std::vector<std::uint32_t> part_;  // [row] a row of the same part of what does not wander
};

}  // namespace ressort::analysis
