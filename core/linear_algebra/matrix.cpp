#include "core/linear_algebra/matrix.h"

#include <algorithm>
#include <numeric>

namespace ressort::linear_algebra {

SparseMatrix::SparseMatrix(int size, std::span<const Element> elements) {
  std::vector<Element> sorted;
  sorted.reserve(elements.size() + static_cast<std::size_t>(size));
  for (int i = 0; i < size; ++i) {
    sorted.push_back({i, i, 0.0});
  }
  sorted.insert(sorted.end(), elements.begin(), elements.end());
  // Stable radix sort: by row, then by column.
  std::vector<Element> from(sorted.size());
  std::vector<std::size_t> next(static_cast<std::size_t>(size) + 1);
  for (int Element::*key : {&Element::row, &Element::column}) {
    from.swap(sorted);
    std::fill(next.begin(), next.end(), 0);
    for (const Element& element : from) {
      ++next[static_cast<std::size_t>(element.*key) + 1];
    }
    std::partial_sum(next.begin(), next.end(), next.begin());
    sorted.resize(from.size());
    for (const Element& element : from) {
      sorted[next[static_cast<std::size_t>(element.*key)]++] = element;
    }
  }
  first.assign(static_cast<std::size_t>(size) + 1, 0);
  for (const Element& element : sorted) {
    const auto column = static_cast<std::size_t>(element.column);
    if (first[column + 1] > 0 && row.back() == element.row) {
      value.back() += element.value;
    } else {
      row.push_back(element.row);
      value.push_back(element.value);
      ++first[column + 1];
    }
  }
  std::partial_sum(first.begin(), first.end(), first.begin());
}

std::size_t SparseMatrix::find(int wanted, int column) const {
  const auto begin = row.begin() + first[static_cast<std::size_t>(column)];
  const auto end = row.begin() + first[static_cast<std::size_t>(column) + 1];
  return static_cast<std::size_t>(std::lower_bound(begin, end, wanted) - row.begin());
}

Matrix dense(const SparseMatrix& lower) {
  const auto size = static_cast<std::size_t>(lower.size());
  Matrix matrix(size, size);
  for (std::size_t j = 0; j < size; ++j) {
    for (auto i = static_cast<std::size_t>(lower.first[j]);
         i < static_cast<std::size_t>(lower.first[j + 1]); ++i) {
      const auto row = static_cast<std::size_t>(lower.row[i]);
      matrix(row, j) = matrix(j, row) = lower.value[i];
    }
  }
  return matrix;
}

}  // namespace ressort::linear_algebra
