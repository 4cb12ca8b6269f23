#include "core/identification/damped_step.h"

#include "core/lanes.h"

namespace ressort::identification {

template <>
void multiply<kernels::Isa::RESSORT_ISA>(const Product& given) {
  using V = Pack<double, kernels::vector_bytes(kernels::Isa::RESSORT_ISA)>;
  constexpr std::size_t lanes = sizeof(V) / sizeof(double);
  constexpr std::size_t width = 4;  // Columns that are summed at once.
  const std::size_t rows = given.panels * panel_rows;
  for (std::size_t row = 0; row < rows; row += 2 * lanes) {
    const double* const a = given.a + row / panel_rows * given.panel + row % panel_rows;
    for (std::size_t column = 0; column < given.columns; column += width) {
      const double* const b = given.b + column * given.b_column;
      V low[width]{};
      V high[width]{};
      for (std::size_t j = 0; j < given.inner; ++j) {
        const V first = load<V>(a + panel_rows * j);
        const V second = load<V>(a + panel_rows * j + lanes);
        for (std::size_t k = 0; k < width; ++k) {
          low[k] += first * b[k * given.b_column + j];
          high[k] += second * b[k * given.b_column + j];
        }
      }
      for (std::size_t k = 0; k < width; ++k) {
        store<V>(given.c + row + (column + k) * rows, low[k]);
        store<V>(given.c + row + (column + k) * rows + lanes, high[k]);
      }
    }
  }
}

}  // namespace ressort::identification
