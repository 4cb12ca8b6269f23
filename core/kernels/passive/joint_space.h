// core/kernels: linear algebra of Newton's steps for a cluster of passive links (joint.h). With S
// >= 0 the slopes of their forces, it uses either a sparse factor of M + B S B^T over the masses,
// followed by a dense Schur complement over the places, or a dense factor of I + S^1/2 C S^1/2 over
// the links.
#pragma once

#include <algorithm>

#include "core/kernels/passive/joint_places.h"
#include "core/laws/laws.h"

namespace ressort::kernels::RESSORT_ISA {

using laws::tiny_share;

inline constexpr int most_gradients = 60;

namespace {

// Solution by the ends of the links: masses, then places.
template <class V>
class ByEnds {
 public:
  ByEnds(const PassiveLink* links, const Cluster& cluster, V* numbers, JointBody<V>& body)
      : links_(links),
        cluster_(cluster),
        masses_(cluster.inverse_mass.size()),
        count_(cluster.ends()),
        give_(numbers),
        mass_(give_ + count_),
        at_(mass_ + count_),
        way_(at_ + count_),
        x_(way_ + count_),
        matrix_(x_ + count_),
        places_(cluster.places, numbers + 9 * count_ + cluster.elimination.row.size(),
                at_ + masses_, body) {
    constexpr Scalar<V> least = Scalar<V>(1e-30);
    for (std::size_t i = 0; i < masses_; ++i) {
      const V give = body.coefficients()[cluster.inverse_mass[i]];
      give_[i] = select(give > least, give, V{} + least);
      mass_[i] = 1 / give_[i];
      at_[i] = V{};
    }
    std::fill_n(way_, count_, V{});
  }

  // Starts from no forces.
  template <class Lanes>
  void rest(Lanes live) {
    for (std::size_t i = 0; i < masses_; ++i) {
      at_[i] = select(live, V{}, at_[i]);
    }
    places_.rest(live);
  }
  void pull(std::size_t link, V force) {
    const auto [a, b] = ends(link);
    pull_mass(a, V{} - force);
    pull_mass(b, force);
    press(a, V{} - force);
    press(b, force);
  }
  V pulled(std::size_t link) const { return between(at_, link); }

  // Computes Newton's direction from the current positions, which is accurate even if the forces
  // are so large that their sum is lost to rounding.
  void solve(Joined<V>* joined, bool is_exact) {
    if (cluster_.has_factor() && (is_exact || !cluster_.is_large() || has_places())) {
      fill(joined);
      factorise();
      substitute();
    } else {
      approach(joined);
    }
    for (std::size_t i = 0; i < cluster_.count; ++i) {
      Joined<V>& link = joined[i];
      link.newton_way = between(x_, i);
      link.newton_push = link.value - link.force + link.slope * link.newton_way;
    }
  }

  // Adopts the new direction, except in lanes that keep theirs.
  template <class Lanes>
  void turn(Lanes keeps) {
    for (std::size_t i = 0; i < count_; ++i) {
      way_[i] = select(keeps, way_[i], x_[i]);
    }
  }
  // Moves along the direction. Places are recomputed from their forces, so that rounding errors do
  // not add up.
  template <class Lanes>
  void go(const Joined<V>* joined, Lanes live, V share) {
    for (std::size_t i = 0; i < masses_; ++i) {
      at_[i] = select(live, at_[i] + share * way_[i], at_[i]);
    }
    if (has_places()) {
      places_.rest(live);
      for (std::size_t i = 0; i < cluster_.count; ++i) {
        const V force = select(live, joined[i].force, V{});
        press(ends(i).a, V{} - force);
        press(ends(i).b, force);
      }
    }
  }
  // Recomputes positions from forces.
  template <class Lanes>
  void follow(const Joined<V>* joined, Lanes live) {
    rest(live);
    for (std::size_t i = 0; i < cluster_.count; ++i) {
      pull(i, select(live, joined[i].force, V{}));
    }
  }
  // Moves each mass once, by the total displacement found. Applying the forces instead would lose
  // precision when links are much stiffer than their masses are heavy.
  void push(const Joined<V>* joined, JointBody<V>& body) {
    const auto shift = [&](std::uint32_t node, std::uint32_t end, V force) {
      if (is_mass(end) && any_of(at_[end] != V{})) {
        body.shift(node, at_[end]);
        at_[end] = V{};
      }
      if ((is_mass(end) || end == no_mass) && any_of(force != V{})) {
        body.add_reaction(node, force);
      }
    };
    for (std::size_t i = 0; i < cluster_.count; ++i) {
      shift(links_[i].ends.a, links_[i].mass_a, V{} - joined[i].force);
      shift(links_[i].ends.b, links_[i].mass_b, joined[i].force);
    }
    places_.push();
  }
  // Returns the derivative of 1/2 |u|^2_M along the direction.
  V inertia_along(const Joined<V>*) const {
    V sum{};
    for (std::size_t i = 0; i < masses_; ++i) {
      sum += way_[i] * mass_[i] * at_[i];
    }
    return has_places() ? sum + places_.inertia_along(way_ + masses_) : sum;
  }

