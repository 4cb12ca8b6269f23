#include "core/model/network.h"

#include <algorithm>
#include <bit>
#include <unordered_map>

#include "core/model/index_table.h"
#include "core/ranges.h"

namespace ressort::model {
namespace {

void append(std::string& key, std::uint64_t bits) {
  key.append(reinterpret_cast<const char*>(&bits), sizeof bits);
}

// Returns a key that is equal for equal formulas. It distinguishes -0 from 0.
std::string key_of(const Formula& formula) {
  std::string key;
  for (const Step& step : formula) {
    key += static_cast<char>(step.op);
    append(key, step.op == Op::parameter ? step.index : std::bit_cast<std::uint64_t>(step.value));
  }
  return key;
}

std::size_t hash_of(const Drawing& drawing) {
  const std::hash<double> hash;
  return 31 * (31 * hash(drawing.x) + hash(drawing.y)) +
         std::hash<std::string_view>()(drawing.group);
}

// Builds the canonical network element by element, and moves the parts in use from the old one.
class Renumbering {
 public:
  explicit Renumbering(Network network)
      : old_(std::move(network)),
        places_(old_.masses.size(), unplaced),
        arguments_(old_.arguments.size(), no_argument),
        drawings_(old_.drawings.size()) {}

  Network run() {
    const auto by_number = [](const auto& a, const auto& b) { return a.number < b.number; };
    std::ranges::stable_sort(old_.inputs, by_number);
    std::ranges::stable_sort(old_.outputs, by_number);
    new_.parameters = std::move(old_.parameters);
    new_.third = old_.third;
    place_masses();
    for (Macro& macro : old_.macros) {
      for (ArgumentId* const id : arguments_of(macro)) {
        *id = argument(*id);
      }
      macro.drawing = drawing(macro.drawing);
    }
    new_.macros = std::move(old_.macros);
    std::ranges::stable_sort(old_.modes, by_body);
    for (BodyMode& mode : old_.modes) {
      mode.frequency_hz = argument(mode.frequency_hz);
      mode.t60_s = argument(mode.t60_s);
    }
    new_.modes = std::move(old_.modes);
    new_.shapes = std::move(old_.shapes);
    place_points();
    for (Link& link : old_.links) {
      for (ArgumentId& id : link.arguments) {
        id = argument(id);
      }
    }
    new_.links = std::move(old_.links);
    new_.inputs = std::move(old_.inputs);
    for (Output& output : old_.outputs) {
      output.level = argument(output.level);
    }
    new_.outputs = std::move(old_.outputs);
    if (rests_at_zero(new_)) {
      new_.third = ThirdArgument::delayed_position;  // The two meanings are the same from here on.
    }
    return std::move(new_);
  }

 private:
  static constexpr std::uint32_t unplaced = 0xffffffffu;

  void place_masses() {
    new_.masses.reserve(old_.masses.size());
    new_.drawings.reserve(old_.drawings.size());
    for (std::uint32_t i = 0; i < old_.masses.size(); ++i) {
      if (old_.masses[i].kind != MassKind::position && old_.masses[i].kind != MassKind::point) {
        place(i);
      }
    }
    for (const Input& input : old_.inputs) {
      if (!input.is_force) {
        place(input.mass);
      }
    }
  }

  void place(std::uint32_t index) {
    if (places_[index] != unplaced) {
      return;
    }
    places_[index] = static_cast<std::uint32_t>(new_.masses.size());
    Mass& mass = new_.masses.emplace_back(std::move(old_.masses[index]));
    for (ArgumentId* const id : {&mass.mass, &mass.stiffness, &mass.damping, &mass.gravity}) {
      *id = argument(*id);
    }
    mass.drawing = drawing(mass.drawing);
  }

  void place_points() {
    for (Link& link : old_.links) {
      link.a = end(link.a);
      link.b = end(link.b);
    }
    for (Input& input : old_.inputs) {
      input.mass = end(input.mass);
    }
    for (Output& output : old_.outputs) {
      output.mass = end(output.mass);
    }
  }

