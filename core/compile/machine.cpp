#include "core/compile/machine.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <tuple>

#include "core/model/topology.h"
#include "core/sampled_mode.h"

namespace ressort::compile {
namespace {

constexpr std::uint32_t nowhere = 0xffffffffu;

// The elements of a network that form one Program, in the network's order.
struct Share {
  std::vector<std::uint32_t> masses;
  std::vector<std::uint32_t> links;
};

// The source of a coefficient.
struct CoefficientKey {
  ArgumentId argument = no_argument;
  Unit unit = Unit::plain;
  bool is_fixed = false;
  auto operator<=>(const CoefficientKey&) const = default;
};

class ProgramMaker {
 public:
  ProgramMaker(const Network& network, const Share& share, double rate_hz, bool rescale,
               std::span<const Scheme> schemes)
      : network_(network), share_(share), schemes_(schemes) {
    program_.rate_hz = rate_hz;
    program_.rate_ratio = rate_ratio_of(rate_hz, rescale);
    program_.parameters = parameter_values(network);
    program_.depending.resize(network.parameters.size());
  }

  Program make() {
    place_masses();
    place_links();
    program_.shapes = network_.shapes;
    for (std::uint32_t i = 0; i < network_.inputs.size(); ++i) {
      const Input& input = network_.inputs[i];
      if (node_[input.mass] != nowhere) {
        program_.inputs.push_back({i, input.is_force, node_[input.mass]});
      }
    }
    place_taps();
    place_junctions();
    place_filters();
    for (std::uint32_t i = 0; i < network_.outputs.size(); ++i) {
      if (node_[network_.outputs[i].mass] != nowhere) {
        add_output(i);
      }
    }
    for (std::uint32_t i = 0; i < network_.parameters.size(); ++i) {
      if (const int input = network_.parameters[i].audio_input; input > 0) {
        program_.audio_parameters.push_back({i, input - 1});
        auto& coefficients = program_.audio_coefficients;
        coefficients.insert(coefficients.end(), program_.depending[i].begin(),
                            program_.depending[i].end());
      }
    }
    std::ranges::sort(program_.audio_coefficients);
    program_.audio_coefficients.erase(
        std::unique(program_.audio_coefficients.begin(), program_.audio_coefficients.end()),
        program_.audio_coefficients.end());
    return std::move(program_);
  }

 private:
  // Returns the coefficient of an argument in a unit. Elements with the same argument share it.
  std::uint32_t coefficient(ArgumentId argument, Unit unit, bool is_fixed = false) {
    const auto next = static_cast<std::uint32_t>(program_.coefficients.size());
    const auto [entry, is_new] = known_.try_emplace(CoefficientKey{argument, unit, is_fixed}, next);
    return is_new ? add_coefficient(argument, unit, is_fixed) : entry->second;
  }

  std::uint32_t add_coefficient(ArgumentId argument, Unit unit, bool is_fixed) {
    const auto next = static_cast<std::uint32_t>(program_.coefficients.size());
    const Formula& formula = formula_of(argument);
    program_.coefficients.push_back({.first = static_cast<std::uint32_t>(program_.steps.size()),
                                     .count = static_cast<std::uint32_t>(formula.size()),
                                     .unit = unit,
                                     .is_fixed = is_fixed});
    program_.steps.insert(program_.steps.end(), formula.begin(), formula.end());
    depend(next, formula);
    return next;
  }

  void add_output(std::uint32_t index) {
    const Output& output = network_.outputs[index];
    OutputSlot slot{.channel = static_cast<std::uint32_t>(output.number - 1),
                    .node = node_[output.mass],
                    .is_force = output.is_force,
                    .derivative = output.derivative,
                    .origin = index};
    if (output.level != no_argument) {
      const Formula& formula = formula_of(output.level);
      slot.level.first = static_cast<std::uint32_t>(program_.steps.size());
      slot.level.count = static_cast<std::uint32_t>(formula.size());
      program_.steps.insert(program_.steps.end(), formula.begin(), formula.end());
    }
    program_.outputs.push_back(slot);
  }

