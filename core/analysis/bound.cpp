// The edge bound on the stiffness factor: linear in time and memory whatever the network.
#include <algorithm>
#include <map>

#include "core/analysis/assembly.h"
#include "core/analysis/places.h"
#include "core/analysis/stability.h"

namespace ressort {
namespace {

// 4 is the limit; a little below it modes near the Nyquist frequency still decay.
constexpr double limit = 4.0 * 0.98;

// What of d_i/m_i grows with the factor, and what does not. Friction grows with its root; with the
// factor itself it is on the safe side above 1.
struct Sum {
  double stiff = 0.0;
  double damped = 0.0;
  void add(const Sum& other, double share) {
    stiff += share * other.stiff;
    damped += share * other.damped;
  }
};

class Bound {
 public:
  Bound(const Network& network, const ParameterBox& box, double rate_ratio)
      : network_(network),
        arguments_(argument_ranges(network, box)),
        rate_ratio_(rate_ratio),
        sums_(network.masses.size()) {}

  double factor() {
    for (std::uint32_t i = 0; i < network_.masses.size(); ++i) {
      if (network_.masses[i].kind == MassKind::oscillator) {
        sums_[i].add(load({.element = i, .is_link = false}), 1.0);
      }
    }
    for (std::uint32_t i = 0; i < network_.links.size(); ++i) {
      const Sum link = load({.element = i});
      add(network_.links[i].a, link);
      add(network_.links[i].b, link);
    }
    settle_live_places();
    divide_by_masses();
    for (const Sum& sum : sums_) {
      bound(sum);
    }
    for (const Link& link : network_.links) {
      Sum both = at(link.a);
      both.add(at(link.b), 1.0);
      bound(both);
    }
    return factor_;
  }

 private:
  Sum load(const Assembly::Term& term) const {
    const Load load = highest_load(network_, term, arguments_, rate_ratio_);
    return {load.stiff + load.rubbed, load.damped};
  }

  void add(std::uint32_t end, const Sum& link) {
    if (is_live_place(network_, end)) {
      live_[network_.masses[end].tap].add(link, 1.0);
      return;
    }
    each_share(network_, end,
               [&](std::uint32_t mass, double share) { sums_[mass].add(link, share); });
  }

  // What holds on to a live place may hold on to any of its nodes, all of one macro's at once.
  void settle_live_places() {
    std::map<std::uint32_t, Sum> macros;  // by their first node
    for (const auto& [tap, sum] : live_) {
      macros[network_.taps[tap].first].add(sum, 1.0);
      size_[network_.taps[tap].first] = network_.taps[tap].length * network_.taps[tap].width;
    }
    for (const auto& [first, sum] : macros) {
      for (std::uint32_t node = first; node < first + size_[first]; ++node) {
        sums_[node].add(sum, 1.0);
      }
    }
  }

  void divide_by_masses() {
    for (std::size_t i = 0; i < sums_.size(); ++i) {
      const Mass& mass = network_.masses[i];
      const bool is_moving = moves(mass);
      const double m = range_at(arguments_, mass.mass).lowest;
      const double inverse = is_moving ? 1.0 / std::max(1e-30, m) : 0.0;
      sums_[i] = {sums_[i].stiff * inverse, sums_[i].damped * inverse};
    }
    for (const auto& [first, size] : size_) {
      Sum& worst = worst_[first];
      for (std::uint32_t node = first; node < first + size; ++node) {
        worst.stiff = std::max(worst.stiff, sums_[node].stiff);
        worst.damped = std::max(worst.damped, sums_[node].damped);
      }
    }
  }

  Sum at(std::uint32_t end) const {
    if (is_live_place(network_, end)) {
      return worst_.at(network_.taps[network_.masses[end].tap].first);
    }
    Sum sum;
    each_share(network_, end,
               [&](std::uint32_t mass, double share) { sum.add(sums_[mass], share); });
    return sum;
  }

  void bound(const Sum& sum) {
    if (sum.stiff > 0.0) {
      factor_ = std::min(factor_, (limit - sum.damped) / sum.stiff);
    } else if (sum.damped > limit) {
      factor_ = 0.0;
    }
  }

  const Network& network_;
  std::vector<Range> arguments_;
  double rate_ratio_;
  std::vector<Sum> sums_;                        // [mass] d_i, then d_i/m_i
  std::map<std::uint32_t, Sum> live_;            // by tap
  std::map<std::uint32_t, std::uint32_t> size_;  // nodes, by a macro's first one
  std::map<std::uint32_t, Sum> worst_;           // by the same
  double factor_ = most_bounded;
};

}  // namespace

double highest_stiffness_factor(const Network& network, const ParameterBox& box,
                                double rate_ratio) {
  return Bound(network, box, rate_ratio).factor();
}

}  // namespace ressort
