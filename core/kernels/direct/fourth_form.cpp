#include "core/kernels/direct/fourth_form.h"
#include "core/laws/laws.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/kernels/direct/direct_form.h"

namespace ressort::kernels {
namespace {

// What a link weighs: so much of its stiffness, and so much of its damping.
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

  // The edge bound: the largest d_a/m_a + d_b/m_b over the links, and d_a/m_a over the masses that
  // hold themselves; d is the sum of the weights at a mass.
  double operator()(const Weighing& weighing) const {
    std::vector<double> sum(program_.position.size(), 0.0);
    std::map<std::uint32_t, double> at_macro;  // by its first place in tap_nodes
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

  // All that a point of this macro may be between.
  template <class Use>
  void each_node(std::uint32_t first, Use&& use) const {
    const auto tap = std::find_if(program_.taps.begin(), program_.taps.end(),
                                  [&](const TapSlot& slot) { return slot.first == first; });
    for (std::uint32_t i = first; i < first + tap->length * tap->width; ++i) {
      use(program_.tap_nodes[i]);
    }
  }

  // What always pulls.
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

bool touches_point(const Program& program, Ends ends) {
  return !program.taps.empty() && std::max(ends.a, ends.b) >= program.taps[0].node;
}

void add(std::vector<FourthLinks>& all, std::uint32_t run, std::uint32_t link) {
  if (!all.empty() && all.back().run == run && all.back().first + all.back().count == link) {
    ++all.back().count;
  } else {
    all.push_back({run, link, 1});
  }
}

}  // namespace

Steepness steepness_of(const Program& program) {
  return steepness_of(program, program.parameters);
}

Steepness steepness_of(const Program& program, std::span<const double> parameters) {
  const Bounder bound(program, parameters);
  return {.stiffness = bound({1.0, 0.0}), .damping = bound({0.0, 1.0}), .both = bound({1.0, 6.0})};
}

std::optional<Fourth> fourth_form(const Program& program) {
  const auto is_force = [](const OutputSlot& output) { return output.is_force; };
  if (program.moving == 0 || !program.modes.empty() ||
      (!program.taps.empty() &&
       std::any_of(program.outputs.begin(), program.outputs.end(), is_force)) ||
      !is_plain(program) || !(steepness_of(program).both < 12.0)) {
    return std::nullopt;
  }
  Fourth form;
  for (std::uint32_t run = 0; run < program.link_runs.size(); ++run) {
    const LinkRun& links = program.link_runs[run];
    for (std::uint32_t i = links.first; i < links.first + links.count; ++i) {
      const bool is_spring = links.law == Law::spring && !touches_point(program, program.ends[i]);
      add(is_spring ? form.springs : form.others, run, i);
    }
  }
  return form;
}

// Twice through the springs, and two loops over the masses.
double predicted_ns(const Program& program, const Fourth&, const Workload& load) {
  return 2.5 * cost(work(program, Direct{}, load), load);
}

std::string description(const Program& program, const Fourth& form) {
  std::size_t springs = 0;
  for (const FourthLinks& links : form.springs) {
    springs += links.count;
  }
  return "to fourth order, springs and dampers twice, " +
         count_of(program.ends.size() - springs, "link", "links") + " as published";
}

std::uint64_t voice_bytes(const Program& program, const Fourth&, std::uint64_t number_bytes) {
  return bytes_with_own_links(program, program.ends.size(), number_bytes);
}

}  // namespace ressort::kernels
