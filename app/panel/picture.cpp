#include "app/panel/picture.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "core/compile/instrument.h"
#include "core/kernels/modal/modal_form.h"
#include "core/kernels/taps.h"
#include "core/kernels/waveguides/rails.h"

namespace ressort::panel {
namespace {

// Number of wave samples that the audio thread sums for one frame.
constexpr std::size_t most_samples = 1 << 16;

// Returns the displacement of each mass per unit of a mode's q, divided by its component: the
// shapes are orthogonal with respect to the masses.
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

// A place on a body moves with its modes, each weighted by its displacement there.
void take_shapes(const Program& program, const Modes& modes, std::span<const std::uint32_t> nodes,
                 Picture::Group& group) {
  const std::vector<double> inverse = inverse_masses(program, modes);
  const auto number = [&](std::uint32_t c) {
    return coefficient_value(program, program.coefficients[c], program.parameters, 1.0);
  };
  // [dot] Pairs of node and weight.
  std::vector<std::vector<std::pair<std::uint32_t, double>>> behind;
  for (const std::uint32_t node : nodes) {
    auto& list = behind.emplace_back();
    if (node < program.moving) {
      list.emplace_back(node, 1.0);
      continue;
    }
    const TapSlot& tap = program.taps[node - program.taps[0].node];
    each_behind(program, tap, corners_at(tap, number(tap.u), number(tap.v)),
                [&](std::uint32_t at, double weight) { list.emplace_back(at, weight); });
  }
  group.is_modal = true;
  group.modes = modes.modes;
  group.start_q = modes.q;
  for (std::size_t mode = 0; mode < modes.modes; ++mode) {
    for (const auto& list : behind) {
      double shape = 0.0;
      for (const auto& [node, weight] : list) {
        shape += weight * modes.basis[mode * program.moving + node] * inverse[node];
      }
      group.shapes.push_back(static_cast<float>(shape));
    }
  }
}

// Returns the waveguides of a part in order. Their places are dots already.
std::vector<Picture::Waveguide> take_waveguides(const Program& program, const Network& network,
                                                std::span<const std::uint32_t> nodes,
                                                std::size_t first_dot) {
  std::vector<Picture::Waveguide> taken;
  for (const WaveguideSlot& slot : program.waveguides) {
    Picture::Waveguide& waveguide = taken.emplace_back();
    waveguide.is_open = slot.is_open;
    for (std::uint32_t i = slot.first; i < slot.first + slot.count; ++i) {
      const JunctionSlot& junction = program.junctions[i];
      const Mass& point = network.masses[program.masses[junction.node]];
      waveguide.macro = network.taps[point.tap].macro;
      const auto dot = std::ranges::find(nodes, junction.node);
      if (dot != nodes.end()) {
        const double u =
            coefficient_value(program, program.coefficients[junction.u], program.parameters, 1.0);
        waveguide.places.push_back(
            {std::clamp(u, 0.0, 1.0), first_dot + static_cast<std::size_t>(dot - nodes.begin())});
      }
    }
    std::ranges::sort(waveguide.places, [](const auto& a, const auto& b) { return a.u < b.u; });
  }
  return taken;
}

// Draws the waves between the places, whose positions are exact. The error of the waves at a place,
// caused by the loop filter, is distributed linearly up to the next place.
void place_waveguide(const Picture::Waveguide& waveguide, std::span<const double> numbers,
                     std::span<const double> start, std::span<float> positions) {
  const auto pieces = static_cast<double>(numbers.size() - 1);
  const double rest = start[waveguide.first];
  const auto by_waves = [&](double u) {
    const auto below = std::min(static_cast<std::size_t>(u * pieces), numbers.size() - 2);
    const double beyond = u * pieces - static_cast<double>(below);
    return rest + numbers[below] + beyond * (numbers[below + 1] - numbers[below]);
  };
  double from = 0.0;
  double off = 0.0;
  const auto off_at = [&](const Picture::Waveguide::Place& place) {
    return static_cast<double>(positions[place.dot]) - by_waves(place.u);
  };
  if (waveguide.is_open && !waveguide.places.empty()) {
    off = off_at(waveguide.places.front());
  }
  std::size_t next = 0;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const double u = static_cast<double>(i) / pieces;
    while (next < waveguide.places.size() && waveguide.places[next].u <= u) {
      from = waveguide.places[next].u;
      off = off_at(waveguide.places[next++]);
    }
    const bool is_last = next == waveguide.places.size();
    const double until = is_last ? 1.0 : waveguide.places[next].u;
    const double then = !is_last            ? off_at(waveguide.places[next])
                        : waveguide.is_open ? off
                                            : rest - by_waves(1.0);
    const double share = until > from ? (u - from) / (until - from) : 1.0;
    positions[waveguide.first + i] = static_cast<float>(by_waves(u) + off + share * (then - off));
  }
}

}  // namespace

