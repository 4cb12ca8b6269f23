// core/compile: elements that are as good as one.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "core/model/network.h"
#include "core/model/preset/budget.h"
#include "core/progress.h"

namespace ressort::compile {

// A network with fewer elements, numbered as before: what was merged into others is a ground that
// nothing is tied to, or a link that exerts nothing. Of springs side by side stiffness and damping
// add up, which changes nothing but rounding. A light mass with a spring on either side, alike in
// z/k, becomes one spring of k1 k2/(k1 + k2). It follows each of its neighbours M by a share w, and
// weighs on it with no more than m w; without it, to first order in m, no partial rises by more
// than a factor sqrt(1 + m w/M). That is done within the budget's cents, and up to `forced_cents`
// where the mass would be unstable by itself.
struct Merged {
  Network network;
  std::size_t parallel = 0;  // springs that others took over
  std::size_t series = 0;    // masses that became part of a spring
  double cents = 0.0;        // at most, by which any partial is off
};

inline constexpr double forced_cents = 5.0;

// For a network without macros. Masses and springs whose numbers a parameter changes are merged
// only where that stays right at all of its values. Nothing where there is nothing to merge. O(n).
// [any thread but audio]
std::optional<Merged> merge(const Network& network, const Budget& budget,
                            const Progress& progress = {});

// "4 springs beside others, 1 light mass between springs (0.8 cents at most)"; may be empty.
std::string describe(const Merged& merged);

}  // namespace ressort::compile
