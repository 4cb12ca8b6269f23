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

// Returns at least 0; NaN stays NaN.
double rising(double slope) {
  return std::max(slope, 0.0);
}

// Returns true if a line of the FAUST text begins the definition of `prefix` followed by `name`.
constexpr bool defines(std::string_view text, std::string_view prefix, std::string_view name) {
  for (std::size_t at = 0; at != text.npos; at = text.find('\n', at)) {
    at += at < text.size() && text[at] == '\n' ? 1 : 0;
    const std::string_view line = text.substr(at);
    if (line.starts_with(prefix) && line.substr(prefix.size()).starts_with(name) &&
        line.substr(prefix.size() + name.size()).starts_with("(")) {
      return true;
    }
  }
  return false;
}

// Returns true if the law's struct has a data member for each of these numbers.
template <class Struct, std::size_t... i>
constexpr bool takes_numbers(std::index_sequence<i...>) {
  return requires {
    Struct{static_cast<double>(i)...};
  };
}

// Checks the facts of one law. The compiler names its struct with each error.
template <class Type>
struct CheckedFacts {
  static constexpr const LawFacts& facts = Type::facts;
  static_assert(defines(facts.faust, "", facts.name),
                "the FAUST text of a law NAME must define NAME, the published force");
  static_assert(defines(facts.faust, "steady_", facts.name),
                "the FAUST text of a law NAME must define steady_NAME, for the passive form");
  static_assert(defines(facts.faust, "gradient_", facts.name),
                "the FAUST text of a law NAME must define gradient_NAME, for the passive form");
  static_assert(!takes_numbers<typename Type::template With<double>>(
                    std::make_index_sequence<facts.count + 1>{}),
                "a law's `count` must be the number of its data members");
};
template <class... Types>
constexpr bool are_checked(std::tuple<Types...>) {
  return ((sizeof(CheckedFacts<Types>) > 0) && ...);
}
static_assert(are_checked(Laws{}));
static_assert(std::tuple_element_t<0, Laws>::law == linear_law);

}  // namespace

std::span<const LawFacts> law_table() {
  return table;
}

const LawFacts& facts_of(Law law) {
  return table[static_cast<std::size_t>(law)];
}

Law law_named(std::string_view name) {
  const auto found = std::find_if(table.begin(), table.end(),
                                  [&](const LawFacts& law) { return law.name == name; });
  return static_cast<Law>(found - table.begin());
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