 private:
  bool has_places() const { return masses_ < count_; }
  bool is_mass(std::uint32_t end) const { return end < masses_; }
  Ends ends(std::size_t link) const { return {links_[link].mass_a, links_[link].mass_b}; }
  V between(const V* x, std::size_t link) const {
    const auto [a, b] = ends(link);
    return (a == no_mass ? V{} : x[a]) - (b == no_mass ? V{} : x[b]);
  }
  void pull_mass(std::uint32_t end, V force) {
    if (is_mass(end)) {
      at_[end] += give_[end] * force;
    }
  }
  void press(std::uint32_t end, V force) {
    if (end != no_mass && !is_mass(end) && any_of(force != V{})) {
      places_.press(end - masses_, force);
    }
  }

  // Fills the matrix and the right-hand side: residual forces for places, displacements for masses.
  void fill(const Joined<V>* joined) {
    const std::size_t size = count_ + cluster_.elimination.row.size();
    for (std::size_t i = 0; i < count_; ++i) {
      matrix_[i] = is_mass(static_cast<std::uint32_t>(i)) ? mass_[i] : V{};
      x_[i] = is_mass(static_cast<std::uint32_t>(i)) ? V{} - mass_[i] * at_[i] : V{};
    }
    for (std::size_t i = count_; i < size; ++i) {
      matrix_[i] = V{};
    }
    for (std::size_t i = 0; i < cluster_.count; ++i) {
      const auto [a, b] = ends(i);
      if (a == b) {
        continue;
      }
      const V value = joined[i].value;
      const V off = value - joined[i].force;
      if (a != no_mass) {
        matrix_[a] += joined[i].slope;
        x_[a] -= is_mass(a) ? value : off;
      }
      if (b != no_mass) {
        matrix_[b] += joined[i].slope;
        x_[b] += is_mass(b) ? value : off;
      }
      if (links_[i].entry != no_mass) {
        matrix_[links_[i].entry] -= joined[i].slope;
      }
    }
  }

  // Solves the same system by Jacobi-preconditioned conjugate gradients: O(links) per iteration,
  // with few iterations unless links are much stiffer than their masses are heavy. Stops at the
  // accuracy that the next Newton step can use.
  void approach(const Joined<V>* joined) {
    V* const rest = matrix_;
    V* const to = rest + count_;
    V* const pull = to + count_;
    V* const diagonal = pull + count_;
    const auto add = [&](V* sum, std::size_t link, V force) {
      const auto [a, b] = ends(link);
      if (a != no_mass) {
        sum[a] += force;
      }
      if (b != no_mass) {
        sum[b] -= force;
      }
    };
    std::copy_n(mass_, count_, diagonal);
    for (std::size_t i = 0; i < count_; ++i) {
      rest[i] = V{} - mass_[i] * at_[i];
      x_[i] = V{};
    }
    for (std::size_t i = 0; i < cluster_.count; ++i) {
      const auto [a, b] = ends(i);
      if (a != b) {
        add(rest, i, V{} - joined[i].value);
        diagonal[a == no_mass ? b : a] += joined[i].slope;
        diagonal[b == no_mass ? a : b] += a == no_mass || b == no_mass ? V{} : joined[i].slope;
      }
    }
    V last{};
    for (std::size_t i = 0; i < count_; ++i) {
      to[i] = rest[i] / diagonal[i];
      last += rest[i] * to[i];
    }
    const V enough = nearness * last;
    for (int round = 0; round < most_gradients && any_of(last > enough); ++round) {
      const auto live = last > enough;
      for (std::size_t i = 0; i < count_; ++i) {
        pull[i] = mass_[i] * to[i];
      }
      for (std::size_t i = 0; i < cluster_.count; ++i) {
        add(pull, i, joined[i].slope * between(to, i));
      }
      V bends{};
      for (std::size_t i = 0; i < count_; ++i) {
        bends += to[i] * pull[i];
      }
      const V far = select(live, last / select(live, bends, V{} + 1), V{});
      V next{};
      for (std::size_t i = 0; i < count_; ++i) {
        x_[i] += far * to[i];
        rest[i] -= far * pull[i];
        next += rest[i] * rest[i] / diagonal[i];
      }
      const V keep = select(live, next / select(live, last, V{} + 1), V{});
      for (std::size_t i = 0; i < count_; ++i) {
        to[i] = rest[i] / diagonal[i] + keep * to[i];
      }
      last = select(live, next, last);
    }
  }
  static constexpr auto nearness = static_cast<Scalar<V>>(1e-12);

