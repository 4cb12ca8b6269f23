#include "core/analysis/modes/morph_decay.h"

#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "core/analysis/linear.h"
#include "core/laws/law.h"
#include "core/model/topology.h"

namespace ressort::analysis {
namespace {

constexpr std::size_t chebyshev_count = 9;  // Chebyshev nodes between two stops.
constexpr double even_enough = 1e-4;        // Relative deviation of a T60 that needs no correction.
using Nodes = std::array<double, chebyshev_count>;

// Chebyshev nodes keep the interpolating polynomial from oscillating between them.
Nodes make_nodes() {
  Nodes nodes{};
  for (std::size_t i = 0; i < chebyshev_count; ++i) {
    const double angle =
        std::numbers::pi * (2.0 * static_cast<double>(i) + 1.0) / (2.0 * chebyshev_count);
    nodes[i] = 0.5 * (1.0 - std::cos(angle));
  }
  return nodes;
}

// Returns the coefficients of Newton's form: c0 + (x - x0) (c1 + (x - x1) (c2 + ...)).
Nodes divided_differences(const Nodes& x, Nodes y) {
  for (std::size_t order = 1; order < chebyshev_count; ++order) {
    for (std::size_t i = chebyshev_count - 1; i >= order; --i) {
      y[i] = (y[i] - y[i - 1]) / (x[i] - x[i - order]);
    }
  }
  return y;
}

void push(Formula& formula, std::initializer_list<Step> steps) {
  formula.insert(formula.end(), steps);
}

class DecayEvener {
 public:
  DecayEvener(const Network& network, const MorphedDecay& morph)
      : morph_(morph),
        expanded_(expand_macros(network, morph.progress)),
        values_(morph.values.begin(), morph.values.end()) {}

  // Returns the factor on dampers; empty if none is needed.
  std::optional<Formula> factor() {
    const Nodes nodes = make_nodes();
    Formula sum = {{Op::number, 0, 0.0}};
    bool is_needed = false;
    std::optional<double> before = log_damping(1.0);
    for (std::size_t leg = 1; leg < morph_.stops; ++leg) {
      const std::optional<double> after = log_damping(static_cast<double>(leg + 1));
      Nodes missing{};
      for (std::size_t i = 0; i < chebyshev_count; ++i) {
        const double w = nodes[i];
        const auto here = log_damping(static_cast<double>(leg) + w);
        if (!before || !after || !here) {
          return std::nullopt;
        }
        const double more = *before + w * (*after - *before) - *here;
        is_needed |= std::fabs(more) > even_enough;
        missing[i] = more / (w * (1.0 - w));
      }
      add_leg(sum, leg, nodes, divided_differences(nodes, missing));
      before = after;
    }
    sum.push_back({Op::exp});
    return is_needed ? std::optional(std::move(sum)) : std::nullopt;
  }

 private:
  // Returns the logarithm of the mode's damping, which is proportional to 1/T60.
  std::optional<double> log_damping(double position) {
    values_[morph_.parameter] = position;
    const auto shapes = lowest_shapes(expanded_, values_, morph_.progress);
    return shapes && shapes->mode.damping > 0.0 ? std::optional(std::log(shapes->mode.damping))
                                                : std::nullopt;
  }

  // Adds w (1 - w) times the polynomial, where w is the position on the leg.
  void add_leg(Formula& sum, std::size_t leg, const Nodes& nodes, const Nodes& coefficients) const {
    const auto push_way = [&](Formula& formula) {
      push(formula, {{Op::parameter, static_cast<std::uint32_t>(morph_.parameter)},
                     {Op::number, 0, static_cast<double>(leg)},
                     {Op::subtract},
                     {Op::number, 0, 0.0},
                     {Op::number, 0, 1.0},
                     {Op::clamp}});
    };
    push(sum, {{Op::number, 0, coefficients[chebyshev_count - 1]}});
    for (std::size_t i = chebyshev_count - 1; i-- > 0;) {
      push_way(sum);
      push(sum, {{Op::number, 0, nodes[i]},
                 {Op::subtract},
                 {Op::multiply},
                 {Op::number, 0, coefficients[i]},
                 {Op::add}});
    }
    push_way(sum);
    push(sum, {{Op::multiply}, {Op::number, 0, 1.0}});
    push_way(sum);
    push(sum, {{Op::subtract}, {Op::multiply}, {Op::add}});
  }

  const MorphedDecay& morph_;
  const Network expanded_;
  std::vector<double> values_;
};

}  // namespace

Network with_even_decay(Network network, const MorphedDecay& morph) {
  const auto factor = DecayEvener(network, morph).factor();
  if (!factor) {
    return network;
  }
  const auto damp = [&](ArgumentId& id) {
    if (id != no_argument) {
      Formula formula = network.arguments[id];
      formula.insert(formula.end(), factor->begin(), factor->end());
      formula.push_back({Op::multiply});
      id = network.add(std::move(formula));
    }
  };
  for (Mass& mass : network.masses) {
    damp(mass.damping);
  }
  for (Macro& macro : network.macros) {
    damp(macro.damping);
    damp(macro.air_damping);
  }
  for (Link& link : network.links) {
    const LawFacts& law = facts_of(link.law);
    if (law.is_spring()) {
      damp(link.arguments[law.slot(Role::damping)]);
    }
  }
  return canonical(std::move(network));
}

}  // namespace ressort::analysis
