#include "app/panel/picture.h"

#include <algorithm>
#include <cmath>
#include <variant>

namespace ressort {
namespace {

// How far a mass moves when a mode's q grows by 1, from how much the mode gets of the mass: the
// shapes are orthogonal by the masses.
std::vector<double> inverse_masses(const Program& program, const Modes& modes) {
  std::vector<double> inverse(program.moving, 1.0);
  if (modes.inverse_mass == Modes::own_mass) {
    for (const MassRun& run : program.mass_runs) {
      const double value = coefficient_value(program, program.coefficients[run.inverse_mass],
                                             program.parameters, 1.0);
      std::fill_n(inverse.begin() + run.first, run.count, value);
    }
  }
  return inverse;
}

void take_shapes(const Program& program, const Modes& modes, std::span<const std::uint32_t> nodes,
                 Picture::Group& group) {
  const std::vector<double> inverse = inverse_masses(program, modes);
  group.is_modal = true;
  group.modes = modes.modes;
  group.start_q = modes.q;
  for (std::size_t mode = 0; mode < modes.modes; ++mode) {
    for (const std::uint32_t node : nodes) {
      group.shapes.push_back(
          static_cast<float>(modes.basis[mode * program.moving + node] * inverse[node]));
    }
  }
}

}  // namespace

Picture make_picture(Engine& engine, const Network& network, std::uint32_t number) {
  Picture picture{.number = number, .network = std::make_shared<const Network>(network)};
  const Machine& machine = engine.machine();
  std::size_t all = 0;
  const auto counts = [](const Program& program, std::size_t node) {
    const auto is_hand = [&](const InputSlot& input) {
      return !input.is_force && input.node == node;
    };
    return node < program.moving ||
           (!std::holds_alternative<Modes>(program.form) &&
            std::any_of(program.inputs.begin(), program.inputs.end(), is_hand));
  };
  for (const Program& program : machine.parts) {
    all += program.moving + program.inputs.size();
  }
  const std::size_t stride = (all + most_dots - 1) / most_dots;
  // What is played and heard is always drawn.
  const auto is_port = [](const Program& program, std::size_t node) {
    const auto is_here = [&](const auto& slot) { return slot.node == node; };
    return std::any_of(program.inputs.begin(), program.inputs.end(), is_here) ||
           std::any_of(program.outputs.begin(), program.outputs.end(), is_here);
  };
  std::size_t room = MotionFrame::most_numbers;
  std::vector<std::vector<std::uint32_t>> watched;
  for (const Program& program : machine.parts) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> nodes;  // mass, node
    for (std::uint32_t node = 0; node < program.masses.size(); ++node) {
      if ((program.masses[node] % std::max<std::size_t>(1, stride) == 0 ||
           is_port(program, node)) &&
          counts(program, node)) {
        nodes.emplace_back(program.masses[node], node);
      }
    }
    std::sort(nodes.begin(), nodes.end());
    nodes.resize(std::min(nodes.size(), most_dots - picture.masses.size()));
    Picture::Group group{.first = picture.masses.size(), .count = nodes.size()};
    std::vector<std::uint32_t>& chosen = watched.emplace_back();
    for (const auto& [mass, node] : nodes) {
      chosen.push_back(node);
      picture.masses.push_back(mass);
      picture.start.push_back(program.position[node]);
    }
    const auto* const modes = std::get_if<Modes>(&program.form);
    if (modes != nullptr && modes->modes <= room && !modes->is_crossed) {
      take_shapes(program, *modes, chosen, group);
    }
    if (group.numbers() > room || (modes != nullptr && !group.is_modal) || group.numbers() == 0) {
      chosen.clear();  // it is drawn as it stands
      group.count = 0;
      group.is_modal = false;
      group.modes = 0;
    }
    room -= group.numbers();
    picture.groups.push_back(std::move(group));
  }
  engine.watch(std::move(watched));
  return picture;
}

void find_positions(const Picture& picture, const MotionFrame& frame, std::span<float> positions) {
  std::transform(picture.start.begin(), picture.start.end(), positions.begin(),
                 [](double x) { return static_cast<float>(x); });
  std::size_t at = 0;
  for (const Picture::Group& group : picture.groups) {
    if (at + group.numbers() > frame.count) {
      return;
    }
    const double* const numbers = frame.numbers.data() + at;
    float* const x = positions.data() + group.first;
    for (std::size_t mode = 0; mode < group.modes; ++mode) {
      // What is 160 dB below 1 is not seen.
      const auto q = static_cast<float>(numbers[mode] - group.start_q[mode]);
      if (std::fabs(q) > 1e-8f) {
        const float* const shape = group.shapes.data() + mode * group.count;
        for (std::size_t i = 0; i < group.count; ++i) {
          x[i] += q * shape[i];
        }
      }
    }
    for (std::size_t i = 0; !group.is_modal && i < group.count; ++i) {
      x[i] = static_cast<float>(numbers[i]);
    }
    at += group.numbers();
  }
}

}  // namespace ressort
