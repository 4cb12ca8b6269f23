#include "core/compile/accuracy/steepness.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/laws/law.h"

namespace ressort::compile {
namespace {

// The weight of a link: a combination of its stiffness and its damping.
struct Weighing {
  double stiffness = 0.0;
  double damping = 0.0;
};

class Bounder {
 public:
  Bounder(const Program& program, std::span<const double> parameters) : program_(program) {
    for (const Coefficient& coefficient : program.coefficients) {
      value_.push_back(coefficient_value(program, coefficient, parameters, 1.0));
    }
  }

  // Returns the edge bound on the largest eigenvalue: the maximum of d_a/m_a + d_b/m_b over all
  // links and of d_a/m_a over all oscillators, where d is the sum of the weights at a mass.
  double operator()(const Weighing& weighing) const {
    std::vector<double> sum(program_.position.size(), 0.0);
    std::map<std::uint32_t, double> at_macro;  // keyed by its first place in tap_nodes
    each_link(weighing, [&](Ends ends, double weight) {
      for (const std::uint32_t end : {ends.a, ends.b}) {
        const TapSlot* const tap = tap_at(end);
        (tap == nullptr ? sum[end] : at_macro[tap->first]) += weight;
      }
    });
    for (const auto& [first, added] : at_macro) {
      const double weight = added;  // older compilers do not capture a binding
      each_node(first, [&](std::uint32_t node) { sum[node] += weight; });
    }
    double bound = 0.0;
    for (const MassRun& run : program_.mass_runs) {
      const double own =
          run.is_oscillator ? weight_of(weighing, value_[run.stiffness], value_[run.damping]) : 0.0;
      for (std::uint32_t node = run.first; node < run.first + run.count; ++node) {
        sum[node] = (sum[node] + own) * value_[run.inverse_mass];
        bound = own > 0.0 ? std::max(bound, sum[node]) : bound;
      }
    }
    std::fill(sum.begin() + program_.moving, sum.end(), 0.0);
    for (auto& [first, highest] : at_macro) {
      double most = 0.0;
      each_node(first, [&](std::uint32_t node) { most = std::max(most, sum[node]); });
      highest = most;
    }
    const auto most_at = [&](std::uint32_t end) {
      const TapSlot* const tap = tap_at(end);
      return tap == nullptr ? sum[end] : at_macro.at(tap->first);
    };
    each_link(weighing, [&](Ends ends, double weight) {
      bound = weight > 0.0 ? std::max(bound, most_at(ends.a) + most_at(ends.b)) : bound;
    });
    return bound;
  }

 private:
  static double weight_of(const Weighing& weighing, double stiffness, double damping) {
    return weighing.stiffness * std::max(0.0, stiffness) +
           weighing.damping * std::max(0.0, damping);
  }

  const TapSlot* tap_at(std::uint32_t end) const {
    return program_.taps.empty() || end < program_.taps[0].node
               ? nullptr
               : &program_.taps[end - program_.taps[0].node];
  }

  // Calls use(node) for every node of the macro whose first tap node is `first`.
  template <class Use>
  void each_node(std::uint32_t first, Use&& use) const {
    const auto tap = std::find_if(program_.taps.begin(), program_.taps.end(),
                                  [&](const TapSlot& slot) { return slot.first == first; });
    for (std::uint32_t i = first; i < first + tap->length * tap->width; ++i) {
      use(program_.tap_nodes[i]);
    }
  }

  // Calls use(ends, weight) for every link that contains a spring.
  template <class Use>
  void each_link(const Weighing& weighing, Use&& use) const {
    for (const LinkRun& run : program_.link_runs) {
      const LawFacts& law = facts_of(run.law);
      if (!law.contains_spring) {
        continue;
      }
      const double weight = weight_of(weighing, value_[run.coefficients[law.slot(Role::stiffness)]],
                                      value_[run.coefficients[law.slot(Role::damping)]]);
      for (std::uint32_t link = run.first; link < run.first + run.count; ++link) {
        use(program_.ends[link], weight);
      }
    }
  }

  const Program& program_;
  std::vector<double> value_;  // [coefficient]
};

}  // namespace

Steepness steepness_of(const Program& program, std::span<const double> parameters) {
  const Bounder bound(program, parameters);
  return {.stiffness = bound({1.0, 0.0}), .both = bound({1.0, 6.0})};
}

}  // namespace ressort::compile