  const Formula& formula_of(ArgumentId argument) const {
    static const Formula nothing = {{Op::number, 0, 0.0}};
    return argument == no_argument ? nothing : network_.arguments[argument];
  }

  // Registers the coefficient with the parameters of a formula.
  void depend(std::uint32_t coefficient, const Formula& formula) {
    for (const Step& step : formula) {
      if (step.op == Op::parameter) {
        auto& depending = program_.depending[step.index];
        if (depending.empty() || depending.back() != coefficient) {
          depending.push_back(coefficient);
        }
      }
    }
  }

  // Returns how often a formula reads parameters.
  static std::ptrdiff_t reads_of(const Formula& formula) {
    return std::ranges::count(formula, Op::parameter, &Step::op);
  }

  // Returns whether a mode rings at a frequency that no parameter changes. Both M (w^2 + s^2) and
  // 2 M s have the formulas of the mass M and of the decay rate s, but only the stiffness has w.
  bool rings_at_one_frequency(const Mass& mass, const SampledCoefficients& mode) const {
    const auto value = [&](std::uint32_t c) {
      return continuous_value(program_, program_.coefficients[c], program_.parameters, 1.0);
    };
    const double rate = 0.5 * value(mode.inverse_mass) * value(mode.damping);
    return reads_of(formula_of(mass.stiffness)) == reads_of(formula_of(mass.damping)) &&
           value(mode.inverse_mass) * value(mode.stiffness) - rate * rate < highest_ring;
  }

  // Adds a run for one mode of a body. Its three coefficients depend on the formulas of all three,
  // because sampling a mode exactly mixes mass, stiffness and damping (core/sampled_mode.h). Only
  // the mass of a mode that rings at any T60 depends on itself alone.
  void add_mode(std::uint32_t node, const Mass& mass) {
    const auto mode = static_cast<std::uint32_t>(program_.modes.size());
    const auto add = [&](ArgumentId argument, Unit unit) {
      const std::uint32_t next = add_coefficient(argument, unit, mass.is_fixed);
      program_.coefficients[next].mode = mode;
      return next;
    };
    const SampledCoefficients coefficients{.inverse_mass = add(mass.mass, Unit::inverse_mass),
                                           .stiffness = add(mass.stiffness, Unit::stiffness),
                                           .damping = add(mass.damping, Unit::damping)};
    const bool keeps_mass = rings_at_one_frequency(mass, coefficients);
    for (const std::uint32_t next :
         {coefficients.inverse_mass, coefficients.stiffness, coefficients.damping}) {
      depend(next, formula_of(mass.mass));
      if (next != coefficients.inverse_mass || !keeps_mass) {
        depend(next, formula_of(mass.stiffness));
        depend(next, formula_of(mass.damping));
      }
    }
    program_.modes.push_back(coefficients);
    program_.mass_runs.push_back({.first = node,
                                  .count = 1,
                                  .inverse_mass = coefficients.inverse_mass,
                                  .stiffness = coefficients.stiffness,
                                  .damping = coefficients.damping,
                                  .gravity = coefficient(no_argument, Unit::gravity),
                                  .is_oscillator = true});
  }

