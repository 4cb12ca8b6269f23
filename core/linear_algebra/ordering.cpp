#include <Eigen/OrderingMethods>

#include "core/linear_algebra/eigen.h"

namespace ressort::linear_algebra {

std::vector<int> order_of_elimination(const SparseMatrix& pattern) {
  // The algorithm needs both triangles and destroys its input.
  using Pattern = Eigen::SparseMatrix<double>;
  const int size = pattern.size();
  const Eigen::Map<const Pattern> lower(size, size, pattern.first.back(), pattern.first.data(),
                                        pattern.row.data(), pattern.value.data());
  const Pattern whole = lower.selfadjointView<Eigen::Lower>();
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> back;
  Eigen::AMDOrdering<int>()(whole, back);
  std::vector<int> order(static_cast<std::size_t>(size));
  for (int i = 0; i < size; ++i) {
    order[static_cast<std::size_t>(back.indices()[i])] = i;
  }
  return order;
}

}  // namespace ressort::linear_algebra
