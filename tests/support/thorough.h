// tests: how much is looked at of what takes long.
#pragma once

#include <cstdlib>

namespace ressort::support {

// Whether RESSORT_THOROUGH is set, as in the second tier.
inline bool is_thorough() {
  return std::getenv("RESSORT_THOROUGH") != nullptr;
}

// All of something, or so few of it where every change waits for the answer.
template <class Number>
Number of_all(Number few, Number all) {
  return is_thorough() ? all : few;
}

}  // namespace ressort::support
