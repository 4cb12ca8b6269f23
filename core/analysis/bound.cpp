// The edge bound on the stiffness factor, computed in linear time and memory for every network.
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/analysis/assembly.h"
#include "core/analysis/places.h"
#include "core/analysis/stability.h"

namespace ressort::analysis {
namespace {

// The stability limit is 4; at slightly less, modes near the Nyquist frequency still decay.
constexpr double limit = 4.0 * 0.98;

// The parts of d_i/m_i that scale with the factor, and the constant rest. Bow friction scales with
// the square root of the factor; scaling it with the factor itself is conservative above 1.
struct Sum {
  double stiff = 0.0;
  double damped = 0.0;
  void add(const Sum& other, double share) {
    stiff += share * other.stiff;
    damped += share * other.damped;
  }
};

class NetworkBound {
 public:
  NetworkBound(const Network& network, const ParameterBox& box, double rate_ratio)
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
      const auto [a, b] = std::pair(network_.links[i].a, network_.links[i].b);
      const double way = std::max({1.0, way_of(a), way_of(b)});
      Sum link;
      link.add(load({.element = i}), way * way);
      add(a, link);
      add(b, link);
    }
    bound_live_places();
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
    const double way = std::max(way_of(end), 1e-300);
    each_share(network_, end, [&](std::uint32_t mass, double share) {
      sums_[mass].add(link, std::fabs(share) / way);
    });
  }

  // Returns the displacement of a place when no node around it moves farther than 1. On a body the
  // displacement may exceed 1. A link at such a place counts as a link at a node, scaled by that
  // displacement.
  double way_of(std::uint32_t end) const {
    const Mass& mass = network_.masses[end];
    if (mass.kind != MassKind::point || network_.taps[mass.tap].places == 0) {
      return 1.0;
    }
    const Tap& tap = network_.taps[mass.tap];
    double most = 0.0;
    for (std::uint32_t place = 0; place < tap.places; ++place) {
      double sum = 0.0;
      for (const double displacement : shape_at(network_, tap, place)) {
        sum += std::fabs(displacement);
      }
      most = std::max(most, sum);
    }
    return most;
  }

  // A link at a live place may hold any node of the macro, and all such links may hold the same
  // node.
  void bound_live_places() {
    std::map<std::uint32_t, Sum> macros;  // Keyed by first node.
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
    const double way = std::max(way_of(end), 1e-300);
    each_share(network_, end, [&](std::uint32_t mass, double share) {
      sum.add(sums_[mass], std::fabs(share) / way);
    });
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
  std::vector<Sum> sums_;              // [mass] d_i, later d_i/m_i.
  std::map<std::uint32_t, Sum> live_;  // Keyed by tap.
  // Number of nodes, keyed by the macro's first node.
  std::map<std::uint32_t, std::uint32_t> size_;
  std::map<std::uint32_t, Sum> worst_;  // Same key.
  double factor_ = most_bounded;
};

}  // namespace

double highest_stiffness_factor(const Network& network, const ParameterBox& box,
                                double rate_ratio) {
  return NetworkBound(network, box, rate_ratio).factor();
}

}  // namespace ressort::analysis
