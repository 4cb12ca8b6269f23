#include "core/kernels/grid/grid.h"

#include <algorithm>
#include <cstdlib>
#include <map>

namespace ressort::kernels {
namespace {

std::vector<std::uint32_t> offsets_of(const Grid& grid) {
  std::vector<std::uint32_t> offsets;
  for (const GridLinks& links : grid.links) {
    offsets.insert(offsets.end(), links.offsets.begin(), links.offsets.end());
  }
  return offsets;
}

std::uint32_t furthest_offset(const Grid& grid) {
  std::int32_t furthest = 0;
  for (const GridSegment& segment : grid.segments) {
    for (const std::int32_t offset : segment.offsets) {
      furthest = std::max(furthest, std::abs(offset));
    }
  }
  return static_cast<std::uint32_t>(furthest);
}

}  // namespace

template <class T>
GridKernel<T>::GridKernel(const Program& program, const Grid& grid, std::size_t, Isa isa)
    : NodeKernel<T>(program, layout_in_rows<T>(grid.slot, grid.slots, 1, 3)),
      grid_(grid),
      step_(with_isa(isa, [&]<Isa level>() { return grid_step<level, T>(); })),
      held_(grid.links.size() * 5),
      offset_(offsets_of(grid)),
      shift_((furthest_offset(grid) + grid_line - 1) / grid_line * grid_line),
      inverse_mass_(grid.slots, grid_fixed),
      pushed_(program.taps.size() * grid_pushes) {
  for (PassiveLink& link : this->nodes_.passive.tables.links) {
    link.ends = {grid.slot[link.ends.a], grid.slot[link.ends.b]};
  }
  for (const MassRun& run : program.mass_runs) {
    for (std::uint32_t node = run.first; node < run.first + run.count; ++node) {
      inverse_mass_[grid.slot[node]] = run.inverse_mass;
    }
  }
  y_.resize(grid.segments.empty() ? 0 : grid.slots + shift_);
  link_force_.resize(offset_.size() * grid.slots);
  make_stamps(grid_pack_bytes(isa) / sizeof(T));
  this->reset_lanes();
}

// Packs with equal weights share them, so that those of a large grid stay in the first-level cache.
template <class T>
void GridKernel<T>::make_stamps(std::size_t lanes) {
  std::map<std::vector<T>, std::uint32_t> known;
  std::vector<T> weights;
  for (std::size_t at = 0; at < grid_.count; at += lanes) {
    weights.clear();
    const auto add = [&](const auto& row) {
      const auto begin = row.begin() + static_cast<std::ptrdiff_t>(at);
      weights.insert(weights.end(), begin, begin + static_cast<std::ptrdiff_t>(lanes));
    };
    add(grid_.moves);
    if (!grid_.segments.empty()) {
      add(grid_.missing);
    }
    for (const GridLinks& links : grid_.links) {
      for (const auto& is_linked : links.is_linked) {
        add(is_linked);
      }
    }
    const auto next = static_cast<std::uint32_t>(known.size());
    const auto [entry, is_new] = known.try_emplace(weights, next);
    if (is_new) {
      weights_.insert(weights_.end(), weights.begin(), weights.end());
    }
    stamp_.push_back(entry->second);
  }
}

template <class T>
void GridKernel<T>::clear(std::size_t) {
  Nodes<T>& nodes = this->nodes_;
  // Includes empty slots and all copies of a ground.
  for (std::size_t slot = 0; slot < grid_.slots; ++slot) {
    nodes.row(0)[slot] = static_cast<T>(grid_.position[slot]);
    nodes.row(1)[slot] = static_cast<T>(grid_.velocity[slot]);
  }
  nodes.fill_row(2, T(0));
  for (auto* zero : {&y_, &link_force_}) {
    std::fill(zero->begin(), zero->end(), T(0));
  }
  pushes_ = 0;
  is_fresh_ = true;
}

template <class T>
bool GridKernel<T>::copy_from(const Kernel<T>& from) {
  const auto& other = static_cast<const GridKernel&>(this->copy_nodes(from));
  y_ = other.y_;
  link_force_ = other.link_force_;
  held_ = other.held_;
  pushed_ = other.pushed_;
  pushes_ = other.pushes_;
  is_forward_ = other.is_forward_;
  is_fresh_ = other.is_fresh_;
  return true;
}

template <class T>
GridState<T> GridKernel<T>::state() {
  Nodes<T>& nodes = this->nodes_;
  return {.ramps = ramps_of(this->coefficients),
          .x = nodes.row(0),
          .v = nodes.row(1),
          .force = nodes.row(2),
          .y = y_.data() + (is_forward_ ? shift_ : 0),
          .next_y = y_.data() + (is_forward_ ? 0 : shift_),
          .shift = shift_,
          .is_forward = is_forward_,
          .link_force = link_force_.data(),
          .held = held_.data(),
          .stamp = stamp_.data(),
          .weights = weights_.data(),
          .offset = offset_.data(),
          .rows = offset_.size(),
          .is_fresh = is_fresh_,
          .inverse_mass = inverse_mass_.data(),
          .pushed = pushed_.data(),
          .pushes = pushes_,
          .corners = nodes.corners.data(),
          .passive = nodes.passive.tables,
          .memory = nodes.passive.memory.data(),
          .solver = nodes.passive.numbers.data(),
          .awake = nodes.passive.awake.data()};
}

template <class T>
void GridKernel<T>::play(const Block<T>& block) {
  GridState<T> played = state();
  step_(this->program_, grid_, played, block);
  is_forward_ = played.is_forward;
  is_fresh_ = played.is_fresh;
  pushes_ = played.pushes;
  this->coefficients.finish(block.frames);
}

template class GridKernel<float>;
template class GridKernel<double>;

}  // namespace ressort::kernels
