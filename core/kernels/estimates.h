// core/kernels: what a kernel will cost in time and memory, as the parts that all predictions are
// made of.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "core/kernels/isa.h"
#include "core/kernels/program.h"

namespace ressort {

// What a prediction is for.
struct Workload {
  bool is_double = true;
  bool is_compensated = false;  // which only one form is
  Isa isa = Isa::base;
  int voices = 1;
  double highest_factor = 1.0;   // on every stiffness, that the published scheme bears
  double wanted_factor = 1.0;    // that keys ask for
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

// How many packs the voices fill, each counted as often as it is dearer than one of AVX2: the
// widest are worked on in two halves.
double packs_of(const Workload& load);

// The wide registers of v3 and v4, or the base's?
inline bool is_wide(const Workload& load) {
  return load.isa != Isa::base;
}

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

}  // namespace ressort
