// core/kernels: where the rows of a regular network lie among the slots of a Grid.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/kernels/grid/grid_rows.h"

namespace ressort::kernels {

// Slots in a row, with the same offsets to what they are linked to.
struct GridSpan {
  std::uint32_t first = 0;  // multiples of grid_line
  std::uint32_t count = 0;
};

struct GridPlaces {
  std::uint32_t reach = 0;             // no offset may be larger
  std::uint32_t slots = 0;             // at least twice `reach` more than the spans, on either side
  std::vector<std::uint32_t> slot;     // [node], or nowhere
  std::vector<std::uint32_t> node_at;  // [slot], or nowhere
  std::vector<GridSpan> spans;         // in order
};

// Every row at the same distance from the last, shifted so that its links have the offsets of those
// before. One span. Nothing where that would take more than `most` slots.
std::optional<GridPlaces> places_in_lines(const GridGraph& graph, const GridRows& rows,
                                          std::size_t most, const Progress& progress);

// Every row in a span of its own, no longer than it needs; nothing as above.
std::optional<GridPlaces> places_by_row(const GridGraph& graph, const GridRows& rows,
                                        std::size_t most, const Progress& progress);

}  // namespace ressort::kernels
