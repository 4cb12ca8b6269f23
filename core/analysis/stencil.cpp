#include "core/analysis/stencil.h"

#include <algorithm>
#include <cmath>

#include "core/analysis/places.h"

namespace ressort {
namespace {

constexpr std::uint32_t held = 0xffffffffu;
constexpr std::uint64_t most_wandering = 4'000'000;  // terms

class StencilMaker {
 public:
  explicit StencilMaker(const Network& network)
      : network_(network), row_(network.masses.size(), held) {}

  Stencil make() {
    for (std::uint32_t i = 0; i < network_.masses.size(); ++i) {
      if (moves(network_.masses[i])) {
        row_[i] = static_cast<std::uint32_t>(out_.masses.size());
        out_.masses.push_back(i);
      }
    }
    for (const std::uint32_t i : out_.masses) {
      if (network_.masses[i].kind == MassKind::oscillator) {
        add(row_[i], 1.0);
        close(i, false);
      }
    }
    std::uint64_t wandering = 0;
    for (const Link& link : network_.links) {
      wandering += link.a == link.b ? 0 : nodes_under(link.a) + nodes_under(link.b);
    }
    out_.is_complete = wandering <= most_wandering;
    for (std::uint32_t i = 0; i < network_.links.size() && out_.is_complete; ++i) {
      if (network_.links[i].a != network_.links[i].b) {
        place(i);
      }
    }
    return std::move(out_);
  }

 private:
  void place(std::uint32_t index) {
    const Link& link = network_.links[index];
    if (!is_live_place(network_, link.a) && !is_live_place(network_, link.b)) {
      add_end(link.a, 1.0);
      add_end(link.b, -1.0);
      close(index, true);
      return;
    }
    // The square of an average is at most the average of squares, and (p - q)^2 <= 2 p^2 + 2 q^2.
    const double scale = is_held(link.a) || is_held(link.b) ? 1.0 : 2.0;
    for (const std::uint32_t end : {link.a, link.b}) {
      if (!is_live_place(network_, end)) {
        add_end(end, 1.0);
        close(index, true, scale);
        continue;
      }
      const Tap& tap = network_.taps[network_.masses[end].tap];
      for (std::uint32_t node = tap.first; node < tap.first + tap.length * tap.width; ++node) {
        add_end(node, 1.0);
        close(index, true, scale);
      }
    }
  }

  // How many terms an end at a place that moves takes.
  std::uint64_t nodes_under(std::uint32_t mass) const {
    if (!is_live_place(network_, mass)) {
      return 0;
    }
    const Tap& tap = network_.taps[network_.masses[mass].tap];
    return std::uint64_t{tap.length} * tap.width;
  }

  bool is_held(std::uint32_t mass) const {
    return network_.masses[mass].kind != MassKind::point && row_[mass] == held;
  }

  void add_end(std::uint32_t mass, double share) {
    each_share(network_, mass,
               [&](std::uint32_t node, double part) { add(row_[node], share * part); });
  }

  void add(std::uint32_t row, double share) {
    if (row == held) {
      return;
    }
    for (std::size_t i = first_; i < out_.entries.size(); ++i) {
      if (out_.entries[i].row == row) {
        out_.entries[i].share += share;
        return;
      }
    }
    out_.entries.push_back({row, share});
  }

  // Ends the term that the entries since the last one are.
  void close(std::uint32_t element, bool is_link, double wandering = 0.0) {
    const std::size_t count = out_.entries.size() - first_;
    if (count > 0) {
      out_.terms.push_back({.first = static_cast<std::uint32_t>(first_),
                            .count = static_cast<std::uint32_t>(count),
                            .element = element,
                            .is_link = is_link,
                            .wanders = wandering > 0.0,
                            .scale = wandering > 0.0 ? wandering : 1.0});
    }
    first_ = out_.entries.size();
  }

