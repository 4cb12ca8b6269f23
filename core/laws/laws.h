// core/laws: every force law, once. To add one: its file beside this one, a name in the enum, and
// its line in Laws. The property test in tests/unit/laws finds what does not hold together.
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

// A law as a type: With<V> is the law of a link whose arguments are Vs; of it
//   V force(d, v)
//   V potential(d)                        its slope is force(d, 0)
//   V secant(d)                           a stiffness: force over distance, near d
//   V passive(LinkState)                  the force that cannot gain energy, if it acts alone
//   Steady<V> steady(LinkState)           of that what does not depend on where it will be,
//   Slope<V> gradient(before, step)       and the rest, if it goes so far in two samples
//   V curved(d)                           if it contains a spring: the potential of the rest
//   Slopes steepest(least, most, within), gentlest(least)  as in law.h, of laws of doubles
// and where a kernel had better keep other numbers than the arguments, void keep(row) and a
// constructor that reads the row, of most_kept_numbers at most.
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
inline constexpr std::size_t most_kept_numbers = 6;
inline constexpr std::size_t law_count = std::tuple_size_v<Laws>;

// Calls `use` with the law's LawType: outside of every loop, which then has the law as a constant.
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

// The law of a type whose arguments are c(0), c(1) and so on.
template <class Type, class V, class Coefficient>
[[gnu::always_inline]] static inline auto law_of(Coefficient&& c) {
  return [&]<std::size_t... i>(std::index_sequence<i...>) {
    return typename Type::template With<V>{c(i)...};
  }
  (std::make_index_sequence<Type::facts.count>{});
}

// Calls `use` with the law of these arguments.
template <class V, class Coefficient, class Use>
[[gnu::always_inline]] static inline decltype(auto) with_law(Law law, Coefficient&& c, Use&& use) {
  return with_law_type(law, [&](auto type) { return use(law_of<decltype(type), V>(c)); });
}

}  // namespace ressort::laws
