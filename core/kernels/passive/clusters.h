// core/kernels: passive links that share masses, as tables for solving them at once. Made when a
// model is loaded; nothing of it changes while it sounds.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/kernels/program.h"

namespace ressort::kernels {

inline constexpr std::uint32_t no_mass = 0xffffffffu;
inline constexpr std::size_t passive_rows = 3;    // of memory for each link, one number a lane
inline constexpr std::size_t joint_numbers = 13;  // of a link while it is solved: Joined in joint.h

// Of places while they are solved: Places in joint_places.h.
constexpr std::size_t place_numbers(std::size_t places) {
  return 4 * places * places + 2 * places;
}

struct PassiveLink {
  Law law{};
  std::array<std::uint32_t, most_law_arguments> coefficients{};
  Ends ends;  // nodes; a kernel puts its own places instead
  Zone zone = Zone::everywhere;
  std::uint32_t reach = 0;  // the coefficient that says how large it is, of near and below
  // Ends of its cluster, where that is solved by what it holds; or no_mass.
  std::uint32_t mass_a = no_mass;
  std::uint32_t mass_b = no_mass;
  std::uint32_t entry = no_mass;  // where both meet in the matrix
};

// How a symmetric matrix over a cluster's ends is factorised, L D L^T, as far as they are masses,
// without looking for anything: its numbers are the diagonal, then the entries below it, column by
// column, fill-in and all.
struct Elimination {
  std::vector<std::uint32_t> first;   // [end + 1] of its column's entries
  std::vector<std::uint32_t> row;     // [entry] end
  std::vector<std::uint32_t> target;  // the number that each product is taken from, in order
};

// Links that move each other, and no others.
struct Cluster {
  std::uint32_t first = 0;  // links
  std::uint32_t count = 0;
  // What its links hold, its ends: masses in the order of elimination, if they have a factor, and
  // then places on macros. A force on one of those moves the others, by shares that change. None:
  // it is solved by its links, which are fewer than the places.
  std::vector<std::uint32_t> inverse_mass;  // [mass] coefficient
  std::vector<std::uint32_t> places;        // [place] node
  Elimination elimination;

  std::size_t numbers() const;  // that solving it needs in each lane
  std::size_t ends() const { return inverse_mass.size() + places.size(); }
  bool has_factor() const { return !elimination.first.empty(); }
  // Whether that takes so much longer than the links that it is mostly gone without.
  bool is_large() const {
    return !has_factor() || elimination.target.size() > 16 * (count + std::size_t{32});
  }
};

// Springs that bend, so many that what they hold together is kept in one number. All other passive
// links are then one cluster, solved by its links, as each moves whatever the springs hold.
struct Web {
  std::uint32_t first = 0;                  // links; their mass_a and mass_b are ends of the web
  std::uint32_t count = 0;                  // 0: there is none
  std::vector<std::uint32_t> alike;         // how many links in a row share law and coefficients
  std::vector<std::uint32_t> inverse_mass;  // [end] coefficient; no_mass: it stays
  std::vector<std::uint32_t> of;            // [end] twice a link that holds it, + 1 if as its b

  std::size_t numbers() const { return 3 * inverse_mass.size(); }  // in each lane
};

struct PassiveTables {
  std::vector<PassiveLink> links;  // first those that share nothing, then cluster by cluster, web
  std::size_t alone = 0;           // so many of them
  std::vector<Cluster> clusters;
  Web web;
};

// How many springs a web would have; 0: they are solved. In double precision a spring takes some
// 90 ns a sample to solve, and 5 in a web.
std::size_t springs_of_web(const Program& program);

// O(links + fill-in of the clusters)
PassiveTables passive_tables(const Program& program);

// Whether any link that is not plain holds a place on a macro.
bool holds_places(const Program& program);

// [moving node] the coefficient 1/M.
std::vector<std::uint32_t> inverse_masses(const Program& program);

}  // namespace ressort::kernels
