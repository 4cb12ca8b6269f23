// core/linear_algebra: matrices as plain numbers, so that nobody else needs a library's.
#pragma once

#include <cmath>
#include <complex>
#include <cstddef>
#include <span>
#include <valarray>
#include <vector>

#include "core/rooms.h"

namespace ressort::linear_algebra {

using Vector = std::valarray<double>;
using ComplexVector = std::valarray<std::complex<double>>;

inline double dot(const Vector& a, const Vector& b) {
  return (a * b).sum();
}

inline double length(const ComplexVector& a) {
  double sum = 0.0;
  for (const std::complex<double>& value : a) {
    sum += std::norm(value);
  }
  return std::sqrt(sum);
}

// The largest magnitude, 0 of none.
inline double largest(const Vector& values) {
  double most = 0.0;
  for (const double value : values) {
    most = std::abs(value) > most ? std::abs(value) : most;
  }
  return most;
}

// Dense, column by column.
class Matrix {
 public:
  Matrix() = default;
  // All 0.
  Matrix(std::size_t rows, std::size_t columns) : values(rows * columns), rows_(rows) {}

  std::size_t rows() const { return rows_; }
  std::size_t columns() const { return rows_ == 0 ? 0 : values.size() / rows_; }
  double& operator()(std::size_t row, std::size_t column) { return values[row + column * rows_]; }
  double operator()(std::size_t row, std::size_t column) const {
    return values[row + column * rows_];
  }
  Vector column(std::size_t c) const { return values[std::slice(c * rows_, rows_, 1)]; }

  Vector values;

 private:
  std::size_t rows_ = 0;
};

// Symmetric and sparse: its lower triangle, column by column with ascending rows. A column's first
// element is its diagonal, which is there even where it is 0.
struct SparseMatrix {
  struct Element {
    int row = 0;
    int column = 0;  // at most `row`
    double value = 0.0;
  };

  // Elements of the same place are added up, in their order. O(elements)
  SparseMatrix(int size, std::span<const Element> elements);

  int size() const { return static_cast<int>(first.size()) - 1; }
  // Index into `value`, of an element that is there. O(log)
  std::size_t find(int row, int column) const;

  std::vector<int> first;  // [column] of its elements; then their number
  std::vector<int> row;    // [element]
  std::vector<double> value;
};

// All of the symmetric matrix. O(size^2)
Matrix dense(const SparseMatrix& lower);

}  // namespace ressort::linear_algebra
