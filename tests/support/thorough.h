// tests: how much of the slow tests runs.
#pragma once

#include <cstdlib>

namespace ressort::support {

// Returns whether RESSORT_THOROUGH is set, as in the second tier.
inline bool is_thorough() {
  return std::getenv("RESSORT_THOROUGH") != nullptr;
}

// Returns `all` in the second tier, else `few`.
template <class Number>
Number of_all(Number few, Number all) {
  return is_thorough() ? all : few;
}

}  // namespace ressort::support