  void factorise() {
    const Elimination& plan = cluster_.elimination;
    const std::uint32_t* target = plan.target.data();
    for (std::size_t column = 0; column < masses_; ++column) {
      V* const below = matrix_ + count_ + plan.first[column];
      const std::size_t entries = plan.first[column + 1] - plan.first[column];
      // The pivot is at least the mass; for very stiff links rounding can violate that.
      const V pivot = matrix_[column];
      const V inverse = 1 / select(pivot > mass_[column], pivot, mass_[column]);
      matrix_[column] = inverse;
      for (std::size_t i = 0; i < entries; ++i) {
        const V share = below[i] * inverse;
        for (std::size_t k = 0; k <= i; ++k) {
          matrix_[*target++] -= share * below[k];
        }
      }
      for (std::size_t i = 0; i < entries; ++i) {
        below[i] *= inverse;
      }
    }
  }

  void substitute() {
    const Elimination& plan = cluster_.elimination;
    const V* const entries = matrix_ + count_;
    for (std::size_t column = 0; column < masses_; ++column) {
      for (std::size_t i = plan.first[column]; i < plan.first[column + 1]; ++i) {
        x_[plan.row[i]] -= entries[i] * x_[column];
      }
      x_[column] *= matrix_[column];
    }
    if (has_places()) {
      places_.solve(matrix_ + masses_, entries + plan.first[masses_], x_ + masses_);
    }
    for (std::size_t column = masses_; column-- > 0;) {
      for (std::size_t i = plan.first[column]; i < plan.first[column + 1]; ++i) {
        x_[column] -= entries[i] * x_[plan.row[i]];
      }
    }
  }

  const PassiveLink* links_;
  const Cluster& cluster_;
  std::size_t masses_;
  std::size_t count_;
  V* give_;
  V* mass_;
  V* at_;   // Displacement of each end.
  V* way_;  // Direction of each end.
  V* x_;
  V* matrix_;
  Places<V> places_;
};

// Solution by links, restricted to the active ones. `drag`: coupling of each link with the web, and
// through it with all others.
template <class V>
class ByLinks {
 public:
  ByLinks(const PassiveLink* links, const Cluster& cluster, V* numbers, JointBody<V>& body,
          const V* drag = nullptr)
      : drag_(drag),
        links_(links),
        count_(cluster.count),
        coupling_(numbers),
        matrix_(coupling_ + count_ * count_),
        root_(matrix_ + count_ * count_),
        x_(root_ + count_),
        pulled_(x_ + count_),
        index_(reinterpret_cast<std::size_t*>(pulled_ + count_)),
        body_(body) {}

  template <class Lanes>
  void rest(Lanes live) {
    for (std::size_t i = 0; i < count_; ++i) {
      pulled_[i] = select(live, V{}, pulled_[i]);
    }
  }
  void pull(std::size_t link, V force) {
    const V* const row = couple(find(link));
    for (std::size_t i = 0; i < count_; ++i) {
      pulled_[i] -= row[i] * force;
    }
  }
  V pulled(std::size_t link) const { return pulled_[link]; }

  // Solves (I + T C T) y = T h with h = C (value - force), T = S^1/2 and T z = y; then push = off -
  // T y and way = -C push.
  void solve(Joined<V>* joined, bool) {
    for (std::size_t i = 0; i < count_; ++i) {
      const Joined<V>& link = joined[i];
      if (any_of((link.value != link.force) | (link.slope > V{}))) {
        couple(find(i));
      }
    }
    fill(joined);
    factorise();
    substitute();
    for (std::size_t i = 0; i < count_; ++i) {
      joined[i].newton_way = V{};
      joined[i].newton_push = V{};
    }
    for (std::size_t k = 0; k < active_; ++k) {
      Joined<V>& link = joined[index_[k]];
      link.newton_push = link.value - link.force - root_[k] * x_[k];
      const V* const row = coupling_ + k * count_;
      for (std::size_t i = 0; i < count_; ++i) {
        joined[i].newton_way -= row[i] * link.newton_push;
      }
    }
  }

