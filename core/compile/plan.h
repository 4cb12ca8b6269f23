// core/compile: how each part of a machine will be computed, and why, in words that a person can
// read.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/compile/accuracy/accuracy.h"
#include "core/kernels/program.h"
#include "core/kernels/registry.h"
#include "core/model/preset/budget.h"
#include "core/progress.h"

namespace ressort::compile {

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
  std::optional<Accuracy> accuracy;  // where a budget asks for pitch or decay
  std::string reason;
};

struct Plan {
  std::vector<Part> parts;
  Budget budget;                     // that it was made for
  std::optional<Accuracy> accuracy;  // the worst of the parts, and what was merged
  std::vector<std::string> notes;    // on what is not computed as it is written, or not at all
};

// A machine in the forms that its plan says.
struct Planned {
  Machine machine;
  std::vector<Part> parts;
  // On every stiffness: what the parts bear beside the published scheme's share of
  // load.highest_factor; infinite for exact modes.
  double more = 1.0;
};

// Where a budget of pitch and decay has to hold, beside the start, and what is spent of it already.
struct Promise {
  std::vector<double> lowest;  // [parameter]; empty: none is turned
  std::vector<double> highest;
  double highest_factor = 1.0;  // of the highest key
  Accuracy merged;
};

// Gives every part of the machine the form that the cost model says is the cheapest at its worst,
// or the one of `method` where a part has it; divided among load.executor where that pays. With a
// budget for pitch or decay, the cheapest whose poles keep it at all corners (accuracy.h), of the
// published scheme, exact modes and several steps a sample; where none does or
// nobody knows, the nearest. Where keys ask for more stiffness than the published scheme bears
// (load.wanted_factor) all parts get exact modes or several steps a sample, if each can and half a
// core is enough; else none does. O(elements), the eigenvectors of a part of up to `most_modes`
// masses for which the modal form may pay, and what a Judge takes. [any thread but audio]
Planned make_plan(Machine machine, const Workload& load, std::optional<Method> method = {},
                  std::uint32_t most_modes = patient_modes, const Budget& budget = {},
                  const Progress& progress = {}, const Promise& promise = {});

// The worst of some parts, with what was merged; nothing without a budget of pitch or decay.
std::optional<Accuracy> accuracy_of(const std::vector<Part>& parts);

// What a plan does not keep of its budget of pitch and decay, in a sentence; nothing where it keeps
// it all.
std::optional<std::string> broken_promise(const Plan& plan);

// One line a part, and one a note.
std::string describe(const std::vector<Part>& parts);
std::string describe(const Plan& plan);

}  // namespace ressort::compile