  void place_masses() {
    const auto& masses = network_.masses;
    std::vector<std::uint32_t> order = share_.masses;
    const auto rank = [&](std::uint32_t i) {
      const Mass& m = masses[i];
      const int group = moves(m)                       ? 0
                        : m.kind == MassKind::junction ? 1
                        : m.kind == MassKind::ground   ? 2
                                                       : 3;
      return std::tuple(group, m.is_mode, m.is_fixed, m.kind, m.mass, m.stiffness, m.damping,
                        m.gravity, m.gravity_per_rate);
    };
    std::ranges::stable_sort(order, {}, rank);
    program_.masses = order;
    node_.resize(masses.size(), nowhere);
    program_.position.reserve(order.size());
    program_.velocity.reserve(order.size());
    for (std::uint32_t node = 0; node < order.size(); ++node) {
      const Mass& mass = masses[order[node]];
      node_[order[node]] = node;
      program_.position.push_back(mass.position);
      program_.velocity.push_back(initial_velocity(network_, mass) * program_.rate_ratio);
      const bool is_junction = mass.kind == MassKind::junction;
      if (!moves(mass) && !is_junction) {
        continue;
      }
      ++program_.moving;
      if (mass.is_mode) {
        add_mode(node, mass);
        continue;
      }
      if (node > 0 && rank(order[node]) == rank(order[node - 1])) {
        ++program_.mass_runs.back().count;
        continue;
      }
      const Unit gravity_unit = mass.gravity_per_rate ? Unit::gravity_per_rate : Unit::gravity;
      program_.mass_runs.push_back(
          {.first = node,
           .count = 1,
           .inverse_mass =
               coefficient(mass.mass, is_junction ? Unit::inverse_impedance : Unit::inverse_mass,
                           mass.is_fixed),
           .stiffness = coefficient(mass.stiffness, Unit::stiffness, mass.is_fixed),
           .damping = coefficient(mass.damping, Unit::damping),
           .gravity = coefficient(mass.gravity, gravity_unit),
           .is_oscillator = mass.kind == MassKind::oscillator,
           .has_gravity = mass.gravity != no_argument,
           .is_junction = is_junction});
    }
  }

  void place_taps() {
    std::map<std::uint32_t, std::uint32_t> known;  // first mass of a macro -> first of tap_nodes
    for (const std::uint32_t i : share_.masses) {
      if (network_.masses[i].kind != MassKind::point) {
        continue;
      }
      const Tap& tap = network_.taps[network_.masses[i].tap];
      const auto next = static_cast<std::uint32_t>(program_.tap_nodes.size());
      const auto [entry, is_new] = known.try_emplace(tap.first, next);
      for (std::uint32_t k = 0; is_new && k < tap.length * tap.width; ++k) {
        program_.tap_nodes.push_back(node_[tap.first + k]);
      }
      program_.taps.push_back({.node = node_[i],
                               .first = entry->second,
                               .length = tap.length,
                               .width = tap.width,
                               .u = coefficient(tap.u, Unit::plain),
                               .v = coefficient(tap.v, Unit::plain),
                               .places = tap.places,
                               .shape = tap.shape});
      program_.position[node_[i]] = network_.masses[tap.first].position;
    }
  }

  void place_junctions() {
    std::map<std::uint32_t, std::vector<std::uint32_t>> places;  // waveguide -> masses
    for (const std::uint32_t i : share_.masses) {
      if (network_.masses[i].kind == MassKind::junction) {
        places[network_.taps[network_.masses[i].tap].macro].push_back(i);
      }
    }
    for (const auto& [waveguide, masses] : places) {
      const Macro& guide = network_.waveguides[waveguide];
      program_.waveguides.push_back(
          {.is_open = guide.kind == MacroKind::open_waveguide,
           .inverse_impedance =
               coefficient(guide.impedance, Unit::inverse_impedance, guide.is_fixed),
           .frequency = coefficient(guide.frequency_hz, Unit::frequency, guide.is_fixed),
           .t60 = coefficient(guide.t60_s, Unit::plain),
           .brightness = coefficient(guide.brightness, Unit::plain),
           .first = static_cast<std::uint32_t>(program_.junctions.size()),
           .count = static_cast<std::uint32_t>(masses.size())});
      for (const std::uint32_t i : masses) {
        program_.junctions.push_back(
            {node_[i], coefficient(network_.taps[network_.masses[i].tap].u, Unit::plain)});
      }
    }
  }

