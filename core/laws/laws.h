// core/laws: the list of force laws, with their templates. To add a law: write its file beside this
// one, include it, and add its row to the list; core/README.md describes the steps. The property
// tests in tests/unit/laws report facts that contradict each other. Include law.h instead where the
// facts are enough.
#pragma once

#include <tuple>
#include <utility>

#include "core/laws/bow.h"
#include "core/laws/clipped_contact.h"
#include "core/laws/clipped_spring.h"
#include "core/laws/contact.h"
#include "core/laws/cubic_spring.h"
#include "core/laws/either_bow.h"
#include "core/laws/pluck.h"
#include "core/laws/power_contact.h"
#include "core/laws/quadratic_spring.h"
#include "core/laws/smooth_bow.h"
#include "core/laws/spring.h"

namespace ressort::laws {

// The rows of the list: the name in the enum, and the struct. The spring comes first.
// clang-format off
#define RESSORT_EACH_LAW(ROW)               \
  ROW(spring, Spring)                       \
  ROW(quadratic_spring, QuadraticSpring)    \
  ROW(cubic_spring, CubicSpring)            \
  ROW(clipped_spring, ClippedSpring)        \
  ROW(pluck, Pluck)                         \
  ROW(bow, Bow)                             \
  ROW(smooth_bow, SmoothBow)                \
  ROW(either_bow, EitherBow)                \
  ROW(contact, Contact)                     \
  ROW(clipped_contact, ClippedContact)      \
  ROW(power_contact, PowerContact)
// clang-format on

#define RESSORT_LAW_NAME(name, Struct) name,
enum class Law : std::uint8_t { RESSORT_EACH_LAW(RESSORT_LAW_NAME) };

// A law as a type. With<V> is the law of a link whose arguments are of type V, a number or a pack.
// It has these members:
//   V force(d, v)                    the published force
//   V potential(d)                   its slope is force(d, 0)
//   V secant(d)                      stiffness at d: force(d, 0) over the distance from where
//                                    the law begins to act, or its largest value. Modes that are a
//                                    static compliance reduce the published force by it.
//   V passive(LinkState)             the passive force of a link that acts alone
//   Steady<V> steady(LinkState)      the part of it that does not depend on the solution
//   Slope<V> gradient(before, step)  the rest, for a change of distance `step` in two samples
//                                    passive = steady.force + steady.damping step + gradient
//   V curved(d)                      the potential of the rest, if the law contains a spring
//   Slope<V> friction(v)             only of friction laws: the force and its slope
//   Slope<V> inside(before)          only if is_straight: force and slope while it acts
//   static Slopes steepest(least, most, within), gentlest(least)  see law.h; for doubles only
// A law may also have void keep(row) and a constructor from such a row of at most
// most_kept_numbers: numbers that follow from the arguments and are cheaper to compute with.
template <Law law_value, template <class> class Struct>
struct LawType {
  static constexpr Law law = law_value;
  static constexpr const LawFacts& facts = Struct<double>::facts;
  template <class V>
  using With = Struct<V>;
};

template <class, class... Types>
using ListOf = std::tuple<Types...>;
#define RESSORT_LAW_TYPE(name, Struct) , LawType<Law::name, laws::Struct>
using Laws = ListOf<void RESSORT_EACH_LAW(RESSORT_LAW_TYPE)>;
inline constexpr std::size_t law_count = std::tuple_size_v<Laws>;

// Calls `use` with the law's LawType. Callers do this outside of their loops, so that the law is a
// constant within them.
template <std::size_t i = 0, class Use>
[[gnu::always_inline]] static inline decltype(auto) with_law_type(Law law, Use&& use) {
  using Type = std::tuple_element_t<i, Laws>;
  if constexpr (i + 1 < law_count) {
    if (law != Type::law) {
      return with_law_type<i + 1>(law, std::forward<Use>(use));
    }
  }
  return use(Type{});
}

// Returns the law whose arguments are c(0), c(1) and so on.
template <class Type, class V, class Coefficient>
[[gnu::always_inline]] static inline auto law_of(Coefficient&& c) {
  return [&]<std::size_t... i>(std::index_sequence<i...>) {
    return typename Type::template With<V>{c(i)...};
  }
  (std::make_index_sequence<Type::facts.count>{});
}

// Calls `use` with the law that has these arguments.
template <class V, class Coefficient, class Use>
[[gnu::always_inline]] static inline decltype(auto) with_law(Law law, Coefficient&& c, Use&& use) {
  return with_law_type(law, [&](auto type) { return use(law_of<decltype(type), V>(c)); });
}

}  // namespace ressort::laws
