// core/model: links that move each other, solved in every sample, in FAUST. All text, for
// faust_joint.cpp.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/laws/law.h"

namespace ressort::model {

struct FaustLink {
  Law law{};
  std::string name;
  std::vector<std::string> arguments;  // of the law, at the rate in use
  bool sets_out = false;               // it would pull as it starts
};

// Links that move each other, springs first.
struct FaustLinks {
  std::span<const FaustLink> links;
  std::size_t springs = 0;
  std::span<const std::string> couplings;  // [link][link] how far a force on one shortens the other
};

// The definition joint_NAME, NAME being that of the first: what each of them exerts. Of every link
// it stands on c_, the distance a sample ago, e_, how fast that grew then, s_, how far it would go
// in two samples, and for all but springs rest_, what steady_ says of it.
std::string faust_solution(const FaustLinks& links);

}  // namespace ressort::model
