// core/compile: a Network's numbers as tables.
#pragma once

#include <span>

#include "core/kernels/program.h"
#include "core/model/network.h"
#include "core/progress.h"

namespace ressort {

inline constexpr std::size_t most_parts = 32;        // the smallest ones are lumped together
inline constexpr std::size_t least_part_masses = 3;  // below, a part is not worth its own kernel

// How a link's force is found; as LinkRun says.
struct LinkScheme {
  Scheme scheme = Scheme::plain;
  std::uint16_t substeps = 1;
  auto operator<=>(const LinkScheme&) const = default;
};

// The whole network, divided into the parts that do not touch each other, the largest first; each
// in the direct form. `rescale`: numbers are meant at 44 100 Hz, keep pitch and decay at rate_hz.
// `schemes` are those of the links of a network without macros; nothing: all as published.
// O(n log n). [any thread but audio]
Machine make_machine(const Network& network, double rate_hz, bool rescale,
                     std::span<const LinkScheme> schemes = {}, const Progress& progress = {});

// The same as one part, for tests and other ways of playing it.
Program make_program(const Network& network, double rate_hz, bool rescale,
                     std::span<const LinkScheme> schemes = {});

}  // namespace ressort
