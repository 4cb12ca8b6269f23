// core/compile: how each part of a machine will be computed, and why, in words that a person can
// read.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/compile/cost.h"
#include "core/engine/program.h"

namespace ressort {

enum class Method { direct, chains, dense, modal, grid, chorus };

inline constexpr Method all_methods[] = {Method::direct, Method::chains, Method::dense,
                                         Method::modal,  Method::grid,   Method::chorus};

std::string_view method_name(Method method);

// Beyond, the eigenvectors would keep a person waiting: the time grows with the third power, from a
// tenth of a second here. A method that is asked for by name is not held back by this.
inline constexpr std::uint32_t most_planned_modes = 640;

// Masses that hang together, and the kernel that steps them.
struct Part {
  Method method = Method::direct;
  std::size_t masses = 0;  // that move
  std::size_t links = 0;
  double predicted_ns = 0.0;  // a sample, of all voices, with everything touching all the time
  std::string reason;
};

struct Plan {
  std::vector<Part> parts;
};

// Gives every part of the machine the form that the cost model says is the cheapest at its worst,
// or the one of `method` where a part has it. O(elements), and the eigenvectors of a part for which
// the modal form may pay: a tenth of a second for 600 masses. [any thread but audio]
Plan make_plan(Machine& machine, const Load& load, std::optional<Method> method = {});

// One line a part.
std::string describe(const Plan& plan);

}  // namespace ressort
