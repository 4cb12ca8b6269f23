// core/kernels: finds the chains in a Program.
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

// Equal masses in a row, each linked to the next by the same spring. In a stiff chain each mass is
// also linked to the next but one by a second kind of spring. An end is free, or held by a ground
// or a position input.
struct Chain {
  static constexpr std::uint32_t free = 0xffffffffu;

  // first of its masses in Chains::nodes, which are in order from one end to the other
  std::uint32_t first = 0;
  std::uint32_t count = 0;
  std::uint32_t mass_run = 0;   // run of the Program that contains all of its masses
  std::uint32_t stiffness = 0;  // coefficients of the springs
  std::uint32_t damping = 0;
  std::uint32_t left = free;  // node that holds the first mass by the same spring
  std::uint32_t right = free;
  bool is_stiff = false;
  std::uint32_t second_stiffness = 0;  // coefficients of the second springs
  std::uint32_t second_damping = 0;
  std::array<std::uint32_t, 2> second_left{free,
                                           // nodes that hold the first and the second mass by a
                                           // second spring
                                           free};
  std::array<std::uint32_t, 2> second_right{free, free};  // ...and the last and the last but one
};

// The chains of one voice, folded into the lanes of packs. All other elements are stepped one by
// one.
struct Chains {
  std::vector<Chain> chains;
  std::vector<std::uint32_t> nodes;  // chain by chain
  std::vector<std::uint32_t> loose;  // nodes that move and are in no chain, ascending
  std::vector<std::uint32_t> links;  // links that are not springs of a chain, ascending
};

inline constexpr std::uint32_t least_chain_masses = 8;  // Shorter chains are not worth folding.

// Finds the longest rows of equal masses and springs without branches, in any order of numbering.
// Empty if none has at least least_chain_masses. A mass with three such springs is in no chain, and
// a link between chains is an ordinary link. Springs from each mass to the next but one belong to a
// stiff chain. Force outputs beside points on macros are not supported. O(nodes + links). [any
// thread but audio]
std::optional<Chains> chains_form(const Program& program, const Progress& progress = {});

// Returns whether the node is a ground, which never moves. [any thread]
bool is_fixed_ground(const Program& program, std::uint32_t node);

// The pack width, and the number of packs of a chain that stays in registers; 0: none.
struct FoldedBy {
  std::size_t lanes = 0;
  std::size_t short_packs = 0;
};
FoldedBy fold_by(const Program& program, const Chains& form, Isa isa, std::size_t number_bytes);

// Functions for the registry's row; memory is per voice, in bytes.
double operations(const Program& program, const Chains& form, const Workload& load);
std::string description(const Program& program, const Chains& form);
std::uint64_t voice_bytes(const Program& program, const Chains& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