  void place_links() {
    std::vector<std::uint32_t> order = share_.links;
    const auto rank = [&](std::uint32_t i) {
      const Link& link = network_.links[i];
      return std::tuple(link.law, link.arguments, link.is_fixed, scheme_of(i));
    };
    std::ranges::stable_sort(order, {}, rank);
    program_.ends.reserve(order.size());
    program_.origins = order;
    for (std::uint32_t i = 0; i < order.size(); ++i) {
      const Link& link = network_.links[order[i]];
      program_.ends.push_back({node_[link.a], node_[link.b]});
      if (i > 0 && rank(order[i]) == rank(order[i - 1])) {
        ++program_.link_runs.back().count;
        continue;
      }
      LinkRun run{.law = link.law, .scheme = scheme_of(order[i]), .first = i, .count = 1};
      for (std::size_t k = 0; k < most_law_arguments; ++k) {
        run.coefficients[k] =
            coefficient(link.arguments[k], facts_of(link.law).arguments[k].unit, link.is_fixed);
      }
      program_.link_runs.push_back(run);
    }
  }

  // Puts the filters of each waveguide into the longest stretch without a spring. Their delay is no
  // whole number of samples, and would detune the stretch between two springs.
  void place_filters() {
    std::vector<bool> is_held(program_.moving, false);
    for (const LinkRun& run : program_.link_runs) {
      for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
        for (const std::uint32_t node : {program_.ends[i].a, program_.ends[i].b}) {
          if (node < program_.moving && facts_of(run.law).contains_spring) {
            is_held[node] = true;
          }
        }
      }
    }
    for (WaveguideSlot& guide : program_.waveguides) {
      std::vector<double> held;
      for (std::uint32_t i = guide.first; i < guide.first + guide.count; ++i) {
        const JunctionSlot& place = program_.junctions[i];
        if (is_held[place.node]) {
          held.push_back(coefficient_value(program_, program_.coefficients[place.u],
                                           program_.parameters, 1.0));
        }
      }
      guide.filters_at = filters_between(held);
    }
  }

  Scheme scheme_of(std::uint32_t link) const {
    return link < schemes_.size() ? schemes_[link] : Scheme::plain;
  }

  const Network& network_;
  const Share& share_;
  std::span<const Scheme> schemes_;  // [link of the network]
  Program program_;
  std::vector<std::uint32_t> node_;  // [mass of the network] node, or nowhere
  std::map<CoefficientKey, std::uint32_t> known_;
};

// Divides a culled network into connected components. Grounds connect no components, except grounds
// with an output.
class Divider {
 public:
  Divider(const Network& network, const Culled& culled, const Progress& progress)
      : network_(network),
        culled_(culled),
        groups_(network.masses.size()),
        binds_(network.masses.size()) {
    for (std::size_t i = 0; i < binds_.size(); ++i) {
      binds_[i] = network.masses[i].kind != MassKind::ground && !culled_.is_dead[i];
    }
    for (const Output& output : network.outputs) {
      binds_[output.mass] = !culled_.is_dead[output.mass];
    }
    for (std::size_t l = 0; l < network.links.size(); ++l) {
      const Link& link = network.links[l];
      if (!culled_.is_slack[l] && binds_[link.a] && binds_[link.b]) {
        groups_.join(link.a, link.b);
      }
    }
    join_places(
        network, groups_, progress, [&](std::uint32_t place) { return binds_[place]; },
        [&](std::uint32_t node) { binds_[node] = true; });
  }

