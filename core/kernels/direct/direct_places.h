// The loops of the direct form at points, which have no inertia and follow the nodes around them.
// On a macro these are up to four nodes, different ones in each lane. On a body they are all of its
// modes, the same ones in all lanes, and are processed in packs. A part of direct_step.cpp.
#pragma once

#include <algorithm>
#include <utility>

#include "core/kernels/direct/direct.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// Returns whether a node is a point on a macro or a body. It is then taps[node - taps[0].node].
bool is_place(const Program& program, std::uint32_t node) {
  return !program.taps.empty() && node >= program.taps[0].node;
}

// The nodes of a point and their weights, if the nodes are the same in all lanes; else none.
template <class V>
struct Behind {
  std::uint32_t* node;
  V* weight;
  std::uint32_t count;
};

template <class S>
Behind<typename S::V> behind(const S& s, std::size_t tap) {
  using V = typename S::V;
  const std::size_t first = s.state.first_of_place[tap];
  return {s.state.place_nodes + first, reinterpret_cast<V*>(s.state.place_weights) + first,
          s.state.count_of_place[tap]};
}

// Returns the sum of term(i). Four partial sums hide the latency of the additions. Their order is
// the same on every machine and in every lane, so the result has the same bits.
template <class V, class Term>
[[gnu::always_inline]] inline V sum_of(std::uint32_t count, Term&& term) {
  V sums[4] = {};
  std::uint32_t i = 0;
  for (; i + 4 <= count && count > tap_corners; i += 4) {
    for (std::uint32_t k = 0; k < 4; ++k) {
      sums[k] += term(i + k);
    }
  }
  for (; i < count; ++i) {
    sums[0] += term(i);
  }
  return count > tap_corners ? (sums[0] + sums[1]) + (sums[2] + sums[3]) : sums[0];
}

// Calls use(node, weight) for the up to four nodes around a point on a macro in one lane.
template <class S, class Use>
void around(const Program& program, const S& s, std::size_t tap, std::size_t lane, Use&& use) {
  each_corner(s.state.corners[tap * S::lanes + lane],
              [&](std::uint32_t at, auto weight) { use(program.tap_nodes[at], weight); });
}

// Returns the interpolation of a row of numbers, [node], at a point.
template <class S>
typename S::V seen_at(const Program& program, const S& s, std::size_t tap,
                      const typename S::V* row) {
  using V = typename S::V;
  if (const auto all = behind(s, tap); all.count > 0) {
    return sum_of<V>(all.count, [&](std::uint32_t i) { return all.weight[i] * row[all.node[i]]; });
  }
  V seen{};
  for (std::size_t lane = 0; lane < S::lanes; ++lane) {
    around(program, s, tap, lane,
           [&](std::uint32_t node, auto weight) { seen[lane] += weight * row[node][lane]; });
  }
  return seen;
}

template <class V>
V only_in(std::size_t lane, Scalar<V> value) {
  V number;
  for (std::size_t i = 0; i < sizeof(V) / sizeof(Scalar<V>); ++i) {
    number[i] = static_cast<Scalar<V>>(i);
  }
  return select(number == V{} + static_cast<Scalar<V>>(lane), V{} + value, V{});
}

// Calls use(node, share) for every node that gets a share of an amount at a point.
template <class S, class Use>
[[gnu::always_inline]] inline void share_out(const Program& program, const S& s, std::size_t tap,
                                             typename S::V amount, Use&& use) {
  using V = typename S::V;
  if (const auto all = behind(s, tap); all.count > 0) {
    for (std::uint32_t i = 0; i < all.count; ++i) {
      use(all.node[i], all.weight[i] * amount);
    }
    return;
  }
  for (std::size_t lane = 0; lane < S::lanes; ++lane) {
    around(program, s, tap, lane, [&](std::uint32_t node, auto weight) {
      use(node, only_in<V>(lane, weight * amount[lane]));
    });
  }
}

