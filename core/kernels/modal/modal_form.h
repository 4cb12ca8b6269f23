// core/kernels: finds the eigenvectors of a Program's linear links.
#pragma once

#include <optional>

#include "core/kernels/estimates.h"
#include "core/kernels/program.h"
#include "core/model/preset/budget.h"
#include "core/progress.h"

namespace ressort::kernels {

// Masses that hang together: beyond, the eigenvectors take too long to find; and all: beyond, the
// shapes take too much memory.
inline constexpr std::size_t most_tied_modes = 1200;
inline constexpr std::size_t most_modes = 4096;

// The modal form, where all linear links share their eigenvectors whatever the parameters become;
// where they do not, but nothing turns them, crossed modes (modal_crossed.h): `is_untuned` says
// that no key and no bend will. Nothing for what has neither, where parameters turn the masses one
// by one or move places on macros, for audio parameters, more passive links than can be solved
// together, and more than most_tied_modes masses. O(n^3): about 20 ms for 300 masses, 0.1 s for
// 600. With a budget of cents or decays, or if `is_exact` says so, true to the continuous network,
// and without what would ring above 0.45 of the rate; with one of silence without the modes that
// are never heard, the others sorted and told to sleep, unless they are crossed or a force is
// heard. [any thread but audio]
std::optional<Modes> modal_form(const Program& program, const model::Budget& budget = {},
                                const Progress& progress = {}, bool is_untuned = false,
                                bool is_exact = false);

// What it will cost at least, before it is known.
double least_modal_ns(const Program& program, const Workload& load);

// What the registry's row of it asks, of one voice in bytes.
Work work(const Program& program, const Modes& form, const Workload& load);
std::string description(const Program& program, const Modes& form);
std::uint64_t voice_bytes(const Program& program, const Modes& form, std::uint64_t number_bytes);

}  // namespace ressort::kernels
