// core/kernels: finds the strings in a Program.
#pragma once

#include <optional>

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"
#include "core/progress.h"

namespace ressort::kernels {

inline constexpr std::uint32_t least_chain_masses = 8;  // below, folding is not worth it

// The longest rows of equal masses and springs that have no branches, in whatever order they were
// written; nothing where there is none of at least_chain_masses. A mass with three such springs is
// in no chain, and what ties chains to each other is a link like any other. Springs from every mass
// to the next but one belong to a chain too. Force outputs beside points on macros are refused.
// O(nodes + links). [any thread but audio]
std::optional<Chains> chains_form(const Program& program, const Progress& progress = {});

// Whether an end of a chain is held by what stays where it is: a ground. [any thread]
bool stands(const Program& program, std::uint32_t node);

// How wide packs are, and how many of them a chain takes that stays in registers; 0: none does.
struct FoldedBy {
  std::size_t lanes = 0;
  std::size_t short_packs = 0;
};
FoldedBy fold_by(const Program& program, const Chains& form, Isa isa, std::size_t number_bytes);

// What the registry's row of it asks, of one voice in bytes.
Work work(const Program& program, const Chains& form, const Workload& load);
std::string description(const Program& program, const Chains& form);
std::uint64_t voice_bytes(const Program& program, const Chains& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
