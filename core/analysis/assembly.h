// core/analysis: a network as the sum that stability looks at.
//
//   K + 2Z = sum over terms of w g gT
//
// A term is what one link, or an oscillator's own spring, adds; g says which masses it joins, and w
// is its k + 2z where it is steepest. What holds a waveguide joins no masses: such a link takes no
// more than it gives (core/compile/schemes.h), and is a term only for what it may have below 0.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/analysis/interval.h"
#include "core/model/network.h"

namespace ressort::analysis {

inline constexpr std::uint32_t held_row = 0xffffffffu;  // of what does not move

// The w of a term, by how its parts grow with a factor on every stiffness: with the factor itself,
// not at all, and with its root.
struct Load {
  double stiff = 0.0;
  double damped = 0.0;
  double rubbed = 0.0;
  double total() const { return stiff + damped + rubbed; }
};

struct Assembly {
  struct Entry {
    std::uint32_t row = 0;  // which of the masses that move
    double share = 0.0;
  };
  struct Term {
    std::uint32_t first = 0;  // of `entries`
    std::uint32_t count = 0;
    std::uint32_t element = 0;  // index into Network::links, or Network::masses
    bool is_link = true;
    bool is_passive = false;  // holds a waveguide: no entries, no highest load
    // 1 and on: which of the ends of links at places that move, of which this is one node that it
    // may be at; the other end of such a link is one, too.
    std::uint32_t wanders = 0;
    double scale = 1.0;  // of its w
  };
  std::vector<std::uint32_t> masses;  // [row] index into Network::masses
  std::vector<Term> terms;
  std::vector<Entry> entries;
  std::uint32_t wandering_ends = 0;  // that is how many
  bool is_complete = true;  // not if live places would take too many terms: then no link is in it

  std::span<const Entry> of(const Term& term) const {
    return std::span(entries).subspan(term.first, term.count);
  }
};

// Of a network without macros. A place on a macro counts with the nodes around it; one whose
// coordinates are live has a term at every node, whose sum is on the safe side.
// O(masses + links), and a term for every node under a live place, up to 4 million.
Assembly assemble(const Network& network);

// What every argument can amount to in the box. [argument]
std::vector<Range> argument_ranges(const Network& network, const ParameterBox& box);

// 0 for no_argument.
Range range_at(std::span<const Range> arguments, ArgumentId argument);

// The largest load of a term in these ranges; `rate_ratio` is 44100 / rate. Quadratic and cubic
// springs count as they are at rest: how steep they become depends on the amplitude.
Load highest_load(const Network& network, const Assembly::Term& term,
                  std::span<const Range> arguments, double rate_ratio);

// The least stiffness and damping that a term surely has: at rest plucks, bows and contacts have
// none, but may still have a negative one; what holds a waveguide has at most that.
Load lowest_load(const Network& network, const Assembly::Term& term,
                 std::span<const Range> arguments, double rate_ratio);

}  // namespace ressort::analysis