  std::vector<Share> divide() {
    choose_parts();
    std::vector<Share> shares(parts_);
    for (std::uint32_t i = 0; i < binds_.size(); ++i) {
      if (binds_[i]) {
        shares[part_of(i)].masses.push_back(i);
      }
    }
    std::vector<std::uint32_t> seen(binds_.size(), nowhere);  // [ground] the last part that has it
    for (std::uint32_t l = 0; l < network_.links.size(); ++l) {
      const Link& link = network_.links[l];
      if (culled_.is_slack[l]) {
        continue;
      }
      const std::size_t part = binds_[link.a]   ? part_of(link.a)
                               : binds_[link.b] ? part_of(link.b)
                                                : parts_ - 1;
      shares[part].links.push_back(l);
    }
    for (std::uint32_t part = 0; part < parts_; ++part) {
      for (const std::uint32_t l : shares[part].links) {
        for (const std::uint32_t end : {network_.links[l].a, network_.links[l].b}) {
          if (!binds_[end] && seen[end] != part) {
            seen[end] = part;
            shares[part].masses.push_back(end);
          }
        }
      }
      std::ranges::sort(shares[part].masses);
    }
    return shares;
  }

 private:
  std::size_t part_of(std::uint32_t mass) { return part_[groups_.find(mass)]; }

  // Makes a part of each of the largest groups, and one part of all others.
  void choose_parts() {
    std::vector<std::uint32_t> count(binds_.size(), 0);
    std::vector<std::uint32_t> roots;
    for (std::uint32_t i = 0; i < binds_.size(); ++i) {
      const bool counts =
          moves(network_.masses[i]) || network_.masses[i].kind == MassKind::junction;
      if (binds_[i] && counts && count[groups_.find(i)]++ == 0) {
        roots.push_back(groups_.find(i));
      }
    }
    std::ranges::stable_sort(roots,
                             [&](std::uint32_t a, std::uint32_t b) { return count[a] > count[b]; });
    part_.assign(binds_.size(), nowhere);
    for (const std::uint32_t root : roots) {
      if (parts_ < most_parts && count[root] >= least_part_masses) {
        part_[root] = static_cast<std::uint32_t>(parts_++);
      }
    }
    bool has_rest = parts_ == 0;
    for (std::uint32_t i = 0; i < binds_.size(); ++i) {
      has_rest |= binds_[i] && part_of(i) == nowhere;
    }
    if (has_rest) {
      std::replace(part_.begin(), part_.end(), nowhere, static_cast<std::uint32_t>(parts_++));
    }
  }

  const Network& network_;
  const Culled& culled_;
  Groups groups_;
  std::vector<bool> binds_;          // [mass] connects the links that end on it
  std::vector<std::uint32_t> part_;  // [root of a group]
  std::size_t parts_ = 0;
};

}  // namespace

Machine tabulate(const Network& network, const Culled& culled, std::span<const Scheme> schemes,
                 std::span<const double> start, double rate_hz, bool rescale,
                 const Progress& progress) {
  Machine machine{.rate_hz = rate_hz,
                  .rate_ratio = rate_ratio_of(rate_hz, rescale),
                  .parameters = {start.begin(), start.end()},
                  .channels = static_cast<std::uint32_t>(output_count(network))};
  for (const Input& input : network.inputs) {
    machine.inputs.push_back(
        {.number = input.number,
         .is_force = input.is_force,
         .position = input.is_force ? 0.0 : network.masses[input.mass].position});
  }
  for (const Share& share : Divider(network, culled, progress).divide()) {
    progress.spend(16 * (share.masses.size() + share.links.size()));
    machine.parts.push_back(ProgramMaker(network, share, rate_hz, rescale, schemes).make());
  }
  return machine;
}

Machine make_machine(const Network& network, double rate_hz, bool rescale) {
  const Network whole = expand_macros(network);
  return tabulate(whole, cull(whole), {}, parameter_values(whole), rate_hz, rescale);
}

Program make_program(const Network& network, double rate_hz, bool rescale,
                     std::span<const Scheme> schemes) {
  const Network whole = expand_macros(network);
  Share everything;
  everything.masses.resize(whole.masses.size());
  everything.links.resize(whole.links.size());
  std::iota(everything.masses.begin(), everything.masses.end(), 0u);
  std::iota(everything.links.begin(), everything.links.end(), 0u);
  return ProgramMaker(whole, everything, rate_hz, rescale, schemes).make();
}

}  // namespace ressort::compile