// Updates the weights of the points whose coordinates have changed since the last sample.
template <class S>
void place_taps(const Program& program, S& s) {
  using V = typename S::V;
  const auto* const c = s.state.ramps.value;
  auto* placed = reinterpret_cast<V*>(s.state.placed);
  for (std::size_t i = 0; i < program.taps.size(); ++i, placed += 2) {
    const TapSlot& tap = program.taps[i];
    const V u = s.coefficient[tap.u];
    const V v = s.coefficient[tap.v];
    if (!any_of((u != placed[0]) | (v != placed[1]))) {
      continue;
    }
    placed[0] = u;
    placed[1] = v;
    auto* const corners = s.state.corners + i * S::lanes;
    for (std::size_t lane = 0; lane < S::lanes; ++lane) {
      corners[lane] = corners_at(tap, c[tap.u * S::lanes + lane], c[tap.v * S::lanes + lane]);
    }
    auto all = behind(s, i);
    all.count = 0;
    if (tap.is_on_body()) {
      for (; all.count < tap.length; ++all.count) {
        all.node[all.count] = program.tap_nodes[tap.first + all.count];
        for (std::size_t lane = 0; lane < S::lanes; ++lane) {
          all.weight[all.count][lane] = weight_of_mode(program, tap, corners[lane], all.count);
        }
      }
    } else if (std::all_of(corners, corners + S::lanes,
                           [&](const auto& lane) { return lane.node[0] == corners[0].node[0]; })) {
      for (std::size_t corner = 0; corner < tap_corners; ++corner) {
        V weight{};
        for (std::size_t lane = 0; lane < S::lanes; ++lane) {
          weight[lane] = corners[lane].weight[corner];
        }
        if (any_of(weight > V{})) {
          all.node[all.count] = program.tap_nodes[corners[0].node[corner]];
          all.weight[all.count++] = weight;
        }
      }
    }
    s.state.count_of_place[i] = all.count;
  }
}

// Moves the points with the nodes around them, and with their coordinates.
template <class S>
void move_taps(const Program& program, S& s) {
  for (std::size_t i = 0; i < program.taps.size(); ++i) {
    s.move_to(program.taps[i].node, seen_at(program, s, i, s.x));
  }
}

// Distributes the forces on points to the nodes around them.
template <class S>
void spread_taps(const Program& program, S& s) {
  using V = typename S::V;
  for (std::size_t i = 0; i < program.taps.size(); ++i) {
    V& on_place = s.force[program.taps[i].node];
    const V force = std::exchange(on_place, V{});
    if (any_of(force != V{})) {
      share_out(program, s, i, force, [&](std::uint32_t node, V part) { s.force[node] += part; });
    }
  }
}

// Returns the force of the links at a node, or, at a point, its interpolation.
template <class S>
typename S::V force_at(const Program& program, const S& s, std::uint32_t node) {
  using V = typename S::V;
  const auto* const felt = reinterpret_cast<const V*>(s.state.felt);
  if (!is_place(program, node)) {
    return felt == nullptr ? s.force[node] : s.force[node] + felt[node];
  }
  const std::size_t tap = node - program.taps[0].node;
  const V force = seen_at(program, s, tap, s.force);
  return felt == nullptr ? force : force + seen_at(program, s, tap, felt);
}

// Returns how much of an amount at one node reaches another: the sum of the products of both
// weights and `part(node)` over all nodes that both interpolate between.
template <class S, class Part>
typename S::V shared(const Program& program, const S& s, std::uint32_t from, std::uint32_t at,
                     Part&& part) {
  using V = typename S::V;
  const bool is_from_place = is_place(program, from);
  if (is_from_place != is_place(program, at)) {
    V sum{};
    const std::uint32_t alone = is_from_place ? at : from;
    share_out(program, s, (is_from_place ? from : at) - program.taps[0].node, V{} + 1,
              [&](std::uint32_t node, V weight) {
                if (node == alone) {
                  sum += weight * part(node);
                }
              });
    return sum;
  }
  if (!is_from_place) {
    return from == at ? part(at) : V{};
  }
  const std::size_t one = from - program.taps[0].node;
  const std::size_t other = at - program.taps[0].node;
  const TapSlot& slot = program.taps[one];
  if (slot.first != program.taps[other].first) {
    return V{};  // the points are on two macros
  }
  const auto near = behind(s, one);
  const auto far = behind(s, other);
  if (slot.is_on_body()) {
    return sum_of<V>(near.count, [&](std::uint32_t i) {
      return near.weight[i] * far.weight[i] * part(near.node[i]);
    });
  }
  V sum{};
  if (near.count > 0 && far.count > 0) {
    for (std::uint32_t i = 0; i < near.count; ++i) {
      for (std::uint32_t k = 0; k < far.count; ++k) {
        if (near.node[i] == far.node[k]) {
          sum += near.weight[i] * far.weight[k] * part(near.node[i]);
        }
      }
    }
    return sum;
  }
  for (std::size_t lane = 0; lane < S::lanes; ++lane) {
    around(program, s, one, lane, [&](std::uint32_t pushed, auto weight) {
      around(program, s, other, lane, [&](std::uint32_t felt, auto share) {
        if (pushed == felt) {
          sum[lane] += weight * share * part(felt)[lane];
        }
      });
    });
  }
  return sum;
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
