// core/kernels: assigns the rows of a regular network to slots of a Grid.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/kernels/grid/grid_form.h"
#include "core/kernels/grid/grid_rows.h"

namespace ressort::kernels {

// Consecutive slots with the same offsets to their neighbours.
struct GridSpan {
  std::uint32_t first = 0;  // Multiples of grid_line.
  std::uint32_t count = 0;
};

struct GridPlaces {
  std::uint32_t reach = 0;          // Largest allowed offset.
  std::uint32_t slots = 0;          // Exceeds the spans by at least twice `reach` on either side.
  std::vector<std::uint32_t> slot;  // [node] Its slot, or nowhere.
  std::vector<std::uint32_t> node_at;  // [slot] Its node, or nowhere.
  std::vector<GridSpan> spans;         // Ascending.
};

// Places all rows at equal distances, shifted so that their links have the offsets of earlier rows.
// One span. Empty if that takes more than `most` slots.
std::optional<GridPlaces> places_in_lines(const GridGraph& graph, const GridRows& rows,
                                          std::size_t most, const Progress& progress);

// Places every row in a span of its own, no longer than needed; empty as above.
std::optional<GridPlaces> places_by_row(const GridGraph& graph, const GridRows& rows,
                                        std::size_t most, const Progress& progress);

}  // namespace ressort::kernels
