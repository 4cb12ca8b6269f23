// core/laws: the list of force laws, with their templates. To add a law: write its file beside this
// one, add its name to the enum, and its row to Laws. The property tests in tests/unit/laws report
// facts that contradict each other. Include law.h instead where the facts are enough.
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

enum class Law : std::uint8_t {
  spring,
  quadratic_spring,
  cubic_spring,
  clipped_spring,
  pluck,
  bow,
  smooth_bow,
  either_bow,
  contact,
  clipped_contact,
  power_contact,
};

// A law as a type. With<V> is the law of a link whose arguments are of type V, a number or a pack.
// It has these members:
//   V force(d, v)                    the published force
//   V potential(d)                   its slope is force(d, 0)
//   V secant(d)                      force over distance near d, a stiffness
//   V passive(LinkState)             the passive force of a link that acts alone
//   Steady<V> steady(LinkState)      the part of it that does not depend on the solution
//   Slope<V> gradient(before, step)  the rest, for a change of distance `step` in two samples
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

using Laws = std::tuple<LawType<Law::spring, laws::Spring>,                     //
                        LawType<Law::quadratic_spring, laws::QuadraticSpring>,  //
                        LawType<Law::cubic_spring, laws::CubicSpring>,          //
                        LawType<Law::clipped_spring, laws::ClippedSpring>,      //
                        LawType<Law::pluck, laws::Pluck>,                       //
                        LawType<Law::bow, laws::Bow>,                           //
                        LawType<Law::smooth_bow, laws::SmoothBow>,              //
                        LawType<Law::either_bow, laws::EitherBow>,              //
                        LawType<Law::contact, laws::Contact>,                   //
                        LawType<Law::clipped_contact, laws::ClippedContact>,    //
                        LawType<Law::power_contact, laws::PowerContact>>;
inline constexpr std::size_t law_count = std::tuple_size_v<Laws>;

// Calls `use` with the law's LawType. Callers do this outside of their loops, so that the law is a
// constant within them.
template <std::size_t i = 0, class Use>
[[gnu::always_inline]] static inline decltype(auto) with_law_type(Law law, Use&& use) {
  using Type = std::tuple_element_t<i, Laws>;
  static_assert(static_cast<std::size_t>(Type::law) == i, "laws are listed in their enum's order");
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
