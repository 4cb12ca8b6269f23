// core/kernels: links whose force is not the plain one. A kernel moves everything without them;
// then each looks where its ends would be, finds its force (core/laws), and both ends are moved by
// it, which is the same as if it had been among the others. Where such links share a mass, they
// are gone through a few times (Gauss-Seidel); where that does not end, they are solved together.
#pragma once

#include <algorithm>
#include <vector>

#include "core/kernels/program.h"
#include "core/laws/laws.h"

namespace ressort {

using laws::LinkState;
using laws::Push;
using laws::tiny_share;

struct PassiveLink {
  Law law{};
  bool is_implicit = true;  // its force depends on where the link will be
  int substeps = 1;
  bool is_shared = false;  // another one may move what it moves
  std::array<std::uint32_t, most_law_arguments> coefficients{};
  Ends ends;  // nodes; a kernel puts its own places instead
};

// Those of the Program, in its order. O(links + nodes of macros that points are on).
std::vector<PassiveLink> passive_links(const Program& program);

// Whether any of them holds a place on a macro.
bool holds_places(const Program& program);

// [moving node] the coefficient 1/M.
std::vector<std::uint32_t> inverse_masses(const Program& program);

inline constexpr int most_sweeps = 5;
inline constexpr int most_newtons = 16;
inline constexpr int most_rounds = 8;
inline constexpr std::size_t most_joint = 12;
inline constexpr std::size_t passive_rows = 4;  // of memory for each link, one number a lane

// What passive links keep from one sample to the next.
template <class T>
struct PassiveRoom {
  PassiveRoom(const Program& program, std::size_t width)
      : links(passive_links(program)), memory(links.size() * passive_rows * width), awake(width) {
    if (links.empty()) {
      return;
    }
    inverse_mass = inverse_masses(program);
    const auto is_force = [](const OutputSlot& output) { return output.is_force; };
    if (std::any_of(program.outputs.begin(), program.outputs.end(), is_force)) {
      felt.resize(program.position.size() * width);
    }
  }
  T* felt_or_null() { return felt.empty() ? nullptr : felt.data(); }

  std::vector<PassiveLink> links;
  std::vector<std::uint32_t> inverse_mass;
  Aligned<T> memory;
  Aligned<T> awake;
  Aligned<T> felt;
};

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

// Of one link, its last push being in its row.
template <class V, class Body>
static inline LinkState<V> state_of(const PassiveLink& link, const V* row, const Body& body) {
  const V gamma = body.gamma(link.ends);
  return {.now = row[0],
          .speed = row[1],
          .free = body.distance(link.ends) + gamma * row[2],
          .fast = body.speed(link.ends) + gamma * row[3],
          .gamma = gamma};
}

template <class V, class Body>
static inline Push<V> push_of(const PassiveLink& link, const LinkState<V>& state,
                              const Body& body) {
  const auto c = [&](std::size_t i) { return body.coefficient(link.coefficients[i]); };
  const auto push =
      with_law<V>(link.law, c, [&](const auto& law) { return law.passive(state, link.substeps); });
  return {push.x * body.awake(), push.v * body.awake()};
}

// Pushes a link's ends by more than it has until now.
template <class V, class Body>
static inline void push_more(const PassiveLink& link, V* row, const Push<V>& more, Body& body) {
  body.push(link.ends, more.x, more.v);
  row[2] += more.x;
  row[3] += more.v;
}

// One link after the other. Gives the lanes in which anything still changes.
template <class V, class Body>
static inline auto sweep(const std::vector<PassiveLink>& links, V* row, Body& body,
                         decltype(V{} == V{}) live) {
  auto changes = V{} != V{};
  for (const PassiveLink& link : links) {
    if (link.is_shared) {
      const Push<V> push = push_of(link, state_of(link, row, body), body);
      const Push<V> more{select(live, push.x - row[2], V{}), select(live, push.v - row[3], V{})};
      push_more(link, row, more, body);
      changes = changes | (absolute(more.x) > tiny_share<V>() * absolute(row[2]));
    }
    row += passive_rows;
  }
  return changes;
}

namespace {

// Some links at once, by Newton: hard ones on one mass would take thousands of sweeps.
template <class V>
struct Joint {
  const PassiveLink* links[most_joint];
  V* rows[most_joint];
  V coupling[most_joint][most_joint];  // how far a push of one brings the ends of another
  V matrix[most_joint][most_joint];
  Push<V> rest[most_joint];  // what is missing to what it should push
  Push<V> step[most_joint];
  std::size_t count = 0;

  template <class Body>
  void couple(const Body& body) {
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t k = 0; k < count; ++k) {
        const auto [a, b] = links[i]->ends;
        const auto [c, d] = links[k]->ends;
        coupling[i][k] =
            (body.gamma({a, d}) + body.gamma({b, c}) - body.gamma({a, c}) - body.gamma({b, d})) / 2;
      }
    }
  }

