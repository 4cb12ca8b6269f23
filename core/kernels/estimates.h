// core/kernels: what a kernel will cost in time and memory, as the parts that all predictions are
// made of.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "core/kernels/isa.h"
#include "core/kernels/prices/prices.h"
#include "core/kernels/program.h"

namespace ressort::kernels {

class Executor;

// What a prediction is for.
struct Workload {
  bool is_double = true;
  Isa isa = Isa::base;
  int voices = 1;
  double highest_factor = 1.0;   // on every stiffness, that the published scheme bears
  double wanted_factor = 1.0;    // that keys ask for
  double moving = 0.25;          // share of the samples in which some parameter moves
  bool is_untuned = false;       // no voice ever has another one than 1
  Executor* executor = nullptr;  // that large parts may be shared out to; null: one core for all
  bool reaches_beyond() const { return wanted_factor > highest_factor; }
};

// Links by what they cost: those that only pull, in a line or bent, and those that have to look
// first. Without those that are not plain.
struct LinkCount {
  double springs = 0.0;
  double bent = 0.0;
  double others = 0.0;
};
LinkCount links_of(const Program& program);

// What the links take that are not plain, once for all lanes, or for one number: while they touch.
// O(links + nodes)
double passive_ns(const Program& program);

// How many packs the voices fill.
double packs_of(const Workload& load);
inline double bytes_of_number(const Workload& load) {
  return load.is_double ? 8.0 : 4.0;
}
inline double cost(const Work& work, const Workload& load) {
  return work.cost(load.isa, load.is_double);
}

// Lines that a sweep over so many bytes brings from the second cache, and from beyond it.
double lines_of(double bytes);
double far_lines_of(double bytes);

// A sample of one voice at the very worst, in visits of some nanoseconds, links that are not plain
// going through each other as long as they may: to know what not to try. O(runs)
double worst_steps(const Program& program);

// Bytes of one voice: its nodes and coefficients alone, with one number a link that all voices
// share tables for, and with a table of its own for links that are stepped one by one.
std::uint64_t node_bytes(const Program& program, std::uint64_t number_bytes);
std::uint64_t bytes_with_shared_links(const Program& program, std::uint64_t number_bytes);
std::uint64_t bytes_with_own_links(const Program& program, std::size_t links,
                                   std::uint64_t number_bytes);

// "1 link", "2 links"
std::string count_of(std::size_t count, const char* one, const char* many);

}  // namespace ressort::kernels
