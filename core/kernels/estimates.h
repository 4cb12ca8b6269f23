// core/kernels: rough estimates of a kernel's time and memory. They rank the forms of a part before
// any is measured (measure.h), and decide what needs an order of magnitude only: whether a voice is
// affordable, whether helpers pay.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "core/kernels/isa.h"
#include "core/kernels/program.h"

namespace ressort::kernels {

// ns per operation: a nominal value for all machines; real ones may be two or three times faster or
// slower. An operation is one instruction, on a whole vector or on one number.
inline constexpr double nominal_ns = 0.25;

// The conditions that an estimate or a measurement is for.
struct Workload {
  bool is_double = true;
  Isa isa = Isa::base;
  int voices = 1;
  // the highest stable factor on every stiffness in the published scheme
  double highest_factor = 1.0;
  double wanted_factor = 1.0;  // the factor that keys require
  double moving = 0.25;        // fraction of the samples in which any parameter moves
  bool is_untuned = false;     // true if every voice keeps the factor 1
  bool reaches_beyond() const { return wanted_factor > highest_factor; }
};

// Plain links by their cost: linear springs, nonlinear springs, and laws that need a comparison.
struct LinkCount {
  double springs = 0.0;
  double bent = 0.0;
  double others = 0.0;
};
LinkCount links_of(const Program& program);

// Returns the operations of all links that are not plain while they touch, for one pack.
// O(links + nodes)
double passive_operations(const Program& program);

// Returns the number of packs that the voices fill.
double packs_of(const Workload& load);
inline double bytes_of_number(const Workload& load) {
  return load.is_double ? 8.0 : 4.0;
}

// Return the cache lines per sweep over so many bytes that miss a first-level cache of 48 kB, and a
// second-level cache of 2 MB.
double lines_of(double bytes);
double far_lines_of(double bytes);

// Returns an upper bound on the steps of one voice per sample, with the most iterations for every
// iterative solution. It shows which networks are too large to try. O(runs)
double worst_steps(const Program& program);

// Return the bytes of one voice: its nodes and coefficients alone, with one number per link if all
// voices share the link tables, and with a table of its own for links that are stepped one by one.
std::uint64_t node_bytes(const Program& program, std::uint64_t number_bytes);
std::uint64_t bytes_with_shared_links(const Program& program, std::uint64_t number_bytes);
std::uint64_t bytes_with_own_links(const Program& program, std::size_t links,
                                   std::uint64_t number_bytes);

// "1 link", "2 links"
std::string count_of(std::size_t count, const char* one, const char* many);

}  // namespace ressort::kernels
