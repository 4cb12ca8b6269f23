#include "core/analysis/compliance.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/analysis/definite.h"
#include "core/analysis/places.h"
#include "core/groups.h"

namespace ressort::analysis {
namespace {

// Finds the rows that are connected to something that does not move.
class Anchors {
 public:
  explicit Anchors(const Assembly& assembly)
      : rows_(assembly.masses.size() + 1),
        ground_(static_cast<std::uint32_t>(assembly.masses.size())) {}
  void join(std::span<const Assembly::Entry> entries) {
    double sum = 0.0;
    for (const Assembly::Entry& entry : entries) {
      sum += entry.share;
      rows_.join(entry.row, entries[0].row);
    }
    if (!entries.empty() && std::fabs(sum) > 1e-9) {
      rows_.join(entries[0].row, ground_);
    }
  }
  bool holds(std::uint32_t row) { return rows_.find(row) == rows_.find(ground_); }

 private:
  Groups rows_;
  std::uint32_t ground_;  // Stands for everything that does not move.
};

// Returns the network without links that can detach, since these hold no mass at rest. Many of them
// may be at one moving place, each with a term at every node under it. Links whose stiffness can be
// negative stay, and the caller then reports that no compliance is known.
Network always_touching(const Network& network, std::span<const Range> arguments,
                        double rate_ratio) {
  Network felt = network;
  felt.links.clear();
  for (std::uint32_t i = 0; i < network.links.size(); ++i) {
    const Assembly::Term term{.element = i, .is_link = true};
    if (!facts_of(network.links[i].law).can_detach() ||
        !(lowest_load(network, term, arguments, rate_ratio).stiff >= 0.0)) {
      felt.links.push_back(network.links[i]);
    }
  }
  return felt;
}

}  // namespace

std::optional<std::vector<double>> compliances(const Network& network, const ParameterBox& box,
                                               double rate_ratio,
                                               std::span<const std::uint32_t> masses,
                                               const Progress& progress) {
  const auto moving =
      std::ranges::count_if(network.masses, [](const Mass& mass) { return moves(mass); });
  if (static_cast<std::size_t>(moving) > most_compliant_masses) {
    return std::nullopt;
  }
  const std::vector<Range> arguments = argument_ranges(network, box);
  const Network felt = always_touching(network, arguments, rate_ratio);
  const Assembly assembly = assemble(felt);
  if (!assembly.is_complete) {
    return std::nullopt;
  }
  Anchors anchors(assembly);
  std::vector<double> weights;
  for (const Assembly::Term& term : assembly.terms) {
    const double stiff = lowest_load(felt, term, arguments, rate_ratio).stiff;
    if (!(stiff >= 0.0)) {
      return std::nullopt;
    }
    if (stiff > 0.0) {
      anchors.join(assembly.of(term));
    }
    weights.push_back(-stiff);
  }
  // A drifting part gets a separate unit stiffness, so that the matrix can be factored.
  std::vector<double> diagonal(assembly.masses.size());
  std::vector<std::uint32_t> row_of(network.masses.size(), held_row);
  for (std::uint32_t row = 0; row < diagonal.size(); ++row) {
    diagonal[row] = anchors.holds(row) ? 0.0 : 1.0;
    row_of[assembly.masses[row]] = row;
  }
  Definite matrix(assembly, progress);
  if (!matrix.is_feasible() || !matrix.factor(diagonal, weights)) {
    return std::nullopt;
  }
  std::vector<double> found;
  for (const std::uint32_t mass : masses) {
    progress.spend(2 * diagonal.size());
    std::vector<double> push(diagonal.size());
    bool is_held = !is_live_place(network, mass);
    if (is_held) {
      each_share(network, mass, [&](std::uint32_t at, double share) {
        if (const std::uint32_t row = row_of[at]; row != held_row) {
          push[row] += share;
          is_held = is_held && diagonal[row] == 0.0;
        }
      });
    }
    std::vector<double> moved = push;
    matrix.solve(moved);
    found.push_back(is_held ? std::inner_product(push.begin(), push.end(), moved.begin(), 0.0)
                            : std::numeric_limits<double>::infinity());
  }
  return found;
}

}  // namespace ressort::analysis
