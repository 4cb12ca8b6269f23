// core/kernels: passive links on a ModalState in a sample in which none passes an edge of its law.
// A part of modal_step.cpp.
//
// A contact that stays inside is a spring and a damper, and one that stays outside exerts no force.
// A link then exerts f = value + slope s for a step s = free - C f, so all links together satisfy
//
//   (I + S C) f = value + S free,  S: the slopes,  C: `gamma`
//
// The matrix is constant from sample to sample, so its inverse is kept. The result has to meet the
// condition of joint.h. If it does not, or if an edge is passed, the general solver is used.
#pragma once

#include <algorithm>

#include "core/kernels/modal/modal_sweep.h"
#include "core/kernels/passive/joint.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// Returns the depth of a distance inside a zone. It is positive where the link acts.
template <class T>
T depth_of(Zone zone, T reach, T d) {
  return zone == Zone::below ? d + reach : reach - absolute(d);
}

template <class T>
struct StraightLink {
  Zone zone;
  T reach;
  T before;  // the distance a sample ago
  T free;    // change of the distance if no link acted
  T value;   // force without a change of the distance
  T slope;   // force per change of the distance
  bool is_inside;
};

// Linearises a link. Returns false if its law always acts, if it is curved inside, or if the link
// passes an edge.
template <class T>
bool find_straight(const PassiveLink& passive, const laws::LinkState<T>& state,
                   const T* coefficient, StraightLink<T>& link) {
  const auto c = [&](std::size_t i) { return coefficient[passive.coefficients[i]]; };
  return with_law<T>(passive.law, c, [&](const auto& law) {
    constexpr LawFacts facts = std::remove_cvref_t<decltype(law)>::facts;
    if constexpr (facts.can_detach()) {
      link.zone = facts.zone;
      link.reach = c(facts.slot(Role::reach));
      link.before = state.before();
      link.free = state.free - state.before();
      const auto is_inside = [&](T d) { return depth_of(facts.zone, link.reach, d) > 0; };
      link.is_inside = is_inside(link.before);
      if (link.is_inside != is_inside(state.now) || link.is_inside != is_inside(state.free)) {
        return false;
      }
      link.value = link.slope = 0;
      if constexpr (facts.is_straight) {
        if (link.is_inside) {
          const auto inside = law.inside(link.before);
          link.value = inside.value;
          link.slope = inside.slope;
        }
        return true;
      }
      return !link.is_inside;
    }
    return false;
  });
}

// The matrices `gamma` and (I + S C)^-1 of the active links, column by column in whole packs, and
// the slopes S.
template <class T>
struct StraightMatrices {
  explicit StraightMatrices(const ModalState<T>& s)
      : count(s.passive.active->links.size()),
        packs((count + mode_lanes<T> - 1) / mode_lanes<T>),
        stride(packs * mode_lanes<T>),
        coupling(s.passive.straight),
        inverse(coupling + count * stride),
        slope(inverse + count * stride) {}

  // Multiplies a matrix by a vector: the sum of columns, each times a number.
  void multiply(const T* columns, const T* numbers, T* sums) const {
    for (std::size_t pack = 0; pack < packs; ++pack) {
      ModePack<T> sum{};
      for (std::size_t j = 0; j < count; ++j) {
        sum += RESSORT_ISA::packs(columns + j * stride)[pack] * numbers[j];
      }
      RESSORT_ISA::packs(sums)[pack] = sum;
    }
  }

  std::size_t count;
  std::size_t packs;  // packs of a column
  std::size_t stride;
  T* coupling;
  T* inverse;
  T* slope;
};

template <class T, class Body>
void invert_straight(ModalState<T>& s, const StraightMatrices<T>& m, const StraightLink<T>* links,
                     const Body& body) {
  const std::vector<PassiveLink>& active = s.passive.active->links;
  std::fill_n(m.coupling, 2 * m.count * m.stride, T(0));
  for (std::size_t i = 0; i < m.count; ++i) {
    m.slope[i] = links[i].slope;
    for (std::size_t j = 0; j < m.count; ++j) {
      const T moved = body.coupling(active[i].ends, active[j].ends);
      m.coupling[j * m.stride + i] = moved;
      m.inverse[j * m.stride + i] = (i == j ? T(1) : T(0)) + m.slope[i] * moved;
    }
  }
  for (std::size_t k = 0; k < m.count; ++k) {  // Gauss-Jordan elimination; no pivot is less than 1
    T* const column = m.inverse + k * m.stride;
    const T pivot = 1 / std::exchange(column[k], T(1));
    for (std::size_t i = 0; i < m.count; ++i) {
      column[i] *= pivot;
    }
    for (std::size_t j = 0; j < m.count; ++j) {
      if (j != k) {
        T* const other = m.inverse + j * m.stride;
        const T share = std::exchange(other[k], T(0));
        for (std::size_t i = 0; i < m.count; ++i) {
          other[i] -= share * column[i];
        }
      }
    }
  }
  s.passive.is_straight_stale = false;
}

// Solves the links and fills s.passive.pushed. Returns false, without changes, if an edge is passed
// or the result is not accurate enough.
template <class T, class Body>
bool push_straight(ModalState<T>& s, const Body& body) {
  const std::vector<PassiveLink>& active = s.passive.active->links;
  const std::size_t count = active.size();
  if (!s.passive.pulls || count < 2 || count > most_straight) {
    return false;
  }
  const StraightMatrices<T> matrices(s);
  StraightLink<T> links[most_straight];
  T wanted[most_straight];
  bool is_same = !s.passive.is_straight_stale;
  for (std::size_t i = 0; i < count; ++i) {
    const T* const row = s.passive.memory + i * passive_rows;
    const laws::LinkState<T> state{
        .now = row[0], .speed = row[1], .free = body.distance(active[i].ends)};
    if (!find_straight(active[i], state, s.ramps.value, links[i])) {
      return false;
    }
    wanted[i] = links[i].value + links[i].slope * links[i].free;
    is_same = is_same && matrices.slope[i] == links[i].slope;
  }
  if (!is_same) {
    invert_straight(s, matrices, links, body);
  }
  alignas(64) T force[most_straight];
  alignas(64) T back[most_straight];
  matrices.multiply(matrices.inverse, wanted, force);
  matrices.multiply(matrices.coupling, force, back);
  T error = 0;
  T scale = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const StraightLink<T>& link = links[i];
    const T step = link.free - back[i];
    if (link.is_inside != (depth_of(link.zone, link.reach, link.before + step) > 0)) {
      return false;
    }
    const T value = link.value + link.slope * step;
    error += absolute(value - force[i]) * absolute(step);
    scale += (absolute(value) + absolute(force[i])) * (absolute(link.before) + absolute(step));
  }
  if (!(error <= share_of_rounding<T> * scale)) {
    return false;
  }
  for (std::size_t i = 0; i < count; ++i) {
    s.passive.pushed[active[i].ends.a] = force[i];
  }
  return true;
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA
