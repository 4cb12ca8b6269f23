// core/kernels: tables for solving passive links that share masses simultaneously. Made when a
// model is loaded; constant while it plays.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/kernels/program.h"

namespace ressort::kernels {

inline constexpr std::uint32_t no_mass = 0xffffffffu;
inline constexpr std::size_t passive_rows = 3;    // State of each link, in numbers per lane.
inline constexpr std::size_t joint_numbers = 13;  // Work memory of each link: Joined in joint.h.

// Work memory of places: Places in joint_places.h.
constexpr std::size_t place_numbers(std::size_t places) {
  return 4 * places * places + 2 * places;
}

struct PassiveLink {
  Law law{};
  std::array<std::uint32_t, most_law_arguments> coefficients{};
  Ends ends;  // Nodes; a kernel replaces them by its own places.
  Zone zone = Zone::everywhere;
  // Coefficient of the size of the zone, for laws that act only near or below it.
  std::uint32_t reach = 0;
  // Ends in its cluster, if that is solved by ends; else no_mass.
  std::uint32_t mass_a = no_mass;
  std::uint32_t mass_b = no_mass;
  std::uint32_t entry = no_mass;  // Matrix entry of both ends.
};

// The precomputed L D L^T factorisation of a symmetric matrix over the masses of a cluster: the
// numeric phase needs no search. Numbers are the diagonal, then the entries below it, column by
// column, including fill-in.
struct Elimination {
  std::vector<std::uint32_t> first;   // [end + 1] First entry of its column.
  std::vector<std::uint32_t> row;     // [entry] Its end.
  std::vector<std::uint32_t> target;  // The number from which each product is subtracted, in order.
};

// A connected component of passive links: they move each other and no others.
struct Cluster {
  std::uint32_t first = 0;  // Range of links.
  std::uint32_t count = 0;
  // The ends of its links: masses in elimination order, if they have a factor, then places on
  // macros. A force on one place moves the others with weights that change. Empty: the cluster is
  // solved by links, of which there are fewer than places.
  std::vector<std::uint32_t> inverse_mass;  // [mass] Coefficient.
  std::vector<std::uint32_t> places;        // [place] Node.
  Elimination elimination;

  std::size_t numbers() const;  // Returns the work memory in numbers per lane.
  std::size_t ends() const { return inverse_mass.size() + places.size(); }
  bool has_factor() const { return !elimination.first.empty(); }
  // Returns whether factoring costs so much more than the links that it is mostly avoided.
  bool is_large() const {
    return !has_factor() || elimination.target.size() > 16 * (count + std::size_t{32});
  }
};

// Nonlinear springs, so many that their potential is represented by one auxiliary variable (web.h).
// All other passive links then form one cluster, solved by links, because each of them moves the
// whole web.
struct Web {
  std::uint32_t first = 0;           // Range of links; their mass_a and mass_b are ends of the web.
  std::uint32_t count = 0;           // 0: no web.
  std::vector<std::uint32_t> alike;  // Lengths of runs of links with equal law and coefficients.
  std::vector<std::uint32_t> inverse_mass;  // [end] Coefficient; no_mass: it does not move.
  // [end] Twice the index of a link at it, + 1 if it is the link's end b.
  std::vector<std::uint32_t> of;

  std::size_t numbers() const { return 3 * inverse_mass.size(); }  // Numbers per lane.
};

struct PassiveTables {
  // Links that share no mass, then cluster by cluster, then the web.
  std::vector<PassiveLink> links;
  std::size_t alone = 0;  // Number of links that share no mass.
  std::vector<Cluster> clusters;
  Web web;
};

// Returns the number of springs in the web; 0: they are solved simultaneously instead. In double
// precision a spring costs about 90 ns per sample to solve, and 5 ns in a web.
std::size_t springs_of_web(const Program& program);

// Makes the tables. O(links + fill-in of the clusters)
PassiveTables passive_tables(const Program& program);

// Returns whether a passive link is attached to a place on a macro.
bool holds_places(const Program& program);

// Returns [moving node] the coefficient 1/M.
std::vector<std::uint32_t> inverse_masses(const Program& program);

}  // namespace ressort::kernels
