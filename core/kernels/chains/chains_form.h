// core/kernels: finds the chains in a Program.
#pragma once

#include <optional>

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"
#include "core/progress.h"

namespace ressort::kernels {

inline constexpr std::uint32_t least_chain_masses = 8;  // Shorter chains are not worth folding.

// Finds the longest rows of equal masses and springs without branches, in any order of numbering.
// Empty if none has at least least_chain_masses. A mass with three such springs is in no chain, and
// a link between chains is an ordinary link. Springs from each mass to the next but one belong to a
// stiff chain. Force outputs beside points on macros are not supported. O(nodes + links). [any
// thread but audio]
std::optional<Chains> chains_form(const Program& program, const Progress& progress = {});

// Returns whether the node is a ground, which never moves. [any thread]
bool stands(const Program& program, std::uint32_t node);

// The pack width, and the number of packs of a chain that stays in registers; 0: none.
struct FoldedBy {
  std::size_t lanes = 0;
  std::size_t short_packs = 0;
};
FoldedBy fold_by(const Program& program, const Chains& form, Isa isa, std::size_t number_bytes);

// Functions for the registry's row; memory is per voice, in bytes.
Work work(const Program& program, const Chains& form, const Workload& load);
std::string description(const Program& program, const Chains& form);
std::uint64_t voice_bytes(const Program& program, const Chains& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
