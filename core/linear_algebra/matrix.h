// core/linear_algebra: matrices as plain numbers, so that no other room includes a matrix library.
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

// Returns the largest magnitude, or 0 for an empty vector.
inline double largest(const Vector& values) {
  double most = 0.0;
  for (const double value : values) {
    most = std::abs(value) > most ? std::abs(value) : most;
  }
  return most;
}

// A dense matrix in column-major order.
class Matrix {
 public:
  Matrix() = default;
  // Makes a matrix of zeros.
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

// A symmetric sparse matrix: its lower triangle, column by column with ascending rows. The first
// element of each column is its diagonal, which is stored even if it is 0.
struct SparseMatrix {
  struct Element {
    int row = 0;
    int column = 0;  // Not above `row`.
    double value = 0.0;
  };

  // Adds up elements at the same place in the order given. O(elements)
  SparseMatrix(int size, std::span<const Element> elements);

  int size() const { return static_cast<int>(first.size()) - 1; }
  // Returns the index into `value` of an existing element. O(log elements)
  std::size_t find(int row, int column) const;

  std::vector<int> first;  // [column] Index of its first element; then the number of elements.
  std::vector<int> row;    // [element]
  std::vector<double> value;
};

// Returns the full symmetric matrix. O(size^2)
Matrix dense(const SparseMatrix& lower);

}  // namespace ressort::linear_algebra
