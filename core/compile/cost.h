// core/compile: what a kernel will cost, predicted from its tables.
#pragma once

#include "core/kernels/isa.h"
#include "core/kernels/program.h"

namespace ressort {

// What the prediction is for.
struct Workload {
  bool is_double = true;
  bool is_compensated = false;  // which only one form is
  Isa isa = Isa::base;
  int voices = 1;
  double highest_factor = 1.0;  // on every stiffness, that a voice may have
  Crew* crew = nullptr;         // that large parts may be shared out to; null: one core for all
};

// Nanoseconds that shards wait for each other once, and one of them for its copies.
double exchange_ns(std::size_t copies);

// Nanoseconds a sample for all voices in the form that the Program has, everything that can touch
// touching all the time: what a block's budget has to hold. Fitted to measurements on one machine
// (Zen 4 at 3.7 GHz), to about a quarter; what matters is the order of the forms.
double predicted_ns(const Program& program, const Workload& load);

// The same of the slowest shard, and what it waits.
double sharded_ns(const Shards& form, const Workload& load);

// The same for the modal form before it is known: what it will cost at least.
double least_modal_ns(const Program& program, const Workload& load);

// A sample of one voice at the very worst, in visits of some nanoseconds, links that are not plain
// going through each other as long as they may: to know what not to try. O(runs)
double worst_steps(const Program& program);

}  // namespace ressort
