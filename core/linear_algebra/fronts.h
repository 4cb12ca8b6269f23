// core/linear_algebra: Cholesky factorisation for three-dimensional meshes: nested dissection by
// the node coordinates, then dense frontal matrices (multifrontal method: Duff and Reid 1983). [any
// thread but audio]
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "core/linear_algebra/matrix.h"
#include "core/progress.h"

namespace ressort::linear_algebra {

// The 3 x 3 coupling of node `row` with node `column`: [row axis + 3 column axis].
using NodeBlock = std::array<double, 9>;

// A = L L^T for nodes with three unknowns each, numbered 3 node + axis.
class FrontalCholesky {
 public:
  // Finds the elimination order and the fill. The lower triangle of `pattern` has a row and a
  // column per node; its values are not read. O(n log n)
  FrontalCholesky(const SparseMatrix& pattern, std::span<const std::array<double, 3>> places,
                  const Progress& progress);

  // Number of elements of L, eight bytes each.
  double size() const { return size_; }

  // Factors the matrix with one block for each element of the pattern; diagonal blocks are
  // symmetric. Returns false if A is not positive definite.
  bool factor(const SparseMatrix& pattern, std::span<const NodeBlock> blocks,
              const Progress& progress);

  // Solves A X = B in place for all columns.
  void solve(Matrix& columns) const;

 private:
  // Nodes that are eliminated together, and the later nodes coupled to them (the border).
  struct Front {
    std::vector<int> nodes;  // Its own nodes, then its border, each in elimination order.
    std::size_t own = 0;
    int parent = -1;
    std::vector<int> elements;   // Elements of the pattern that are assembled in this front.
    std::vector<double> values;  // [3 nodes][3 own] of L, column by column
  };

  void dissect(std::span<int> nodes);
  void find_borders(const SparseMatrix& pattern);

  std::vector<std::vector<int>> neighbours_;  // [node] Adjacent nodes, excluding itself.
  std::vector<std::array<double, 3>> places_;
  std::vector<int> order_;     // [node] Its position in the elimination order.
  std::vector<char> side_;     // [node] Side of the current cut.
  std::vector<Front> fronts_;  // Children before parents.
  double size_ = 0.0;
};

}  // namespace ressort::linear_algebra
