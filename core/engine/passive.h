// core/engine: links whose force is not the plain one. A kernel moves everything without them;
// then each looks where its ends would be, finds its force (centred.h), and both ends are moved by
// it, which is the same as if it had been among the others. Where such links share a mass, they
// are gone through until nothing changes (Gauss-Seidel; for convex potentials this always ends).
#pragma once

#include <vector>

#include "core/engine/centred.h"

namespace ressort {

struct PassiveLink {
  Law law = Law::contact;
  Scheme scheme = Scheme::centred;
  int substeps = 1;
  bool is_shared = false;  // another one may move what it moves
  std::array<std::uint32_t, 5> coefficients{};
  Ends ends;  // nodes; a kernel puts its own places instead
};

// Those of the Program, in its order. O(links + nodes of macros that points are on).
std::vector<PassiveLink> passive_links(const Program& program);

// Whether any of them holds a place on a macro.
bool holds_places(const Program& program);

// [moving node] the coefficient 1/M.
std::vector<std::uint32_t> inverse_masses(const Program& program);

inline constexpr int most_sweeps = 40;
inline constexpr std::size_t passive_rows = 4;  // of memory for each link, one number a lane

// A kernel's Body says for the functions below, of a link's ends:
//   V distance_now(ends), speed_now(ends)  x_a - x_b and v_a - v_b at the sample's beginning
//   V distance(ends), speed(ends)          the same once all has moved, points too
//   V gamma(ends)                          how far they give way to a force of 1
//   void push(ends, V x, V v)              a by -x and b by x, times their inverse masses; so by v
//   V coefficient(c)
//   V awake()                              0 where nothing pulls in this sample, else 1

// Before anything moves. `memory` is [link][passive_rows] packs.
template <class V, class Body>
static inline void remember(const std::vector<PassiveLink>& links, V* memory, const Body& body) {
  for (const PassiveLink& link : links) {
    memory[0] = body.distance_now(link.ends);
    memory[1] = body.speed_now(link.ends);
    memory += passive_rows;
  }
}

// Finds one link's push anew, its last one being in its row; gives what is added to it.
template <class V, class Body>
static inline Push<V> find_push(const PassiveLink& link, const V* row, const Body& body) {
  const auto c = [&](std::size_t i) { return body.coefficient(link.coefficients[i]); };
  const V gamma = body.gamma(link.ends);
  const Meeting<V> meeting{.now = row[0],
                           .speed = row[1],
                           .free = body.distance(link.ends) + gamma * row[2],
                           .fast = body.speed(link.ends) + gamma * row[3],
                           .gamma = gamma};
  const Push<V> push =
      passive_push(link.law, link.scheme, link.substeps, meeting, c(0), c(1), c(2), c(3), c(4));
  return {push.x * body.awake() - row[2], push.v * body.awake() - row[3]};
}

// After masses and position inputs have moved, before points do.
template <class V, class Body>
static inline void correct(const std::vector<PassiveLink>& links, V* memory, Body& body) {
  constexpr Scalar<V> tiny = tiny_share<V>();
  bool is_shared = false;
  V* row = memory;
  for (const PassiveLink& link : links) {
    row[2] = V{};
    row[3] = V{};
    const Push<V> push = find_push(link, row, body);
    body.push(link.ends, push.x, push.v);
    row[2] = push.x;
    row[3] = push.v;
    row += passive_rows;
    is_shared = is_shared || link.is_shared;
  }
  auto live = V{} == V{};
  for (int sweep = 1; sweep < most_sweeps && is_shared && any_of(live); ++sweep) {
    auto changes = V{} != V{};
    row = memory;
    for (const PassiveLink& link : links) {
      if (link.is_shared) {
        const Push<V> more = find_push(link, row, body);
        const V x = select(live, more.x, V{});
        const V v = select(live, more.v, V{});
        body.push(link.ends, x, v);
        row[2] += x;
        row[3] += v;
        changes = changes | (absolute(x) > tiny * absolute(row[2]));
      }
      row += passive_rows;
    }
    live = live & changes;
  }
}

}  // namespace ressort
