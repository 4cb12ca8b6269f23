// app/commands: which of many ways are worth having, and how far they come together. Pure.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "app/rooms.h"

namespace ressort::commands {

// What a way costs, and how good it is: smaller x and larger y are better.
struct Trade {
  double ns = 0.0;
  double db = 0.0;  // signal to error
};

// The worst that counts: what costs more, or has no signal above its error, adds nothing. And the
// best that is told apart.
inline constexpr double dearest_ns = 1e5;
inline constexpr double least_db = 0.0;
inline constexpr double most_db = 200.0;

// [trade] Is none at once as cheap and as good, and one of both better? Of equal ones the first is
// taken. What is no number is on no front.
std::vector<bool> front_of(std::span<const Trade> trades);

// The area that the trades dominate, in decades of time times dB: from `dearest_ns` and `least_db`,
// with `most_db` as the most. A decade faster at 100 dB adds 100.
double hypervolume(std::span<const Trade> trades);

}  // namespace ressort::commands
