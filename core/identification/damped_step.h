// core/identification: the product of two matrices that sums and moments of damped sinusoids need,
// compiled for each instruction set. [any thread but audio]
#pragma once

#include <cstddef>

#include "core/kernels/isa.h"
#include "core/rooms.h"

namespace ressort::identification {

inline constexpr std::size_t panel_rows = 16;

// C = A B. A lies in panels of 16 rows: element (i, j) is a[i / 16 * panel + 16 j + i % 16]. B and
// C are in column-major order. The columns are padded to a multiple of four.
struct Product {
  const double* a;
  std::size_t panel;  // Numbers from one panel of A to the next.
  std::size_t panels;
  std::size_t inner;  // Columns of A.
  const double* b;
  std::size_t b_column;  // Numbers from one column of B to the next.
  std::size_t columns;
  double* c;
};

template <kernels::Isa isa>
void multiply(const Product& given);

}  // namespace ressort::identification
