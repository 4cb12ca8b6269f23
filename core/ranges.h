// core: makes vectors and texts of the elements of ranges.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace ressort {

// Returns the projections of all elements, in order.
template <class Range, class Projection>
auto mapped(const Range& range, Projection projection) {
  std::vector<std::decay_t<std::invoke_result_t<Projection&, decltype(*std::begin(range))>>> all;
  for (const auto& element : range) {
    all.push_back(std::invoke(projection, element));
  }
  return all;
}

// Returns the words that the projection makes of all elements, with a separator between them.
template <class Range, class Projection = std::identity>
std::string joined(const Range& range, std::string_view between, Projection projection = {}) {
  std::string text;
  for (const auto& element : range) {
    text += text.empty() ? "" : between;
    text += std::invoke(projection, element);
  }
  return text;
}

}  // namespace ressort
