#include "core/engine/chorus.h"

#include <algorithm>
#include <cmath>

namespace ressort {
namespace {

// Of one pack: the narrowest that holds the voices, or the widest that there is. Where there are
// registers enough, two of them are worked on as one.
template <class T>
std::size_t pack_bytes(std::size_t voices, Isa isa) {
  const std::size_t widest = isa == Isa::v4 ? 2 * vector_bytes(isa) : vector_bytes(isa);
  std::size_t bytes = 16;
  while (bytes < widest && bytes / sizeof(T) < voices) {
    bytes *= 2;
  }
  return bytes;
}

// As many packs as the voices need, and fit.
template <class T>
std::size_t chorus_width(std::size_t voices, Isa isa) {
  const std::size_t bytes = pack_bytes<T>(voices, isa);
  const std::size_t lanes = bytes / sizeof(T);
  return lanes * std::min(chorus_bytes / bytes, (voices + lanes - 1) / lanes);
}

void add_masses(const Program& program, ChorusTable& table) {
  for (const MassRun& run : program.mass_runs) {
    table.slots.insert(table.slots.end(), run.count, run.inverse_mass);
    table.is_pulled |= run.is_oscillator || run.has_gravity;
  }
}

void add_held(const Program& program, const Chorus& chorus, ChorusTable& table) {
  const auto add = [&](std::uint32_t run, std::uint32_t bit, std::uint32_t& bits) {
    const bool is_there = run != ChorusAnchor::none;
    bits |= is_there ? bit : 0;
    for (std::size_t k = 0; k < 2; ++k) {
      table.slots.push_back(is_there ? program.link_runs[run].coefficients[k] : chorus_zero);
    }
  };
  for (std::uint32_t pair = 0; pair < table.held * (table.held - 1) / 2; ++pair) {
    add(chorus.pairs[pair], 1u << pair, table.linked);
  }
  for (std::uint32_t mass = 0; mass < table.held; ++mass) {
    add(chorus.anchors[mass].run, 1u << mass, table.anchored);
  }
}

void add_pushes(const Program& program, ChorusTable& table) {
  for (std::uint32_t i = 0; i < program.inputs.size(); ++i) {
    const InputSlot& input = program.inputs[i];
    if (input.is_force && input.node < table.held && (table.pushed >> input.node & 1) == 0) {
      table.pushed |= 1u << input.node;
      table.pusher[input.node] = i;
    }
  }
}

void add_pulls(const Program& program, ChorusTable& table) {
  for (const MassRun& run : program.mass_runs) {
    for (std::uint32_t i = 0; i < run.count && table.is_pulled; ++i) {
      table.pulls.push_back(run.is_oscillator ? run.stiffness : chorus_zero);
      table.pulls.push_back(run.is_oscillator ? run.damping : chorus_zero);
      table.pulls.push_back(run.has_gravity ? run.gravity : chorus_zero);
    }
  }
}

ChorusTable table_of(const Program& program, const Chorus& chorus, std::size_t packs) {
  ChorusTable table{.masses = program.moving,
                    .nodes = static_cast<std::uint32_t>(program.position.size()),
                    .packs = static_cast<std::uint32_t>(packs),
                    .held = program.moving <= most_held_masses ? program.moving : 0};
  add_masses(program, table);
  add_held(program, chorus, table);
  add_pushes(program, table);
  add_pulls(program, table);
  table.first_node = chorus_slots(table.masses, table.held);
  table.first_pull = table.first_node + 3 * table.nodes;
  table.first_link = table.first_pull + static_cast<std::uint32_t>(table.pulls.size());
  table.cells =
      table.first_link + static_cast<std::uint32_t>(chorus.links.size()) * chorus_link_slots;
  return table;
}

}  // namespace

template <class T>
ChorusKernel<T>::ChorusKernel(const Program& program, const Chorus& chorus, std::size_t voices,
                              Isa isa)
    : Kernel<T>(program, chorus_width<T>(voices, isa)),
      program_(program),
      chorus_(chorus),
      lanes_(pack_bytes<T>(voices, isa) / sizeof(T)),
      table_(table_of(program, chorus, this->width() / lanes_)),
      step_(with_isa(
          isa,
          [&]<Isa level>() { return chorus_step<level, T>(table_.held, lanes_ * sizeof(T)); })),
      cells_(table_.cells * this->width()) {
  for (std::size_t lane = 0; lane < this->width(); ++lane) {
    this->reset(lane);
  }
}

template <class T>
void ChorusKernel<T>::place(std::size_t lane, const double* x, const double* v) {
  for (std::size_t node = 0; node < table_.nodes; ++node) {
    T* const cell = cells_.data() + at(node, lane);
    cell[0] = static_cast<T>(x[node]);
    cell[lanes_] = static_cast<T>(v[node]);
    cell[2 * lanes_] = T(0);
  }
}

template <class T>
bool ChorusKernel<T>::save(std::size_t lane, double* x, double* v) const {
  for (std::size_t node = 0; node < table_.nodes; ++node) {
    const T* const cell = cells_.data() + at(node, lane);
    x[node] = static_cast<double>(cell[0]);
    v[node] = static_cast<double>(cell[lanes_]);
  }
  return true;
}

template <class T>
void ChorusKernel<T>::play(const Block<T>& block) {
  ChorusState<T> state{.ramps = ramps_of(this->coefficients), .cells = cells_.data()};
  step_(program_, chorus_, table_, state, block);
  this->coefficients.finish(block.frames);
}

template <class T>
bool ChorusKernel<T>::is_near_start(std::size_t lane, double bound) const {
  for (std::size_t node = 0; node < table_.masses; ++node) {
    if (!(std::fabs(static_cast<double>(cells_[at(node, lane)]) - program_.position[node]) <
          bound)) {
      return false;
    }
  }
  return true;
}

template class ChorusKernel<float>;
template class ChorusKernel<double>;

}  // namespace ressort
