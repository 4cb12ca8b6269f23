#include "core/kernels/grid/grid_places.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace ressort::kernels {
namespace {

constexpr std::uint32_t least_reach = 2 * grid_line;

std::uint32_t whole_lines(std::uint32_t slots) {
  return (slots + grid_line - 1) / grid_line * grid_line;
}

// The position of a node: its row and its column, counted from the start of the row.
struct Address {
  std::uint32_t row = nowhere;
  std::int64_t column = 0;
};

std::vector<Address> addresses(const GridGraph& graph, const GridRows& rows) {
  std::vector<Address> all(graph.start.size() - 1);
  for (std::uint32_t row = 0; row < rows.size(); ++row) {
    for (std::size_t i = 0; i < rows[row].size(); ++i) {
      all[rows[row][i]] = {row, static_cast<std::int64_t>(i)};
    }
  }
  return all;
}

// Calls use(column here, address there) for every link of a row.
template <class Use>
void each_link(const GridGraph& graph, const std::vector<Address>& all,
               const std::vector<std::uint32_t>& row, Use&& use) {
  for (const std::uint32_t node : row) {
    for (std::uint32_t i = graph.start[node]; i < graph.start[node + 1]; ++i) {
      use(all[node], all[graph.neighbours[i]]);
    }
  }
}

// Returns the number of empty slots between rows: the largest reach of links within a row.
std::uint32_t gap_of(const GridGraph& graph, const std::vector<Address>& all,
                     const GridRows& rows) {
  constexpr std::int64_t longest = 8;
  std::int64_t gap = 1;
  for (const auto& row : rows) {
    each_link(graph, all, row, [&](const Address& here, const Address& there) {
      const std::int64_t reach = there.column - here.column;
      if (here.row == there.row && reach <= longest) {
        gap = std::max(gap, reach);
      }
    });
  }
  return static_cast<std::uint32_t>(gap);
}

// Returns the shift of each row for which most links to the previous row have an offset that
// already occurs.
std::vector<std::int64_t> shifts(const GridGraph& graph, const std::vector<Address>& all,
                                 const GridRows& rows, const Progress& progress) {
  std::vector<std::int64_t> shift(rows.size(), 0);
  std::set<std::int64_t> known;  // Column differences to the previous row.
  for (std::uint32_t row = 1; row < rows.size(); ++row) {
    // Counts the column differences without a shift of this row.
    std::map<std::int64_t, std::size_t> differences;
    each_link(graph, all, rows[row], [&](const Address& here, const Address& there) {
      if (there.row == row - 1) {
        ++differences[here.column - there.column - shift[row - 1]];
      }
    });
    progress.spend(rows[row].size() + 8 * differences.size());
    std::size_t best = 0;
    const std::set<std::int64_t> wanted = known.empty() ? std::set<std::int64_t>{0} : known;
    for (const auto& [difference, count] : differences) {
      for (const std::int64_t fit : wanted) {
        std::size_t score = 0;
        progress.spend(wanted.size());
        for (const std::int64_t met : wanted) {
          const auto other = differences.find(met + difference - fit);
          score += other != differences.end() ? other->second : 0;
        }
        if (score > best) {
          best = score;
          shift[row] = fit - difference;
        }
      }
    }
    constexpr std::size_t most_known = 8;
    for (const auto& [difference, count] : differences) {
      if (known.size() < most_known && 2 * count >= rows[row].size()) {
        known.insert(difference + shift[row]);
      }
    }
  }
  return shift;
}

// Returns a slightly larger pitch if that aligns the slots of the next row with those of this one.
std::int64_t aligned(std::int64_t pitch) {
  constexpr std::int64_t dear = 24;
  for (const std::int64_t lanes : {16, 8, 4}) {
    const std::int64_t longer = (pitch + lanes - 1) / lanes * lanes;
    if ((longer - pitch) * dear <= pitch) {
      return longer;
    }
  }
  return pitch;
}

void put(GridPlaces& places, std::uint32_t node, std::int64_t slot) {
  places.slot[node] = static_cast<std::uint32_t>(slot);
  places.node_at[places.slot[node]] = node;
}

GridPlaces empty_places(const GridGraph& graph, std::uint32_t reach, std::uint32_t count) {
  GridPlaces places;
  places.reach = reach;
  places.slots = count + 4 * reach;
  places.slot.assign(graph.start.size() - 1, nowhere);
  places.node_at.assign(places.slots, nowhere);
  return places;
}

}  // namespace

std::optional<GridPlaces> places_in_lines(const GridGraph& graph, const GridRows& rows,
                                          std::size_t most, const Progress& progress) {
  const std::vector<Address> all = addresses(graph, rows);
  const std::vector<std::int64_t> shift = shifts(graph, all, rows, progress);
  const std::int64_t gap = gap_of(graph, all, rows);
  std::int64_t pitch = 0;
  for (std::size_t row = 0; row < rows.size(); ++row) {
    const auto length = static_cast<std::int64_t>(rows[row].size());
    const std::int64_t drift = row + 1 < rows.size() ? shift[row] - shift[row + 1] : 0;
    pitch = std::max({pitch, length + gap + drift, length + gap});
  }
  pitch = aligned(pitch);
  std::int64_t lowest = 0;
  std::int64_t highest = 0;
  for (std::size_t row = 0; row < rows.size(); ++row) {
    const std::int64_t begin = static_cast<std::int64_t>(row) * pitch + shift[row];
    lowest = std::min(lowest, begin);
    highest = std::max(highest, begin + static_cast<std::int64_t>(rows[row].size()));
  }
  if (static_cast<std::size_t>(highest - lowest) > most) {
    return std::nullopt;  // The rows differ so much that most slots would be empty.
  }
  const auto count = whole_lines(static_cast<std::uint32_t>(highest - lowest));
  const std::uint32_t reach =
      rows.size() > 1 ? whole_lines(static_cast<std::uint32_t>(pitch) + least_reach) : least_reach;
  GridPlaces places = empty_places(graph, reach, count);
  for (std::size_t row = 0; row < rows.size(); ++row) {
    std::int64_t slot =
        2 * std::int64_t{reach} - lowest + static_cast<std::int64_t>(row) * pitch + shift[row];
    for (const std::uint32_t node : rows[row]) {
      put(places, node, slot++);
    }
  }
  places.spans.push_back({2 * reach, count});
  return places;
}

std::optional<GridPlaces> places_by_row(const GridGraph& graph, const GridRows& rows,
                                        std::size_t most, const Progress& progress) {
  const std::uint32_t gap = gap_of(graph, addresses(graph, rows), rows);
  progress.spend(graph.neighbours.size());
  std::uint32_t count = 0;
  std::uint32_t longest = 0;
  for (const auto& row : rows) {
    const std::uint32_t length = whole_lines(static_cast<std::uint32_t>(row.size()) + gap);
    longest = std::max(longest, length);
    count += length;
  }
  if (count > most) {
    return std::nullopt;
  }
  GridPlaces places = empty_places(graph, longest + least_reach, count);
  std::uint32_t slot = 2 * places.reach;
  for (const auto& row : rows) {
    const std::uint32_t length = whole_lines(static_cast<std::uint32_t>(row.size()) + gap);
    for (std::uint32_t i = 0; i < row.size(); ++i) {
      put(places, row[i], slot + i);
    }
    places.spans.push_back({slot, length});
    slot += length;
  }
  return places;
}

}  // namespace ressort::kernels
