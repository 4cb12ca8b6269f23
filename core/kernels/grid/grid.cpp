#include "core/kernels/grid/grid.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>

namespace ressort {
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
    : Kernel<T>(program, 1),
      program_(program),
      grid_(grid),
      step_(with_isa(isa, [&]<Isa level>() { return grid_step<level, T>(); })),
      x_(grid.slots),
      v_(grid.slots),
      force_(grid.slots),
      held_(grid.links.size() * 5),
      offset_(offsets_of(grid)),
      shift_((furthest_offset(grid) + grid_line - 1) / grid_line * grid_line),
      inverse_mass_(grid.slots, grid_fixed),
      pushed_(program.taps.size() * grid_pushes),
      corners_(program.taps.size()),
      passive_(passive_links(program)),
      memory_(passive_.size() * passive_rows) {
  for (PassiveLink& link : passive_) {
    link.ends = {grid.slot[link.ends.a], grid.slot[link.ends.b]};
  }
  for (const MassRun& run : program.mass_runs) {
    for (std::uint32_t node = run.first; node < run.first + run.count; ++node) {
      inverse_mass_[grid.slot[node]] = run.inverse_mass;
    }
  }
  y_.resize(grid.segments.empty() ? 0 : grid.slots + shift_);
  link_force_.resize(offset_.size() * grid.slots);
  make_stamps(grid_bytes(vector_bytes(isa)) / sizeof(T));
  this->reset(0);
}

// Packs that have the same weights share them: in a large grid they stay in the nearest cache.
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
void GridKernel<T>::set_state(std::size_t, const double* x, const double* v) {
  for (std::size_t slot = 0; slot < grid_.slots; ++slot) {  // empty ones and all of a ground's too
    x_[slot] = static_cast<T>(grid_.position[slot]);
    v_[slot] = static_cast<T>(grid_.velocity[slot]);
  }
  for (std::size_t node = 0; node < grid_.slot.size(); ++node) {
    if (grid_.slot[node] < grid_.slots) {
      x_[grid_.slot[node]] = static_cast<T>(x[node]);
      v_[grid_.slot[node]] = static_cast<T>(v[node]);
    }
  }
  for (auto* zero : {&force_, &y_, &link_force_}) {
    std::fill(zero->begin(), zero->end(), T(0));
  }
  pushes_ = 0;
  is_fresh_ = true;
  awake_ = T(0);
}

template <class T>
bool GridKernel<T>::save(std::size_t, double* x, double* v) const {
  for (std::size_t node = 0; node < grid_.slot.size(); ++node) {
    const bool is_there = grid_.slot[node] < grid_.slots;
    x[node] = is_there ? static_cast<double>(x_[grid_.slot[node]]) : 0.0;
    v[node] = is_there ? static_cast<double>(v_[grid_.slot[node]]) : 0.0;
  }
  return true;
}

template <class T>
bool GridKernel<T>::read(std::span<const std::uint32_t> nodes, T* x, T* v) const {
  for (const std::uint32_t node : nodes) {
    const std::size_t slot = grid_.slot[node];
    *x++ = slot < grid_.slots ? x_[slot] : T(0);
    *v++ = slot < grid_.slots ? v_[slot] : T(0);
  }
  return true;
}

template <class T>
bool GridKernel<T>::write_nodes(std::span<const std::uint32_t> nodes, const T* x, const T* v) {
  const bool is_sum = !grid_.segments.empty();
  const auto coefficient = [&](std::size_t i) {
    return is_sum ? this->coefficients.value[program_.link_runs[grid_.spring_run].coefficients[i]]
                  : T(0);
  };
  const T stiffness = coefficient(0);
  const T damping = coefficient(1);
  for (const std::uint32_t node : nodes) {
    const T here = *x++;
    const T speed = *v++;
    if (const std::size_t slot = grid_.slot[node]; slot < grid_.slots) {
      x_[slot] = here;
      v_[slot] = speed;
      if (is_sum && slot - grid_.first < grid_.count) {
        y_[slot + (is_forward_ ? shift_ : 0)] = stiffness * here + damping * speed;
      }
    }
  }
  std::fill(force_.begin(), force_.end(), T(0));
  pushes_ = 0;
  awake_ = T(1);
  this->step({});
  return true;
}

template <class T>
void GridKernel<T>::play(const Block<T>& block) {
  GridState<T> state{.ramps = ramps_of(this->coefficients),
                     .x = x_.data(),
                     .v = v_.data(),
                     .force = force_.data(),
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
                     .corners = corners_.data(),
                     .passive = passive_,
                     .memory = memory_.data(),
                     .awake = &awake_};
  step_(program_, grid_, state, block);
  is_forward_ = state.is_forward;
  is_fresh_ = state.is_fresh;
  pushes_ = state.pushes;
  this->coefficients.finish(block.frames);
}

template <class T>
bool GridKernel<T>::is_near_start(std::size_t, double bound) const {
  for (std::size_t node = 0; node < program_.moving; ++node) {
    const std::size_t slot = grid_.slot[node];
    if (!(std::fabs(static_cast<double>(x_[slot]) - grid_.position[slot]) < bound)) {
      return false;
    }
  }
  return true;
}

template class GridKernel<float>;
template class GridKernel<double>;

}  // namespace ressort
