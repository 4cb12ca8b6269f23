// core/kernels: passive links that share masses, as tables for solving them at once. Made when a
// model is loaded; nothing of it changes while it sounds.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/kernels/program.h"

namespace ressort {

inline constexpr std::uint32_t no_mass = 0xffffffffu;
inline constexpr std::size_t joint_numbers = 13;  // of a link while it is solved: Joined in joint.h

struct PassiveLink {
  Law law{};
  std::array<std::uint32_t, most_law_arguments> coefficients{};
  Ends ends;  // nodes; a kernel puts its own places instead
  // Of its cluster, where that is solved by its masses; or no_mass.
  std::uint32_t mass_a = no_mass;
  std::uint32_t mass_b = no_mass;
  std::uint32_t entry = no_mass;  // where both meet in the matrix
};

// How a symmetric matrix over masses is factorised, L D L^T, without looking for anything: its
// numbers are the diagonal, then the entries below it, column by column, fill-in and all.
struct Elimination {
  std::vector<std::uint32_t> first;   // [mass + 1] of its column's entries
  std::vector<std::uint32_t> row;     // [entry] mass
  std::vector<std::uint32_t> target;  // the number that each product is taken from, in order
};

// Links that move each other, and no others.
struct Cluster {
  std::uint32_t first = 0;  // links
  std::uint32_t count = 0;
  // Of masses in the order of elimination, if they have a factor; none where it is solved by its
  // links, as places on macros move many masses by shares that change.
  std::vector<std::uint32_t> inverse_mass;  // coefficients
  Elimination elimination;

  std::size_t numbers() const;  // that solving it needs in each lane
  bool has_factor() const { return !elimination.first.empty(); }
  // Whether that takes so much longer than the links that it is mostly gone without.
  bool is_large() const {
    return !has_factor() || elimination.target.size() > 16 * (count + std::size_t{32});
  }
};

struct PassiveTables {
  std::vector<PassiveLink> links;  // first those that share nothing, then cluster by cluster
  std::size_t alone = 0;           // so many of them
  std::vector<Cluster> clusters;
};

// `by_links`: all links that are not plain as one cluster solved by its links.
// O(links + fill-in of the clusters)
PassiveTables passive_tables(const Program& program, bool by_links = false);

// Whether any link that is not plain holds a place on a macro.
bool holds_places(const Program& program);

// [moving node] the coefficient 1/M.
std::vector<std::uint32_t> inverse_masses(const Program& program);

}  // namespace ressort
