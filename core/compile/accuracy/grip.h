// core/compile: whether bows are weak enough for the steps that they are played in.
//
// In one step a passive bow of Z above 3 M, M being what gives way to it, has several speeds at
// which its friction and what it holds agree; it lets go too early, without making energy. In so
// many steps a sample that Z is below 3 M in each it is right.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "core/analysis/interval.h"
#include "core/compile/machine.h"
#include "core/model/network.h"
#include "core/result.h"

namespace ressort::compile {

struct StrongBow {
  std::string name;
  SourceLocation location;
  double strength = 0.0;  // its largest Z a sample, at the pitch as it is written
  double most = 0.0;      // 3 M
};

// The one with the most for what it holds, wherever in the box the parameters are; places are where
// they start. What holds a waveguide, which has no inertia, does not count. For a network without
// macros. O(links). [any thread but audio]
std::optional<StrongBow> strongest_bow(const Network& network, std::span<const LinkScheme> schemes,
                                       const ParameterBox& box, std::span<const double> start,
                                       double rate_ratio);

// In how many steps a sample a machine's bows are played.
double steps_of_bows(const Machine& machine);

// That it is too strong as it starts, and what helps, at its line; nothing if it is not.
std::optional<Error> too_strong(const StrongBow& bow, double steps, double rate_hz);

// From which factor on every stiffness on it is too strong, as its Z grows with the root.
double too_strong_from(const StrongBow& bow, double steps);

}  // namespace ressort::compile