  const Network& network_;
  Stencil out_;
  std::vector<std::uint32_t> row_;  // [mass of the network]
  std::size_t first_ = 0;           // of the entries of the term at hand
};

}  // namespace

Stencil make_stencil(const Network& network) {
  return StencilMaker(network).make();
}

std::vector<Range> argument_ranges(const Network& network, const ParameterBox& box) {
  std::vector<Range> ranges;
  ranges.reserve(network.arguments.size());
  for (const Formula& formula : network.arguments) {
    ranges.push_back(formula_range(formula, box));
  }
  return ranges;
}

Range range_at(std::span<const Range> arguments, ArgumentId argument) {
  return argument == no_argument ? Range{} : arguments[argument];
}

Load highest_load(const Network& network, const Stencil::Term& term,
                  std::span<const Range> arguments, double rate_ratio) {
  const double r = rate_ratio;
  const auto highest = [&](ArgumentId id) {
    return term.scale * std::max(0.0, range_at(arguments, id).highest);
  };
  if (!term.is_link) {
    const Mass& mass = network.masses[term.element];
    return {.stiff = highest(mass.stiffness) * r * r, .damped = 2.0 * highest(mass.damping) * r};
  }
  const Link& link = network.links[term.element];
  const auto value = [&](std::size_t i) { return highest(link.arguments[i]); };
  switch (link.kind) {
    case LinkKind::spring:
    case LinkKind::contact:
      return {.stiff = value(0) * r * r, .damped = 2.0 * value(1) * r};
    case LinkKind::quadratic_spring:
    case LinkKind::cubic_spring:
      return {.stiff = value(0) * r * r, .damped = 2.0 * value(2) * r};
    case LinkKind::clipped_spring: {  // beyond its bend it is damped by 0.3 k more
      const double k = std::max(value(0), value(2));
      return {.stiff = 1.6 * k * r * r, .damped = 2.0 * value(3) * r};
    }
    case LinkKind::clipped_contact: {
      const double k = std::max(value(0), value(2));
      return {.stiff = k * r * r, .damped = 2.0 * value(3) * r};
    }
    case LinkKind::pluck: {  // it pulls beyond its top; a negative one pulls below it
      const double below = -0.9 * term.scale * range_at(arguments, link.arguments[0]).lowest;
      return {.stiff = std::max(0.1 * value(0), below) * r * r, .damped = 2.0 * value(2) * r};
    }
    case LinkKind::bow:
      return {.rubbed = 2.0 * value(0) * r * 2.0 / 3.0};
    case LinkKind::smooth_bow:
    case LinkKind::either_bow:  // the smooth one is the steeper
      return {.rubbed = 2.0 * value(0) * r * 1.0387};
  }
  return {};
}

Load lowest_load(const Network& network, const Stencil::Term& term,
                 std::span<const Range> arguments, double rate_ratio) {
  const double r = rate_ratio;
  const auto load = [&](ArgumentId k, ArgumentId z, bool is_always_felt) {
    const double most = is_always_felt && !term.wanders ? HUGE_VAL : 0.0;
    return Load{.stiff = term.scale * std::min(most, range_at(arguments, k).lowest) * r * r,
                .damped = 2.0 * term.scale * std::min(most, range_at(arguments, z).lowest) * r};
  };
  if (!term.is_link) {
    const Mass& mass = network.masses[term.element];
    return load(mass.stiffness, mass.damping, true);
  }
  const Link& link = network.links[term.element];
  const auto& value = link.arguments;
  switch (link.kind) {
    case LinkKind::spring:
      return load(value[0], value[1], true);
    case LinkKind::quadratic_spring:
    case LinkKind::cubic_spring:
      return load(value[0], value[2], true);
    case LinkKind::clipped_spring:
    case LinkKind::clipped_contact:
      return load(value[2], value[3], false);
    case LinkKind::pluck:
      return load(no_argument, value[2], false);
    case LinkKind::contact:
      return load(value[0], value[1], false);
    case LinkKind::bow:
    case LinkKind::smooth_bow:
    case LinkKind::either_bow:
      return load(no_argument, value[0], false);
  }
  return {};
}

}  // namespace ressort
