// core/compile: what will run, and why, in words that a person can read.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/model/network.h"

namespace ressort {

enum class Method { direct };

std::string_view method_name(Method method);

// Masses that hang together, and the kernel that steps them.
struct Part {
  Method method = Method::direct;
  std::size_t masses = 0;  // that move
  std::size_t links = 0;
  std::string reason;
};

struct Plan {
  std::vector<Part> parts;
};

// [any thread but audio]
Plan make_plan(const Network& network);

// One line a part.
std::string describe(const Plan& plan);

}  // namespace ressort