Picture make_picture(Engine& engine, const Network& network, std::uint32_t number) {
  Picture picture{.number = number, .network = std::make_shared<const Network>(network)};
  const Machine& machine = engine.machine();
  std::size_t all = 0;
  std::size_t waveguides = 0;
  std::size_t most_waveguides = most_dots / 2 / Engine::waveguide_points;
  std::set<std::string> known;  // Places on bodies; several links may share one.
  const auto counts = [&](const Program& program, std::uint32_t node) {
    const auto is_hand = [&](const InputSlot& input) {
      return !input.is_force && input.node == node;
    };
    const auto is_place = [&](const TapSlot& tap) { return tap.is_on_body() && tap.node == node; };
    if (std::ranges::any_of(program.taps, is_place)) {
      if (program.masses[node] >= network.masses.size()) {
        return false;  // the bridge of a modal string, which the model does not name
      }
      return known.insert(struck_name(network, program.masses[node])).second;
    }
    return node < program.moving ||
           (!program.form.is<Modes>() && std::ranges::any_of(program.inputs, is_hand));
  };
  for (const Program& program : machine.parts) {
    all += program.moving + program.inputs.size();
    waveguides += program.waveguides.size();
    if (!program.waveguides.empty()) {
      most_waveguides = std::min(most_waveguides, most_samples / waveguide_slots(program));
    }
  }
  waveguides = std::min(waveguides, most_waveguides);
  const std::size_t most_nodes = most_dots - waveguides * Engine::waveguide_points;
  const std::size_t stride = (all + most_nodes - 1) / most_nodes;
  // Inputs and outputs are always drawn.
  const auto is_port = [](const Program& program, std::size_t node) {
    const auto is_here = [&](const auto& slot) { return slot.node == node; };
    return std::ranges::any_of(program.inputs, is_here) ||
           std::ranges::any_of(program.outputs, is_here);
  };
  std::size_t room = MotionFrame::most_numbers;
  std::size_t nodes_left = most_nodes;
  std::vector<Engine::Watched> watched;
  for (const Program& program : machine.parts) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> nodes;  // Pairs of mass and node.
    for (std::uint32_t node = 0; node < program.masses.size(); ++node) {
      if ((program.masses[node] % std::max<std::size_t>(1, stride) == 0 ||
           is_port(program, node)) &&
          counts(program, node)) {
        nodes.emplace_back(program.masses[node], node);
      }
    }
    std::ranges::sort(nodes);
    nodes.resize(std::min(nodes.size(), nodes_left));
    nodes_left -= nodes.size();
    Picture::Group group{.first = picture.masses.size(), .count = nodes.size()};
    Engine::Watched& chosen = watched.emplace_back();
    for (const auto& [mass, node] : nodes) {
      chosen.nodes.push_back(node);
      picture.masses.push_back(mass);
      picture.start.push_back(program.position[node]);
    }
    const auto* const modes = program.form.get_if<Modes>();
    if (modes != nullptr && modes->modes <= room && !modes->is_crossed) {
      take_shapes(program, *modes, chosen.nodes, group);
    }
    group.waveguides = take_waveguides(program, network, chosen.nodes, group.first);
    group.waveguides.resize(std::min(group.waveguides.size(), waveguides));
    if (group.numbers() > room || (modes != nullptr && !group.is_modal) || group.numbers() == 0) {
      chosen.nodes.clear();  // The waveguide is drawn at rest.
      group.count = 0;
      group.is_modal = false;
      group.modes = 0;
      group.waveguides.clear();
    }
    chosen.waveguides = group.waveguides.size();
    waveguides -= chosen.waveguides;
    for (Picture::Waveguide& waveguide : group.waveguides) {
      waveguide.first = picture.masses.size();
      picture.masses.resize(picture.masses.size() + Engine::waveguide_points, Picture::no_mass);
      picture.start.resize(picture.masses.size(), network.macros[waveguide.macro].position);
    }
    room -= group.numbers();
    picture.groups.push_back(std::move(group));
  }
  engine.watch(std::move(watched));
  return picture;
}

void find_positions(const Picture& picture, const MotionFrame& frame, std::span<float> positions) {
  std::ranges::transform(picture.start, positions.begin(),
                         [](double x) { return static_cast<float>(x); });
  std::size_t at = 0;
  for (const Picture::Group& group : picture.groups) {
    if (at + group.numbers() > frame.count) {
      return;
    }
    const double* const numbers = frame.numbers.data() + at;
    float* const x = positions.data() + group.first;
    for (std::size_t mode = 0; mode < group.modes; ++mode) {
      // A displacement more than 160 dB below 1 is invisible.
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
    at += group.is_modal ? group.modes : group.count;
    for (const Picture::Waveguide& waveguide : group.waveguides) {
      place_waveguide(waveguide, std::span(frame.numbers).subspan(at, Engine::waveguide_points),
                      picture.start, positions);
      at += Engine::waveguide_points;
    }
  }
}

}  // namespace ressort::panel
