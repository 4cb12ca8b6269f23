// core: pseudo-random numbers that are the same on every machine. All functions: [any thread]
// wait-free.
#pragma once

#include <cstdint>

namespace ressort {

// Advances a counter and returns its scrambled value (Steele, Lea and Flood, 2014). Any state is
// valid. Inlined, because loops that are compiled for each instruction set use it.
inline constexpr std::uint64_t splitmix_step = 0x9e3779b97f4a7c15u;
[[gnu::always_inline]] inline std::uint64_t splitmix64(std::uint64_t& state) {
  std::uint64_t z = (state += splitmix_step);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

// Advances a state other than 0 (Marsaglia, 2003) and returns a number in -1..1.
inline double white_sample(std::uint64_t& state) {
  state ^= state << 13;
  state ^= state >> 7;
  state ^= state << 17;
  return static_cast<double>(static_cast<std::int64_t>(state)) * 0x1p-63;
}

}  // namespace ressort
