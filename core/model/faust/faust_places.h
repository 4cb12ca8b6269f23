// core/model: places on macros and bodies in FAUST, as shares of what is around them. All text.
#pragma once

#include <string>
#include <vector>

#include "core/model/network.h"

namespace ressort::model {

// How much of a node a point is: its weight as a factor, "0.3*" or "hat(2.0, row_p)*".
struct FaustShare {
  std::uint32_t node = 0;
  std::string factor;
};

// Whether a coordinate stays where it is.
bool faust_is_fixed(const Network& network, ArgumentId coordinate);

// What a point of an expanded network, called `name`, stands for.
std::vector<FaustShare> faust_shares(const Network& network, std::uint32_t point,
                                     const std::string& name);

}  // namespace ressort::model
