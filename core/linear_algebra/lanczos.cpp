#include "core/linear_algebra/lanczos.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "core/random.h"

namespace ressort::linear_algebra {
namespace {

using Dense = Eigen::MatrixXd;
using Index = Eigen::Index;
using Symmetric = Eigen::SelfAdjointEigenSolver<Dense>;  // Its eigenvalues ascend.

constexpr double tolerance = 1e-9;  // Largest residual of a pair, relative to the pair.
// A direction whose norm shrinks below this in the orthogonalisation is dropped.
constexpr double lost = 1e-13;

Dense times(const Multiply& multiply, const Dense& x) {
  Matrix columns(static_cast<std::size_t>(x.rows()), static_cast<std::size_t>(x.cols()));
  std::copy_n(x.data(), x.size(), std::begin(columns.values));
  multiply(columns);
  return Eigen::Map<const Dense>(std::begin(columns.values), x.rows(), x.cols());
}

// Returns a matrix of pseudo-random numbers between -1 and 1, the same on every machine.
Dense scattered(Index rows, Index columns) {
  Dense x(rows, columns);
  std::uint64_t state = 0;
  for (Index i = 0; i < x.size(); ++i) {
    x.data()[i] = static_cast<double>(splitmix64(state) >> 11) * 0x1p-52 - 1.0;
  }
  return x;
}

// W = Q R with Q^T B Q = I; Q has fewer columns if those of W are linearly dependent.
struct Orthogonal {
  Dense q;
  Dense bq;
  Dense r;
};
Orthogonal orthogonal(const Dense& w, const Multiply& b) {
  Orthogonal found{w, times(b, w), Dense::Identity(w.cols(), w.cols())};
  // Two passes: after the first, nearly equal columns consist of rounding error.
  for (int pass = 0; pass < 2; ++pass) {
    const Dense gram = found.q.transpose() * found.bq;
    const Symmetric pairs(gram);
    const double most = std::max(pairs.eigenvalues().maxCoeff(), 0.0);
    const Index width = (pairs.eigenvalues().array() > lost * most).count();
    const Dense vectors = pairs.eigenvectors().rightCols(width);
    const Eigen::VectorXd size = pairs.eigenvalues().tail(width).cwiseSqrt();
    found.q = found.q * vectors * size.cwiseInverse().asDiagonal();
    found.bq = times(b, found.q);
    found.r = size.asDiagonal() * vectors.transpose() * found.r;
  }
  return found;
}

}  // namespace

std::optional<Eigenpairs> lowest_pairs(double shift, int count, int size, const Multiply& inverse,
                                       const Multiply& b, const Progress& progress) {
  const Index n = size;
  const Index width = std::min<Index>(lanczos_block, n);
  const Index most = std::min<Index>(n, 6 * Index{count} + 20 * width);
  if (count < 1 || count > n) {
    return std::nullopt;
  }
  Dense v(n, most);
  Dense bv(n, most);
  Dense t = Dense::Zero(most, most);
  Orthogonal block = orthogonal(times(inverse, times(b, scattered(n, width))), b);
  Index used = 0;
  for (;;) {
    const Index now = block.q.cols();
    v.middleCols(used, now) = block.q;
    bv.middleCols(used, now) = block.bq;
    Dense next = times(inverse, block.bq);
    Dense shares = Dense::Zero(used + now, now);
    for (int twice = 0; twice < 2; ++twice) {
      const Dense share = bv.leftCols(used + now).transpose() * next;
      next.noalias() -= v.leftCols(used + now) * share;
      shares += share;
    }
    t.block(0, used, used + now, now) = shares;
    t.block(used, 0, now, used + now) = shares.transpose();
    used += now;
    progress.spend(static_cast<std::size_t>(n * now * (used + 64)) / 4);
    Orthogonal rest = orthogonal(next, b);
    const bool is_whole = used == n || rest.q.cols() == 0;
    const bool is_full = used + rest.q.cols() > most;
    if (used >= count && (is_whole || is_full || used >= count + width)) {
      const Symmetric all(t.topLeftCorner(used, used));
      const Eigen::VectorXd theta = all.eigenvalues().tail(count);
      const Dense ritz = all.eigenvectors().rightCols(count);
      double residual = 0.0;
      for (Index i = 0; i < count && !is_whole; ++i) {
        residual = std::max(residual, (rest.r * ritz.col(i).tail(now)).norm() / std::abs(theta(i)));
      }
      if (residual <= tolerance && theta(0) > 0.0) {
        // One more application of the inverse damps the remaining components of high eigenvectors.
        const Dense cleaned = times(inverse, bv.leftCols(used) * ritz);
        Eigenpairs pairs{Vector(static_cast<std::size_t>(count)),
                         Matrix(static_cast<std::size_t>(n), static_cast<std::size_t>(count))};
        const Eigen::VectorXd length =
            (cleaned.cwiseProduct(times(b, cleaned))).colwise().sum().cwiseSqrt();
        for (Index i = 0; i < count; ++i) {  // The largest theta belongs to the lowest eigenvalue.
          const Index from = count - 1 - i;
          pairs.values[static_cast<std::size_t>(i)] = shift + 1.0 / theta(from);
          const Eigen::VectorXd vector = cleaned.col(from) / length(from);
          std::copy_n(vector.data(), n, std::begin(pairs.vectors.values) + i * n);
        }
        return pairs;
      }
    }
    if (is_whole || is_full) {
      return std::nullopt;
    }
    block = std::move(rest);
  }
}

}  // namespace ressort::linear_algebra
