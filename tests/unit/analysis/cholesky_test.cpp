// The factorisation's inverse, against a dense inverse.
#include "core/linear_algebra/cholesky.h"

#include <cmath>
#include <vector>

#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/rooms.h"

namespace ressort::cholesky_test {
namespace {

// Gauss-Jordan elimination of a row-major matrix.
std::vector<double> inverse(std::vector<double> a, std::size_t n) {
  std::vector<double> b(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    b[i * n + i] = 1.0;
  }
  for (std::size_t i = 0; i < n; ++i) {
    const double pivot = a[i * n + i];
    for (std::size_t j = 0; j < n; ++j) {
      a[i * n + j] /= pivot;
      b[i * n + j] /= pivot;
    }
    for (std::size_t k = 0; k < n; ++k) {
      const double factor = k == i ? 0.0 : a[k * n + i];
      for (std::size_t j = 0; j < n; ++j) {
        a[k * n + j] -= factor * a[i * n + j];
        b[k * n + j] -= factor * b[i * n + j];
      }
    }
  }
  return b;
}

TEST_CASE("The diagonal of the inverse matches the dense inverse", "[cholesky]") {
  support::Random random(5);
  for (const std::size_t n : {1u, 2u, 9u, 40u}) {
    for (const std::size_t links : {std::size_t{0}, n, 3 * n}) {
      std::vector<SparseMatrix::Element> elements;
      std::vector<double> dense(n * n, 0.0);
      const auto add = [&](std::size_t i, std::size_t j, double value) {
        elements.push_back(
            {static_cast<int>(std::max(i, j)), static_cast<int>(std::min(i, j)), value});
        dense[i * n + j] += value;
        dense[j * n + i] += i == j ? 0.0 : value;
      };
      for (std::size_t i = 0; i < n; ++i) {
        add(i, i, random.uniform(0.5, 2.0));
      }
      for (std::size_t l = 0; l < links; ++l) {
        const std::size_t i = random.below(n);
        const std::size_t j = random.below(n);
        const double k = random.uniform(0.0, 3.0);
        if (i != j) {
          add(i, i, k);
          add(j, j, k);
          add(i, j, -k);
        }
      }
      const SparseMatrix matrix(static_cast<int>(n), elements);
      Cholesky cholesky;
      REQUIRE(cholesky.analyze(matrix, {}));
      REQUIRE(cholesky.factor(matrix, {}));
      const std::vector<double> found = cholesky.inverse_diagonal({});
      const std::vector<double> whole = inverse(dense, n);
      for (std::size_t i = 0; i < n; ++i) {
        INFO(n << " " << links << " " << i);
        CHECK(found[i] == Approx(whole[i * n + i]).epsilon(1e-12));
      }
    }
  }
}

}  // namespace
}  // namespace ressort::cholesky_test
