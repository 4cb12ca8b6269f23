#include "core/analysis/assembly.h"

#include <algorithm>
#include <cmath>

#include "core/analysis/places.h"
#include "core/sampled_mode.h"

namespace ressort::analysis {
namespace {

// Largest number of terms for places that move.
constexpr std::uint64_t most_wandering = 4'000'000;

class Assembler {
 public:
  explicit Assembler(const Network& network)
      : network_(network), row_(network.masses.size(), held_row) {}

  Assembly make() {
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
      const Link& link = network_.links[i];
      if (link.a == link.b) {
        continue;
      }
      if (is_junction(link.a) || is_junction(link.b)) {
        out_.terms.push_back(
            {.first = static_cast<std::uint32_t>(first_), .element = i, .is_passive = true});
      } else {
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
    // Bounds: the square of an average is at most the average of the squares, and (p - q)^2 <= 2
    // p^2 + 2 q^2.
    const double scale = is_held(link.a) || is_held(link.b) ? 1.0 : 2.0;
    for (const std::uint32_t end : {link.a, link.b}) {
      ++out_.wandering_ends;
      if (!is_live_place(network_, end)) {
        add_end(end, 1.0);
        close(index, true, scale, out_.wandering_ends);
        continue;
      }
      const Tap& tap = network_.taps[network_.masses[end].tap];
      for (std::uint32_t at = 0; at < terms_under(tap); ++at) {
        if (tap.places > 0) {
          add_shape(tap, at);
        } else {
          add_end(tap.first + at, 1.0);
        }
        close(index, true, scale, out_.wandering_ends);
      }
    }
  }

  // Returns the number of entries that an end at a moving place adds.
  std::uint64_t nodes_under(std::uint32_t mass) const {
    if (!is_live_place(network_, mass)) {
      return 0;
    }
    const Tap& tap = network_.taps[network_.masses[mass].tap];
    return std::uint64_t{tap.length} * (tap.places > 0 ? tap.places : tap.width);
  }

  // A moving place lies between nodes, or between the places of a body.
  static std::uint32_t terms_under(const Tap& tap) {
    return tap.places > 0 ? tap.places : tap.length * tap.width;
  }

  void add_shape(const Tap& tap, std::uint32_t place) {
    const auto shape = shape_at(network_, tap, place);
    for (std::uint32_t mode = 0; mode < tap.length; ++mode) {
      if (shape[mode] != 0.0) {
        add(row_[tap.first + mode], shape[mode]);
      }
    }
  }

  bool is_junction(std::uint32_t mass) const {
    return network_.masses[mass].kind == MassKind::junction;
  }

  bool is_held(std::uint32_t mass) const {
    return network_.masses[mass].kind != MassKind::point && row_[mass] == held_row;
  }

  void add_end(std::uint32_t mass, double share) {
    each_share(network_, mass,
               [&](std::uint32_t node, double part) { add(row_[node], share * part); });
  }

  void add(std::uint32_t row, double share) {
    if (row == held_row) {
      return;
    }
    if (entry_.size() <= row) {
      entry_.resize(row_.size(), held_row);
    }
    std::uint32_t& entry = entry_[row];
    if (entry != held_row && entry >= first_ && entry < out_.entries.size() &&
        out_.entries[entry].row == row) {
      out_.entries[entry].share += share;
      return;
    }
    entry = static_cast<std::uint32_t>(out_.entries.size());
    out_.entries.push_back({row, share});
  }

  // Makes one term of the entries since the last one.
  void close(std::uint32_t element, bool is_link, double scale = 1.0, std::uint32_t wanders = 0) {
    const std::size_t count = out_.entries.size() - first_;
    if (count > 0) {
      out_.terms.push_back({.first = static_cast<std::uint32_t>(first_),
                            .count = static_cast<std::uint32_t>(count),
                            .element = element,
                            .is_link = is_link,
                            .wanders = wanders,
                            .scale = scale});
    }
    first_ = out_.entries.size();
  }

  const Network& network_;
  Assembly out_;
  std::vector<std::uint32_t> row_;    // [mass of the network]
  std::vector<std::uint32_t> entry_;  // [row] Its last entry.
  std::size_t first_ = 0;             // First entry of the current term.
};

// Returns one end of each argument's range.
LawNumbers numbers(const Link& link, std::span<const Range> arguments, double Range::*end) {
  LawNumbers values{};
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = range_at(arguments, link.arguments[i]).*end;
  }
  return values;
}

// Returns the largest or smallest load of a body's mode, for its smallest mass. If a parameter
// changes the T60, it changes stiffness and damping together. The damping is sampled, and between
// two samples the load changes by at most its steepest slope.
Load load_of_mode(const Mass& mass, std::span<const Range> arguments, double rate_ratio,
                  bool is_highest) {
  constexpr int samples = 64;
  constexpr double steepest = 2.4;  // Steepest slope of 1 + r^2 - 2 r cos w over Z/M.
  const Range m = range_at(arguments, mass.mass);
  const Range stiffness = range_at(arguments, mass.stiffness);
  const Range damping = range_at(arguments, mass.damping);
  const double least = std::max(m.lowest, 1e-300);
  const double most = std::max(m.highest, least);
  // K and Z are proportional to M, so the bound is exact if M is a single number.
  const double r = rate_ratio;
  const double k = r * r * (is_highest ? stiffness.highest / least : stiffness.lowest / most);
  const double z_low = r * std::max(0.0, damping.lowest / most);
  const double z_high = r * std::max(0.0, damping.highest / least);
  const int count = z_high > z_low ? samples : 1;
  double pull = is_highest ? 0.0 : HUGE_VAL;
  for (int i = 0; i < count; ++i) {
    const double z = z_low + (z_high - z_low) * i / std::max(1, count - 1);
    const SampledMode sampled = sampled_mode(1.0, k, z);
    const double here = sampled.stiffness / sampled.mass;
    pull = is_highest ? std::max(pull, here) : std::min(pull, here);
  }
  const double margin = count > 1 ? steepest * 0.5 * (z_high - z_low) / (count - 1) : 0.0;
  const double rubbed = -std::expm1(-(is_highest ? z_high : z_low));
  return {.stiff = least * std::max(0.0, is_highest ? pull + margin : pull - margin),
          .damped = 2.0 * least * rubbed};
}

Load load_as_keys_have_it(const Network& network, const Assembly::Term& term,
                          std::span<const Range> arguments, double rate_ratio) {
  const double r = rate_ratio;
  if (!term.is_link && network.masses[term.element].is_mode) {
    return load_of_mode(network.masses[term.element], arguments, rate_ratio, true);
  }
  if (!term.is_link) {
    const Mass& mass = network.masses[term.element];
    const auto highest = [&](ArgumentId id) {
      return term.scale * std::max(0.0, range_at(arguments, id).highest);
    };
    return {.stiff = highest(mass.stiffness) * r * r, .damped = 2.0 * highest(mass.damping) * r};
  }
  const Link& link = network.links[term.element];
  const LawFacts& law = facts_of(link.law);
  constexpr double at_rest = 0.0;
  const Slopes slopes = steepest(link.law, numbers(link, arguments, &Range::lowest),
                                 numbers(link, arguments, &Range::highest), at_rest);
  const double damped = 2.0 * term.scale * slopes.damping * r;
  const bool is_friction = law.arguments[law.slot(Role::damping)].unit == Unit::friction;
  return {.stiff = term.scale * slopes.pull * r * r,
          .damped = is_friction ? 0.0 : damped,
          .rubbed = is_friction ? damped : 0.0};
}

}  // namespace

Assembly assemble(const Network& network) {
  return Assembler(network).make();
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

Load highest_load(const Network& network, const Assembly::Term& term,
                  std::span<const Range> arguments, double rate_ratio) {
  if (term.is_passive) {
    return {};
  }
  const Load load = load_as_keys_have_it(network, term, arguments, rate_ratio);
  const bool is_fixed =
      term.is_link ? network.links[term.element].is_fixed : network.masses[term.element].is_fixed;
  // A fixed element is not stiffened by keys.
  return is_fixed ? Load{.damped = load.total()} : load;
}

Load lowest_load(const Network& network, const Assembly::Term& term,
                 std::span<const Range> arguments, double rate_ratio) {
  const double r = rate_ratio;
  const auto load = [&](double k, double z) {
    const double most = term.wanders || term.is_passive ? 0.0 : HUGE_VAL;
    return Load{.stiff = term.scale * std::min(most, k) * r * r,
                .damped = 2.0 * term.scale * std::min(most, z) * r};
  };
  if (!term.is_link && network.masses[term.element].is_mode) {
    return load_of_mode(network.masses[term.element], arguments, rate_ratio, false);
  }
  if (!term.is_link) {
    const Mass& mass = network.masses[term.element];
    return load(range_at(arguments, mass.stiffness).lowest,
                range_at(arguments, mass.damping).lowest);
  }
  const Link& link = network.links[term.element];
  const Slopes slopes = gentlest(link.law, numbers(link, arguments, &Range::lowest));
  return load(slopes.pull, slopes.damping);
}

}  // namespace ressort::analysis
