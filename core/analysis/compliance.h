// core/analysis: how far a network gives way.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/analysis/interval.h"
#include "core/model/network.h"
#include "core/progress.h"

namespace ressort::analysis {

inline constexpr std::size_t most_compliant_masses = 20'000;  // beyond, nobody waits for it

// How far each of `masses` gives way to a force of 1 on it, with every stiffness as small as it can
// be in the box: c^T K^-1 c at this rate. Springs and oscillators only; what touches, plucks or
// bows helps nobody. A place on a macro gives way with the nodes around it. Infinity where nothing
// holds the mass, or its place may slide; 0 for what does not move. Nothing where a stiffness may
// be negative, for more than most_compliant_masses, or where they hang together at random. One
// sparse Cholesky, and a solution for each. Of networks without macros. [any thread but audio]
std::optional<std::vector<double>> compliances(const Network& network, const ParameterBox& box,
                                               double rate_ratio,
                                               std::span<const std::uint32_t> masses,
                                               const Progress& progress = {});

}  // namespace ressort::analysis