  template <class Lanes>
  void turn(Lanes) {}
  // Recomputes instead of accumulating, so that rounding errors do not add up.
  template <class Lanes>
  void go(const Joined<V>* joined, Lanes live, V) {
    follow(joined, live);
  }
  template <class Lanes>
  void follow(const Joined<V>* joined, Lanes live) {
    rest(live);
    for (std::size_t i = 0; i < count_; ++i) {
      const V force = select(live, joined[i].force, V{});
      if (any_of(force != V{})) {
        pull(i, force);
      }
    }
  }
  void push(const Joined<V>* joined, JointBody<V>& body) {
    for (std::size_t i = 0; i < count_; ++i) {
      body.push(links_[i].ends, joined[i].force);
    }
  }
  V inertia_along(const Joined<V>* joined) const {
    V sum{};
    for (std::size_t i = 0; i < count_; ++i) {
      sum -= joined[i].way * joined[i].force;
    }
    return sum;
  }

 private:
  // Returns the index of a link among the active ones, adding it if necessary.
  std::size_t find(std::size_t link) {
    std::size_t k = 0;
    while (k < active_ && index_[k] != link) {
      ++k;
    }
    return k < active_ ? k : (index_[active_] = link, is_new_ = true, active_++);
  }
  // Returns the coupling of an active link with all links: [link].
  const V* couple(std::size_t k) {
    V* const row = coupling_ + k * count_;
    for (std::size_t i = 0; is_new_ && i < count_; ++i) {
      row[i] = body_.coupling(links_[index_[k]].ends, links_[i].ends) -
               (drag_ == nullptr ? V{} : drag_[index_[k]] * drag_[i]);
    }
    is_new_ = false;
    return row;
  }

  void fill(const Joined<V>* joined) {
    for (std::size_t k = 0; k < active_; ++k) {
      root_[k] = square_root(joined[index_[k]].slope);
      x_[k] = V{};
    }
    for (std::size_t k = 0; k < active_; ++k) {
      const Joined<V>& link = joined[index_[k]];
      const V off = link.value - link.force;
      const V* const row = coupling_ + k * count_;
      for (std::size_t i = 0; i < active_; ++i) {
        x_[i] += row[index_[i]] * off;
      }
      for (std::size_t i = k; i < active_; ++i) {
        matrix_[i * count_ + k] = root_[k] * row[index_[i]] * root_[i];
      }
      matrix_[k * count_ + k] += 1;
    }
    for (std::size_t k = 0; k < active_; ++k) {
      x_[k] *= root_[k];
    }
  }

  void factorise() {
    for (std::size_t k = 0; k < active_; ++k) {
      const V inverse = 1 / matrix_[k * count_ + k];
      matrix_[k * count_ + k] = inverse;
      for (std::size_t i = k + 1; i < active_; ++i) {
        const V share = matrix_[i * count_ + k] * inverse;
        for (std::size_t j = k + 1; j <= i; ++j) {
          matrix_[i * count_ + j] -= share * matrix_[j * count_ + k];
        }
      }
      for (std::size_t i = k + 1; i < active_; ++i) {
        matrix_[i * count_ + k] *= inverse;
      }
    }
  }

  void substitute() {
    for (std::size_t k = 0; k < active_; ++k) {
      for (std::size_t i = k + 1; i < active_; ++i) {
        x_[i] -= matrix_[i * count_ + k] * x_[k];
      }
      x_[k] *= matrix_[k * count_ + k];
    }
    for (std::size_t k = active_; k-- > 0;) {
      for (std::size_t i = k + 1; i < active_; ++i) {
        x_[k] -= matrix_[i * count_ + k] * x_[i];
      }
    }
  }

  const V* drag_;
  const PassiveLink* links_;
  std::size_t count_;
  std::size_t active_ = 0;
  bool is_new_ = false;
  V* coupling_;  // [active][link]
  V* matrix_;    // [active][active] Below the diagonal.
  V* root_;
  V* x_;
  V* pulled_;
  std::size_t* index_;  // [active] Link.
  JointBody<V>& body_;
};

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
