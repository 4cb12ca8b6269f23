#include "core/laws/laws.h"

#include <algorithm>

namespace ressort::laws {
namespace {

constexpr auto table = []<std::size_t... i>(std::index_sequence<i...>) {
  return std::array{std::tuple_element_t<i, Laws>::facts...};
}
(std::make_index_sequence<law_count>{});

template <class Type>
auto with_numbers(const LawNumbers& numbers) {
  return law_of<Type, double>([&](std::size_t i) { return numbers[i]; });
}

// Not below 0; what is no number stays so.
double rising(double slope) {
  return std::max(slope, 0.0);
}

}  // namespace

std::string_view family_name(Family family) {
  switch (family) {
    case Family::spring:
      return "spring";
    case Family::pluck:
      return "pluck";
    case Family::bow:
      return "bow";
    case Family::contact:
      return "contact";
  }
  return "link";
}

std::span<const LawFacts> law_table() {
  return table;
}

const LawFacts& facts_of(Law law) {
  return table[static_cast<std::size_t>(law)];
}

Slopes steepest(Law law, const LawNumbers& least, const LawNumbers& most, double within) {
  return with_law_type(law, [&]<class Type>(Type) {
    const Slopes slopes = Type::template With<double>::steepest(with_numbers<Type>(least),
                                                                with_numbers<Type>(most), within);
    return Slopes{.stiffness = rising(slopes.stiffness),
                  .damping = rising(slopes.damping),
                  .stiff_damping = rising(slopes.stiff_damping),
                  .pull = rising(slopes.pull)};
  });
}

Slopes gentlest(Law law, const LawNumbers& least) {
  return with_law_type(law, [&]<class Type>(Type) {
    return Type::template With<double>::gentlest(with_numbers<Type>(least));
  });
}

}  // namespace ressort::laws
