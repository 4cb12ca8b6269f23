#include "core/kernels/batch/batch.h"

#include <algorithm>
#include <utility>

namespace ressort::kernels {
namespace {

constexpr std::size_t most_bytes =
    std::size_t{16} * 1024;  // Memory of one kernel's cells: half of the first-level cache.

constexpr std::size_t parts_of(std::size_t whole, std::size_t part) {
  return (whole + part - 1) / part;
}

// Fills the table slot by slot.
class Filler {
 public:
  Filler(const Program& program, const Batch& batch) : program_(program), batch_(batch) {
    table_.nodes = static_cast<std::uint32_t>(program.position.size());
    if (program.moving <= most_held_masses) {
      table_.held = program.moving;
      add_held();
      note_touched();
    } else {
      add_in_memory();
    }
    table_.cells = batch_node_cells * table_.nodes + slots_;
  }

  BatchTable table() && { return std::move(table_); }

 private:
  void copy(std::uint32_t coefficient) {
    table_.copies.push_back({static_cast<std::uint32_t>(slots_), coefficient});
    ++slots_;
  }

  void add_held() {
    table_.is_alike = is_alike();
    for (const MassRun& run : program_.mass_runs) {
      for (std::uint32_t i = 0; i < run.count; ++i) {
        add_alike([&] { copy(run.inverse_mass); }, 1, slots_ == 0);
      }
      table_.is_pulled |= run.is_oscillator || run.has_gravity;
    }
    for (std::uint32_t pair = 0; pair < pairs(); ++pair) {
      add_alike([&] { add_spring(batch_.pairs[pair], 1u << pair, table_.linked); }, 2, pair == 0);
    }
    for (std::uint32_t mass = 0; mass < table_.held; ++mass) {
      add_spring(batch_.anchors[mass], 1u << mass, table_.anchored);
    }
    for (const MassRun& run : program_.mass_runs) {
      for (std::uint32_t i = 0; i < run.count && table_.is_pulled; ++i) {
        add_pull(run);
      }
    }
    table_.first_link = slots_;
    for (const BatchLink& link : batch_.links) {
      add_link(program_.link_runs[link.run]);
    }
  }

  std::uint32_t pairs() const { return table_.held * (table_.held - 1) / 2; }

  bool is_alike() const {
    const auto differs = [&](const BatchSpring& pair) {
      return pair.stiffness != batch_.pairs[0].stiffness || pair.damping != batch_.pairs[0].damping;
    };
    const auto is_other = [&](const MassRun& run) {
      return run.inverse_mass != program_.mass_runs[0].inverse_mass;
    };
    return std::none_of(program_.mass_runs.begin(), program_.mass_runs.end(), is_other) &&
           std::none_of(batch_.pairs.begin(), batch_.pairs.begin() + pairs(), differs);
  }

  // Slots that are never read: if all elements are alike, only the first has slots.
  template <class Add>
  void add_alike(Add&& add, std::size_t slots, bool is_first) {
    if (is_first || !table_.is_alike) {
      add();
    } else {
      slots_ += slots;
    }
  }

  void add_spring(const BatchSpring& spring, std::uint32_t bit, std::uint32_t& bits) {
    if (spring.stiffness == BatchSpring::none) {
      slots_ += 2;
      return;
    }
    bits |= bit;
    copy(spring.stiffness);
    copy(spring.damping);
  }

  void add_pull(const MassRun& run) {
    if (run.is_oscillator) {
      copy(run.stiffness);
      copy(run.damping);
    } else {
      slots_ += 2;
    }
    if (run.has_gravity) {
      copy(run.gravity);
    } else {
      ++slots_;
    }
  }

  void add_link(const LinkRun& run) {
    table_.laws.push_back(run.law);
    for (const std::uint32_t coefficient : run.coefficients) {
      copy(coefficient);
    }
    ++slots_;
  }

  void add_in_memory() {
    for (const MassRun& run : program_.mass_runs) {
      copy(run.inverse_mass);
      add_pull(run);
    }
    table_.first_link = slots_;
    for (const LinkRun& run : program_.link_runs) {
      if (run.scheme == Scheme::plain) {
        add_link(run);
      }
    }
  }

  void note_touched() {
    const auto touch = [&](std::uint32_t node) {
      table_.touched |= node < table_.held ? 1u << node : 0;
    };
    for (const BatchLink& link : batch_.links) {
      touch(link.a);
      touch(link.b);
    }
    for (std::uint32_t i = 0; i < program_.inputs.size(); ++i) {
      const auto [input, is_force, node] = program_.inputs[i];
      if (!is_force || node >= table_.held) {
        continue;
      }
      if ((table_.pushed >> node & 1) != 0) {
        touch(node);
      } else {
        table_.pushed |= 1u << node;
        table_.pusher[node] = i;
      }
    }
  }

  const Program& program_;
  const Batch& batch_;
  BatchTable table_;
  std::size_t slots_ = 0;
};

// Pack by pack; the cells of a node are consecutive.
NodeLayout layout_of(const BatchTable& table, std::size_t lanes) {
  NodeLayout layout{
      .row = lanes, .rows = batch_node_cells, .size = table.cells * table.packs * lanes};
  for (std::size_t node = 0; node < table.nodes; ++node) {
    layout.node.push_back(static_cast<std::uint32_t>(batch_node_cells * node * lanes));
  }
  for (std::size_t lane = 0; lane < table.packs * lanes; ++lane) {
    const std::size_t pack = lane / lanes;
    layout.lane.push_back(static_cast<std::uint32_t>(pack * table.cells * lanes + lane % lanes));
  }
  return layout;
}

}  // namespace

template <class T>
BatchKernel<T>::BatchKernel(const Program& program, const Batch& batch, std::size_t voices, Isa isa)
    : BatchKernel(
          program, batch,
          [&] {
            const std::size_t bytes = batch_lanes<T>(voices, isa) * sizeof(T);
            BatchTable table = Filler(program, batch).table();
            // Divides the voices evenly among as many kernels as needed.
            const std::size_t wanted = parts_of(voices * sizeof(T), bytes);
            const std::size_t most = std::max<std::size_t>(1, most_bytes / (table.cells * bytes));
            table.packs = parts_of(wanted, parts_of(wanted, most));
            return table;
          }(),
          batch_lanes<T>(voices, isa), isa) {}

template <class T>
BatchKernel<T>::BatchKernel(const Program& program, const Batch& batch, BatchTable table,
                            std::size_t lanes, Isa isa)
    : NodeKernel<T>(program, layout_of(table, lanes)),
      batch_(batch),
      table_(std::move(table)),
      step_(with_isa(
          isa, [&]<Isa level>() { return batch_step<level, T>(table_, lanes * sizeof(T)); })) {
  this->reset_lanes();
}

template <class T>
void BatchKernel<T>::play(const Block<T>& block) {
  auto& passive = this->nodes_.passive;
  BatchState<T> state{.ramps = ramps_of(this->coefficients),
                      .cells = this->nodes_.numbers.data(),
                      .passive = passive.tables,
                      .inverse_mass = passive.inverse_mass.data(),
                      .memory = passive.memory.data(),
                      .solver = passive.numbers.data(),
                      .awake = passive.awake.data()};
  step_(this->program_, batch_, table_, state, block);
  this->coefficients.finish(block.frames);
}

template class BatchKernel<float>;
template class BatchKernel<double>;

}  // namespace ressort::kernels
