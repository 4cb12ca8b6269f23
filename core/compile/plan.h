// core/compile: chooses the kernel of each part of a machine, and gives the reasons in plain words.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/compile/accuracy/accuracy.h"
#include "core/kernels/measure.h"
#include "core/kernels/program.h"
#include "core/kernels/registry.h"
#include "core/model/preset/budget.h"
#include "core/precision.h"
#include "core/progress.h"

namespace ressort::compile {

// Largest number of masses whose eigenvectors are computed; the time grows with the third power. A
// method that the user requests by name has no such limit.
inline constexpr std::uint32_t quick_modes = 320;     // while the user waits: 20 ms
inline constexpr std::uint32_t patient_modes = 1000;  // while the model already plays: 0.5 s

// Connected masses, and the kernel that steps them.
struct Part {
  Method method = Method::direct;
  std::size_t masses = 0;  // moving masses
  std::size_t links = 0;
  std::string form;  // form_name() of the kernel's tables
  // ns per sample of all voices, with all contacts closed all the time: a rough estimate that is
  // the same on every machine, and the time measured on this machine, 0 if unknown.
  double estimated_ns = 0.0;
  double measured_ns = 0.0;
  int voices = 1;                    // number of voices of both
  bool may_gain = false;             // its modes were not computed, and may be cheaper
  bool is_untimed = false;           // Not all of its possible forms are measured yet.
  std::optional<Accuracy> accuracy;  // if a budget limits pitch or decay
  std::string reason;
  std::string body;  // file name of the body that it belongs to; empty: the voices

  // Returns the time on this machine if it is known, otherwise the estimate.
  double ns() const { return measured_ns > 0.0 ? measured_ns : estimated_ns; }
};

struct Plan {
  std::vector<Part> parts;
  Budget budget;
  Precision precision = Precision::float64;
  std::optional<Accuracy> accuracy;  // error of the worst part
  // notes on everything that is not computed as the model is written
  std::vector<std::string> notes;
};

// A machine whose parts have the forms of a plan.
struct Planned {
  Machine machine;
  std::vector<Part> parts;
  // The highest stable factor on every stiffness, as a multiple of that of the published scheme
  // (load.highest_factor); infinite for exact modes.
  double more = 1.0;
};

// The parameter box and the keys for which a budget of pitch and decay has to hold.
struct BudgetRegion {
  std::vector<double> lowest;  // [parameter]; empty: no parameter moves
  std::vector<double> highest;
  double highest_factor = 1.0;  // stiffness factor of the highest key
};

// Inputs of the choice among the forms of a part, besides their estimates.
struct Choice {
  const Timings* timings = nullptr;  // null: only estimates, the same on every machine
  // [moving part] Part::form of an earlier plan, which is repeated; empty: the choice is free.
  // Names of forms that the part does not have are ignored.
  std::span<const std::string> forms = {};
};

// Chooses the form of every part of the machine: that of `method` if the part has it, otherwise the
// cheapest form in the worst case, where one voice counts half as much as all.
//
// Estimates rank the forms. With choice.timings, the forms with estimates up to four times the best
// are measured, and a form that is 10 % faster than the first in rank replaces it.
//
// With a budget of pitch or decay, only forms whose poles keep the budget at all corners
// (accuracy.h) are compared: the published scheme, exact modes and several steps a sample. If no
// form keeps it, or the error is unknown, the plan takes the nearest.
//
// If keys need more stiffness than the published scheme allows (load.wanted_factor), all parts get
// exact modes or several steps a sample, provided that each part has such a form and that by its
// estimate half a core is enough for it. Otherwise no part does.
//
// O(elements), plus the eigenvectors of a part of up to `most_modes` masses if modes may be
// cheaper, plus the time of a AccuracyMeter. [any thread but audio]
Planned make_plan(Machine machine, const Workload& load, std::optional<Method> method = {},
                  std::uint32_t most_modes = patient_modes, const Budget& budget = {},
                  const Progress& progress = {}, const BudgetRegion& region = {},
                  const Choice& choice = {});

// Returns Part::form of every part, for Choice::forms.
std::vector<std::string> forms_of(const Plan& plan);

// Returns the accuracy of the worst part; nothing without a budget of pitch or decay.
std::optional<Accuracy> accuracy_of(const std::vector<Part>& parts);

// Returns a sentence about the budget of pitch and decay if the plan exceeds it; otherwise nothing.
std::optional<std::string> missed_budget(const Plan& plan);

// Return one line for each part, and one for each note.
std::string describe(const std::vector<Part>& parts);
std::string describe(const Plan& plan);

}  // namespace ressort::compile
