// core/analysis: compliance of a network at given masses.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/analysis/interval.h"
#include "core/model/network.h"
#include "core/progress.h"

namespace ressort::analysis {

// Larger networks would take too long.
inline constexpr std::size_t most_compliant_masses = 20'000;

// Returns the displacement of each of `masses` under a unit force on it, c^T K^-1 c, with every
// stiffness at its smallest in the box, at this rate. Only springs and oscillators count; contacts,
// plucks and bows do not. A place on a macro moves with the nodes around it. Infinite if nothing
// holds the mass or its place may move; 0 for a mass that does not move. Empty if a stiffness may
// be negative, for more than most_compliant_masses, or if the links are so random that a
// factorisation would take too long. One sparse Cholesky factorisation, and one solution per mass.
// For networks without macros. [any thread but audio]
std::optional<std::vector<double>> compliances(const Network& network, const ParameterBox& box,
                                               double rate_ratio,
                                               std::span<const std::uint32_t> masses,
                                               const Progress& progress = {});

}  // namespace ressort::analysis
