// core/analysis: assembles a network for the stability check, as a sum of rank-one terms:
//
//  K + 2Z = sum over terms of w g g^T
//
// A term is one link, or an oscillator's own spring. g contains the masses it joins, and w is its k
// + 2z at its steepest slope. A link on a waveguide joins no masses: it is passive
// (core/compile/schemes.h), and is a term only if its stiffness or damping can be negative.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/analysis/interval.h"
#include "core/model/network.h"

namespace ressort::analysis {

inline constexpr std::uint32_t held_row = 0xffffffffu;  // Row of a mass that does not move.

// The w of a term, split by how it scales with a factor on every stiffness: proportionally, not at
// all, and with the square root.
struct Load {
  double stiff = 0.0;
  double damped = 0.0;
  double rubbed = 0.0;
  double total() const { return stiff + damped + rubbed; }
};

struct Assembly {
  struct Entry {
    std::uint32_t row = 0;  // Row among the moving masses.
    double share = 0.0;
  };
  struct Term {
    std::uint32_t first = 0;  // First of `entries`.
    std::uint32_t count = 0;
    std::uint32_t element = 0;  // Index into Network::links or Network::masses.
    bool is_link = true;
    bool is_passive = false;  // A link on a waveguide: no entries, no highest load.
    // Number, from 1, of the moving link end that this term is one possible node of. The link's
    // other end is numbered separately. 0: the term does not move.
    std::uint32_t wanders = 0;
    double scale = 1.0;  // Factor on w.
  };
  std::vector<std::uint32_t> masses;  // [row] Index into Network::masses.
  std::vector<Term> terms;
  std::vector<Entry> entries;
  std::uint32_t wandering_ends = 0;  // Number of moving link ends.
  // False if moving places would need too many terms; then links at them are missing.
  bool is_complete = true;

  std::span<const Entry> of(const Term& term) const {
    return std::span(entries).subspan(term.first, term.count);
  }
};

// Assembles a network without macros. A place on a macro counts with the nodes around it. A place
// with live coordinates has one term per node; their sum is a safe upper bound. O(masses + links),
// plus one term per node under a live place, up to 4 million.
Assembly assemble(const Network& network);

// Returns the range of every argument in the box: [argument].
std::vector<Range> argument_ranges(const Network& network, const ParameterBox& box);

// Returns the argument's range, or 0 for no_argument.
Range range_at(std::span<const Range> arguments, ArgumentId argument);

// Returns the largest load of a term in these ranges; `rate_ratio` is 44100 / rate. Quadratic and
// cubic springs count with their slope at rest, because their steepest slope depends on the
// amplitude.
Load highest_load(const Network& network, const Assembly::Term& term,
                  std::span<const Range> arguments, double rate_ratio);

// Returns the least stiffness and damping of a term. Plucks, bows and contacts have none at rest,
// but may have a negative one; a link on a waveguide has at most that.
Load lowest_load(const Network& network, const Assembly::Term& term,
                 std::span<const Range> arguments, double rate_ratio);

}  // namespace ressort::analysis
