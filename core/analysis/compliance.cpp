#include "core/analysis/compliance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/analysis/definite.h"
#include "core/analysis/places.h"

namespace ressort {
namespace {

constexpr std::uint32_t held = std::numeric_limits<std::uint32_t>::max();

// Which rows hang on something that does not move, by union-find.
class Anchors {
 public:
  explicit Anchors(const Assembly& assembly) : parent_(assembly.masses.size() + 1) {
    std::iota(parent_.begin(), parent_.end(), 0u);
  }
  // The last one stands for all that does not move.
  void join(std::span<const Assembly::Entry> entries) {
    double sum = 0.0;
    for (const Assembly::Entry& entry : entries) {
      sum += entry.share;
      parent_[find(entry.row)] = find(entries[0].row);
    }
    if (!entries.empty() && std::fabs(sum) > 1e-9) {
      parent_[find(entries[0].row)] = find(ground());
    }
  }
  bool holds(std::uint32_t row) { return find(row) == find(ground()); }

 private:
  std::uint32_t ground() const { return static_cast<std::uint32_t>(parent_.size()) - 1; }
  std::uint32_t find(std::uint32_t i) {
    while (parent_[i] != i) {
      i = parent_[i] = parent_[parent_[i]];
    }
    return i;
  }

  std::vector<std::uint32_t> parent_;
};

}  // namespace

std::optional<std::vector<double>> compliances(const Network& network, const ParameterBox& box,
                                               double rate_ratio,
                                               std::span<const std::uint32_t> masses,
                                               const Progress& progress) {
  const auto moving = std::count_if(network.masses.begin(), network.masses.end(),
                                    [](const Mass& mass) { return moves(mass); });
  if (static_cast<std::size_t>(moving) > most_compliant_masses) {
    return std::nullopt;
  }
  const Assembly assembly = assemble(network);
  if (!assembly.is_complete) {
    return std::nullopt;
  }
  const std::vector<Range> arguments = argument_ranges(network, box);
  Anchors anchors(assembly);
  std::vector<double> weights;
  for (const Assembly::Term& term : assembly.terms) {
    const double stiff = lowest_load(network, term, arguments, rate_ratio).stiff;
    if (!(stiff >= 0.0)) {
      return std::nullopt;
    }
    if (stiff > 0.0) {
      anchors.join(assembly.of(term));
    }
    weights.push_back(-stiff);
  }
  // What drifts is given a hold of its own, which touches nobody else.
  std::vector<double> diagonal(assembly.masses.size());
  std::vector<std::uint32_t> row_of(network.masses.size(), held);
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
        if (const std::uint32_t row = row_of[at]; row != held) {
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

}  // namespace ressort
