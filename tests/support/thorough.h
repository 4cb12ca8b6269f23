// tests: how much of the slow tests runs.
#pragma once

#include <cstddef>
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

// Returns whether this case of many is tested: all in the second tier, else one in `parts`, which
// RESSORT_TURN selects. Continuous integration derives RESSORT_TURN from the commit.
inline bool is_in_turn(std::size_t number, std::size_t parts) {
  const char* const turn = std::getenv("RESSORT_TURN");
  return is_thorough() ||
         (number + (turn != nullptr ? std::strtoull(turn, nullptr, 10) : 0)) % parts == 0;
}

}  // namespace ressort::support
