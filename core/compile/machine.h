// core/compile: a Network's numbers as tables.
#pragma once

#include <span>

#include "core/compile/cull.h"
#include "core/kernels/program.h"
#include "core/model/network.h"
#include "core/progress.h"

namespace ressort::compile {

inline constexpr std::size_t most_parts = 32;        // the smallest ones are lumped together
inline constexpr std::size_t least_part_masses = 3;  // below, a part is not worth its own kernel

// How a link's force is found; as LinkRun says.
struct LinkScheme {
  Scheme scheme = Scheme::plain;
  auto operator<=>(const LinkScheme&) const = default;
};

// How much faster the reference rate is: what numbers that are meant at 44 100 Hz are rescaled by.
inline double rate_ratio_of(double rate_hz, bool rescale) {
  return rescale ? Network::reference_rate_hz / rate_hz : 1.0;
}

// A network without macros as tables, but for what was culled: divided into the parts that do not
// touch each other, the largest first, each in the direct form. `rescale`: numbers are meant at
// 44 100 Hz, keep pitch and decay at rate_hz. `schemes`: [link], nothing: all as published.
// `start`: [parameter] what the machine's voices begin with. O(n log n). [any thread but audio]
Machine tabulate(const Network& network, const Culled& culled, std::span<const LinkScheme> schemes,
                 std::span<const double> start, double rate_hz, bool rescale,
                 const Progress& progress = {});

// The same of a network as it is written, with nothing but its numbers.
Machine make_machine(const Network& network, double rate_hz, bool rescale);

// The same as one part with nothing culled, for tests and other ways of playing it.
Program make_program(const Network& network, double rate_hz, bool rescale,
                     std::span<const LinkScheme> schemes = {});

}  // namespace ressort::compile
