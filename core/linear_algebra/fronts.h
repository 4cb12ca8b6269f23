// core/linear_algebra: a Cholesky factorisation for what fills space: nested dissection by the
// places of the nodes, then dense fronts one after the other (multifrontal: Duff and Reid 1983).
// [any thread but audio]
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "core/linear_algebra/matrix.h"
#include "core/progress.h"

namespace ressort::linear_algebra {

// How node `row` of an element pulls with node `column`, axis by axis: [row axis + 3 column axis].
using NodeBlock = std::array<double, 9>;

// A = L LT, of nodes with three unknowns each, 3 node + axis.
class FrontalCholesky {
 public:
  // `pattern` has a row and a column for each node, and its lower triangle; its values are not
  // read. Finds an order and what fills up. O(n log n)
  FrontalCholesky(const SparseMatrix& pattern, std::span<const std::array<double, 3>> places,
                  const Progress& progress);

  // Elements of L, eight bytes each: what it will take.
  double size() const { return size_; }

  // `blocks` one for each element of the pattern; those of the diagonal are symmetric. False where
  // A is not positive definite.
  bool factor(const SparseMatrix& pattern, std::span<const NodeBlock> blocks,
              const Progress& progress);

  // Solves A X = B in place for all columns at once.
  void solve(Matrix& columns) const;

 private:
  // Nodes that are eliminated together, and the later ones that hang on them.
  struct Front {
    std::vector<int> nodes;  // its own, then its border, each in the order of elimination
    std::size_t own = 0;
    int parent = -1;
    std::vector<int> elements;   // of the pattern, that come in here
    std::vector<double> values;  // [3 nodes][3 own] of L, column by column
  };

  void dissect(std::span<int> nodes);
  void find_borders(const SparseMatrix& pattern);

  std::vector<std::vector<int>> neighbours_;  // [node], without itself
  std::vector<std::array<double, 3>> places_;
  std::vector<int> order_;     // [node] when it is eliminated
  std::vector<char> side_;     // of the cut at hand
  std::vector<Front> fronts_;  // children before parents
  double size_ = 0.0;
};

}  // namespace ressort::linear_algebra
