#include "app/commands/chart/start.h"

#include <bit>

#include "core/analysis/continuous.h"

namespace ressort::commands {

Starts::Starts(const ChartScene& scene) {
  scenes_.fill(scene);
  if (!scene.is_linear) {
    return;
  }
  Network heard = scene.network;  // every mass that moves
  heard.outputs.clear();
  for (std::uint32_t i = 0; i < heard.masses.size(); ++i) {
    if (moves(heard.masses[i])) {
      heard.outputs.push_back({.number = static_cast<int>(heard.outputs.size()) + 1, .mass = i});
    }
  }
  const auto course = solve_continuous(heard, parameter_values(heard));
  for (unsigned i = 0; i < scenes_.size() && course; ++i) {
    const double steps = 1U << i;
    Network& network = scenes_[i].network;
    for (std::size_t o = 0; o < heard.outputs.size(); ++o) {
      Mass& mass = network.masses[heard.outputs[o].mass];
      // Nothing pulls in the first step: it leads to where the network comes in that time.
      const double way = steps * (course->play(o, 1, 1.0 / steps)[0] - mass.position);
      mass.third = network.third == ThirdArgument::delayed_position
                       ? mass.position - way
                       : way * Network::reference_rate_hz;
    }
  }
}

const ChartScene& Starts::at(unsigned steps_a_sample) const {
  return scenes_[static_cast<std::size_t>(std::countr_zero(steps_a_sample))];
}

}  // namespace ressort::commands