  // What every link would push, and how that changes with where it would be. Gives how far all of
  // them are from it.
  template <class Body>
  V look(const Body& body) {
    constexpr Scalar<V> ahead = sizeof(Scalar<V>) == 4 ? Scalar<V>(0x1p-11) : Scalar<V>(0x1p-26);
    V sum{};
    for (std::size_t i = 0; i < count; ++i) {
      LinkState<V> m = state_of(*links[i], rows[i], body);
      const Push<V> push = push_of(*links[i], m, body);
      const V far = absolute(m.now) + absolute(m.speed) + absolute(m.free);
      const V way = ahead * select(far > V{}, far, V{} + 1);
      m.free += way;
      m.fast += way;
      const V rise = (push_of(*links[i], m, body).x - push.x) / way;
      const V steep = select(rise * m.gamma > V{} + 1, 1 / m.gamma, rise);
      for (std::size_t k = 0; k < count; ++k) {
        matrix[i][k] = links[i]->is_implicit && i != k ? steep * coupling[i][k] : V{};
      }
      matrix[i][i] += 1;
      rest[i] = {push.x - rows[i][2], push.v - rows[i][3]};
      sum += m.gamma * rest[i].x * rest[i].x;
    }
    return sum;
  }

  // Newton's step, by elimination. Every pivot is positive where forces rise.
  void solve() {
    V right[most_joint];
    for (std::size_t i = 0; i < count; ++i) {
      right[i] = rest[i].x;
      for (std::size_t k = 0; k < i; ++k) {
        const V share = matrix[i][k] / matrix[k][k];
        for (std::size_t j = k + 1; j < count; ++j) {
          matrix[i][j] -= share * matrix[k][j];
        }
        right[i] -= share * right[k];
      }
    }
    for (std::size_t i = count; i-- > 0;) {
      for (std::size_t j = i + 1; j < count; ++j) {
        right[i] -= matrix[i][j] * right[j];
      }
      right[i] /= matrix[i][i];
      step[i] = {right[i], rest[i].v + (right[i] - rest[i].x)};
    }
  }

  // Half of a step is taken back where it made things worse. Gives whether anything changed.
  template <class Body>
  bool solve(Body& body, decltype(V{} == V{}) live) {
    V least{};
    Push<V> last[most_joint]{};
    bool has_changed = false;
    couple(body);
    for (int i = 0; i < most_newtons && any_of(live); ++i) {
      const V sum = look(body);
      const auto is_worse = (sum > least) & (V{} + static_cast<Scalar<V>>(i) > V{});
      least = select(is_worse, least, sum);
      solve();
      auto changes = V{} != V{};
      for (std::size_t k = 0; k < count; ++k) {
        const Push<V> half{last[k].x / 2, last[k].v / 2};
        const Push<V> more{select(live, select(is_worse, -half.x, step[k].x), V{}),
                           select(live, select(is_worse, -half.v, step[k].v), V{})};
        last[k] = {select(is_worse, half.x, step[k].x), select(is_worse, half.v, step[k].v)};
        const V moved = body.gamma(links[k]->ends) * absolute(more.x);
        push_more(*links[k], rows[k], more, body);
        changes = changes | (moved > tiny_share<V>() * (absolute(rows[k][0]) +
                                                        absolute(body.distance(links[k]->ends))));
      }
      has_changed = has_changed || any_of(changes);
      live = live & changes;
    }
    return has_changed;
  }
};

}  // namespace

template <class V, class Body>
[[gnu::noinline]] static void solve(const std::vector<PassiveLink>& links, V* memory, Body& body,
                                    decltype(V{} == V{}) live) {
  const auto shared = std::count_if(links.begin(), links.end(),
                                    [](const PassiveLink& link) { return link.is_shared; });
  const int rounds = shared > static_cast<std::ptrdiff_t>(most_joint) ? most_rounds : 1;
  bool goes_on = true;
  for (int round = 0; round < rounds && goes_on; ++round) {
    goes_on = false;
    Joint<V> joint;
    V* row = memory;
    for (std::size_t i = 0; i < links.size(); ++i, row += passive_rows) {
      if (links[i].is_shared) {
        joint.links[joint.count] = &links[i];
        joint.rows[joint.count++] = row;
      }
      if (joint.count == most_joint || (i + 1 == links.size() && joint.count > 0)) {
        goes_on = joint.solve(body, live) || goes_on;
        joint.count = 0;
      }
    }
  }
}

// After masses and position inputs have moved, before points do.
template <class V, class Body>
static inline void correct(const std::vector<PassiveLink>& links, V* memory, Body& body) {
  bool is_shared = false;
  V* row = memory;
  for (const PassiveLink& link : links) {
    row[2] = V{};
    row[3] = V{};
    push_more(link, row, push_of(link, state_of(link, row, body), body), body);
    row += passive_rows;
    is_shared = is_shared || link.is_shared;
  }
  auto live = V{} == V{};
  for (int i = 0; i < most_sweeps && is_shared && any_of(live); ++i) {
    live = live & sweep(links, memory, body, live);
  }
  if (is_shared && any_of(live)) {
    solve(links, memory, body, live);
  }
}

}  // namespace ressort
