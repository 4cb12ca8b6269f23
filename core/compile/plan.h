// core/compile: how each part of a machine will be computed, and why, in words that a person can
// read.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/kernels/program.h"
#include "core/kernels/registry.h"
#include "core/model/preset/budget.h"
#include "core/progress.h"

namespace ressort {

// For how many masses the eigenvectors may be sought; the time grows with the third power. A method
// that is asked for by name is not held back by this.
inline constexpr std::uint32_t quick_modes = 320;  // while a person waits: 20 ms
inline constexpr std::uint32_t patient_modes =
    1000;  // while the model sounds already: half a second

// Masses that hang together, and the kernel that steps them.
struct Part {
  Method method = Method::direct;
  std::size_t masses = 0;  // that move
  std::size_t links = 0;
  double predicted_ns = 0.0;  // a sample, of all voices, with everything touching all the time
  double measured_ns = 0.0;   // the same at rest, by who has tried it; 0: nobody
  bool may_gain = false;      // by its modes, had it more patience
  std::string reason;
};

struct Plan {
  std::vector<Part> parts;
  std::vector<std::string> notes;  // on what is not computed as it is written, or not at all
};

// A machine in the forms that its plan says.
struct Planned {
  Machine machine;
  std::vector<Part> parts;
};

// Gives every part of the machine the form that the cost model says is the cheapest at its worst,
// or the one of `method` where a part has it; divided among load.executor where that pays. With a
// budget for pitch or decay, the cheapest of the physical methods where the published scheme misses
// it. O(elements), and the eigenvectors of a part of up to `most_modes` masses for which the modal
// form may pay. [any thread but audio]
Planned make_plan(Machine machine, const Workload& load, std::optional<Method> method = {},
                  std::uint32_t most_modes = patient_modes, const Budget& budget = {},
                  const Progress& progress = {});

// One line a part, and one a note.
std::string describe(const std::vector<Part>& parts);
std::string describe(const Plan& plan);

}  // namespace ressort
