// core/compile: whether bows are weak enough for their time steps.
//
// A passive bow is solved implicitly. In one step the friction curve and the line of the held mass
// M intersect more than once if Z > 3 M, so the bow slips too early (it never gains energy). With
// so many steps a sample that Z < 3 M in each step, a bow is right.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "core/analysis/interval.h"
#include "core/compile/machine.h"
#include "core/model/network.h"
#include "core/result.h"

namespace ressort::compile {

struct Bow {
  std::string name;
  SourceLocation location;
  double strength = 0.0;  // largest Z per sample, at the pitch as written
  double limit = 0.0;     // 3 M
};

// Returns the bow with the largest strength / limit, with parameters anywhere in the box and places
// at their start. Bows on waveguides have no limit, because a waveguide has no inertia. For
// networks without macros. O(links). [any thread but audio]
std::optional<Bow> find_strongest_bow(const Network& network, std::span<const Scheme> schemes,
                                      const ParameterBox& box, std::span<const double> start,
                                      double rate_ratio);

// Returns the smallest number of steps a sample in which a part with bows is played.
double bow_steps_per_sample(const Machine& machine);

// Returns an error with a remedy if the bow is too strong at the start values.
std::optional<Error> check_bow(const Bow& bow, double steps, double rate_hz);

// Returns the factor on every stiffness above which the bow is too strong. Z grows with its root.
double highest_bow_factor(const Bow& bow, double steps);

}  // namespace ressort::compile
