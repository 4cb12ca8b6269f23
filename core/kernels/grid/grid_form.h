// core/kernels: decides whether a Program is a regular network, and makes its tables.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/kernels/isa.h"
#include "core/kernels/program.h"
#include "core/progress.h"

namespace ressort::kernels {

struct Workload;
class Work;

inline constexpr std::uint32_t grid_line = 16;  // slots; the number of lanes of the widest pack

// Slots with the same `offsets` to their neighbours.
struct GridSegment {
  std::uint32_t first = 0;            // slots, multiples of grid_line
  std::uint32_t count = 0;            //
  std::vector<std::int32_t> offsets;  // at most most_grid_offsets
};

// Links of one run whose second ends are `offsets` above their first ends.
struct GridLinks {
  std::uint32_t run = 0;     // index into Program::link_runs
  bool is_reversed = false;  // the first ends are above the second ends instead
  std::vector<std::uint32_t> offsets;
  // [offset][slot - Grid::first] whether this slot has the link
  std::vector<std::vector<std::uint8_t>> is_linked;
};

// Links that do not fit into the regular structure. They are computed one by one.
struct GridRest {
  std::uint32_t run = 0;    // index into Program::link_runs
  std::uint32_t first = 0;  // index into Grid::rest_ends
  std::uint32_t count = 0;
  bool is_excess = false;  // subtracts links that the segments compute although they do not exist
};

// A mass outside the grid.
struct GridLoose {
  std::uint32_t mass_run = 0;  // index into Program::mass_runs
  std::uint32_t slot = 0;
};

// A network of similar rows, for one voice. Every node has a slot. The slots of the grid are
// arranged so that neighbours have the same few offsets everywhere, with empty slots at the ends of
// rows. An empty slot is a mass that stays at 0. A ground may occupy several slots, or none if it
// is at 0.
//
// If there is one kind of spring everywhere (`segments` is not empty), the force on a mass is the
// sum over all offsets of the differences of y = K x + Z v, minus the differences to the `missing`
// neighbours. Otherwise the forces of each law in `links` are computed offset by offset.
struct Grid {
  std::uint32_t slots = 0;
  std::uint32_t first = 0;     // slots [first, first + count) are the grid, multiples of grid_line;
  std::uint32_t count = 0;     // no offset reaches below 0 or beyond the last slot
  std::uint32_t mass_run = 0;  // index into Program::mass_runs, for the whole grid
  std::vector<std::uint32_t> slot;    // [node]
  std::vector<double> position;       // [slot] at the start
  std::vector<double> velocity;       // [slot]
  std::vector<std::uint8_t> moves;    // [slot - first] 1 where a mass is, 0 elsewhere
  std::uint32_t spring_run = 0;       // index into Program::link_runs, for the segments
  std::vector<GridSegment> segments;  // none overlap
  // [slot - first] number of offsets without a neighbour, minus the number of additional springs to
  // 0
  std::vector<std::int8_t> missing;
  std::vector<GridLinks> links;
  std::vector<GridRest> rest;
  std::vector<std::array<std::uint32_t, 2>> rest_ends;  // slots
  std::vector<std::uint32_t> ports;                     // slots of rest_ends and of force inputs
  std::vector<GridLoose> loose;
};

inline constexpr std::size_t most_grid_offsets = 8;

inline constexpr std::uint32_t least_grid_masses = 16;

// Makes the tables of a Program whose masses are mostly equal and lie in similar rows, in any order
// of numbering. Few links may be left over, and no output may be a force. O(n log n). [any thread
// but audio]
std::optional<Grid> grid_form(const Program& program, const Progress& progress = {});

// Returns the pack width. Many machines process AVX-512 registers in two halves.
constexpr std::size_t grid_pack_bytes(Isa isa) {
  return isa == Isa::v4 ? vector_bytes(Isa::v3) : vector_bytes(isa);
}

// Functions for the registry's row; memory is per voice, in bytes.
double operations(const Program& program, const Grid& form, const Workload& load);
std::string description(const Program& program, const Grid& form);
std::uint64_t voice_bytes(const Program& program, const Grid& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