  // Returns the new index of the mass at one end. Each end gets a point of its own.
  std::uint32_t end(std::uint32_t index) {
    if (places_[index] != unplaced) {
      return places_[index];
    }
    Mass point = old_.masses[index];
    Tap tap = old_.taps[point.tap];
    tap.u = argument(tap.u);
    tap.v = argument(tap.v);
    tap.first = tap.length > 0 ? places_[tap.first] : 0;
    point.tap = static_cast<std::uint32_t>(new_.taps.size());
    new_.taps.push_back(tap);
    new_.masses.push_back(std::move(point));
    return static_cast<std::uint32_t>(new_.masses.size() - 1);
  }

  ArgumentId argument(ArgumentId id) {
    if (id == no_argument) {
      return no_argument;
    }
    if (arguments_[id] == no_argument) {
      Formula& formula = old_.arguments[id];
      const auto [entry, is_new] =
          formulas_.try_emplace(key_of(formula), static_cast<ArgumentId>(new_.arguments.size()));
      if (is_new) {
        new_.arguments.push_back(std::move(formula));
      }
      arguments_[id] = entry->second;
    }
    return arguments_[id];
  }

  std::uint32_t drawing(std::uint32_t number) {
    if (number == 0) {
      return 0;
    }
    const Drawing& drawing = old_.drawings[number - 1];
    std::uint32_t& index = drawings_.find(
        hash_of(drawing), [&](std::uint32_t i) { return new_.drawings[i] == drawing; });
    if (index == IndexTable::none) {
      index = static_cast<std::uint32_t>(new_.drawings.size());
      new_.drawings.push_back(drawing);
    }
    return index + 1;
  }

  Network old_;
  Network new_;
  std::vector<std::uint32_t> places_;  // [old mass], points are never placed
  std::vector<ArgumentId> arguments_;  // [old argument]
  std::unordered_map<std::string, ArgumentId> formulas_;
  IndexTable drawings_;
};

}  // namespace

Network canonical(Network network) {
  return Renumbering(std::move(network)).run();
}

double argument_value(const Network& network, ArgumentId argument,
                      std::span<const double> parameters) {
  return argument == no_argument ? 0.0 : evaluate(network.arguments[argument], parameters);
}

LinearPart linear_part(const Link& link) {
  const LawFacts& law = facts_of(link.law);
  return law.is_spring() ? LinearPart{link.arguments[law.slot(Role::stiffness)],
                                      link.arguments[law.slot(Role::damping)]}
                         : LinearPart{};
}

double level_value(const Network& network, const Output& output,
                   std::span<const double> parameters) {
  return output.level == no_argument ? 1.0 : argument_value(network, output.level, parameters);
}

std::vector<double> parameter_values(const Network& network) {
  return mapped(network.parameters, &Parameter::value);
}

double initial_velocity(const Network& network, const Mass& mass) {
  if (mass.kind == MassKind::ground || mass.kind == MassKind::position ||
      mass.kind == MassKind::junction) {
    return 0.0;
  }
  return network.third == ThirdArgument::delayed_position ? mass.position - mass.third
                                                          : mass.third / Network::reference_rate_hz;
}

bool rests_at_zero(const Network& network) {
  const auto rests = [](const auto& element) {
    return element.position == 0.0 && element.third == 0.0;
  };
  return std::ranges::all_of(network.masses,
                             [&](const Mass& mass) { return !moves(mass) || rests(mass); }) &&
         std::ranges::all_of(network.macros, rests);
}

std::size_t moving_count(const Network& network) {
  return static_cast<std::size_t>(std::ranges::count_if(network.masses, moves));
}

int input_count(const Network& network) {
  int count = 0;
  for (const Input& input : network.inputs) {
    count = std::max(count, input.number);
  }
  return count;
}

int output_count(const Network& network) {
  int count = 0;
  for (const Output& output : network.outputs) {
    count = std::max(count, output.number);
  }
  return count;
}

std::vector<bool> used_parameters(const Network& network) {
  std::vector<bool> used(network.parameters.size(), false);
  for (const Formula& formula : network.arguments) {
    for (const Step& step : formula) {
      if (step.op == Op::parameter) {
        used[step.index] = true;
      }
    }
  }
  return used;
}

}  // namespace ressort::model
