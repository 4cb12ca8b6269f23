#include "core/kernels/sparse/sparse.h"

#include <algorithm>
#include <cmath>

namespace ressort {

template <class T>
SparseKernel<T>::SparseKernel(const Program& program, const Sparse& sparse, Isa isa)
    : Kernel<T>(program, 1),
      program_(program),
      sparse_(sparse),
      step_(with_isa(isa, [&]<Isa level>() { return sparse_step<level, T>(); })),
      lanes_(sparse_bytes(vector_bytes(isa)) / sizeof(T)),
      slot_(program.position.size()),
      pinned_(program.coefficients.size()) {
  make_slots();
  make_laws();
  make_lists();
  make_pins();
  x_.resize(slots_);
  v_.resize(slots_);
  force_.resize(slots_);
  pairs_.resize(laws_.empty() ? 0 : 2 * slots_);
  signals_.resize(slots_ + others_.size() + lanes_);
  this->reset(0);
}

template <class T>
void SparseKernel<T>::make_slots() {
  moving_ = round_up(program_.moving);
  slots_ = moving_ + round_up(program_.position.size() - program_.moving);
  for (std::uint32_t i = 0; i < sparse_.order.size(); ++i) {
    slot_[sparse_.order[i]] = i;
  }
  for (std::uint32_t node = program_.moving; node < slot_.size(); ++node) {
    slot_[node] = static_cast<std::uint32_t>(moving_) + node - program_.moving;
  }
  heard_.resize(slots_);
  for (const MassRun& run : program_.mass_runs) {
    is_pulled_ = is_pulled_ || run.is_oscillator || run.has_gravity;
  }
  held_.resize((is_pulled_ ? 4 : 1) * moving_);
  for (const MassRun& run : program_.mass_runs) {
    for (std::uint32_t node = run.first; node < run.first + run.count; ++node) {
      pin(run.inverse_mass, slot_[node]);
      if (run.is_oscillator) {
        pin(run.stiffness, moving_ + slot_[node]);
        pin(run.damping, 2 * moving_ + slot_[node]);
      }
      if (run.has_gravity) {
        pin(run.gravity, 3 * moving_ + slot_[node]);
      }
    }
  }
}

template <class T>
void SparseKernel<T>::make_laws() {
  for (const auto& links : sparse_.rest) {
    SparseLaw law{.law = program_.link_runs[links.front().run].law,
                  .first = static_cast<std::uint32_t>(owners_.size()),
                  .row = static_cast<std::uint32_t>(others_.size() / lanes_),
                  .held = static_cast<std::uint32_t>(held_.size())};
    const bool is_one_run = std::all_of(links.begin(), links.end(), [&](const SparseLink& link) {
      return link.run == links.front().run;
    });
    law.stride = static_cast<std::uint32_t>(is_one_run ? 0 : 5 * lanes_);
    make_rows(links, law);
    laws_.push_back(law);
  }
}

template <class T>
void SparseKernel<T>::make_rows(const std::vector<SparseLink>& links, SparseLaw& law) {
  std::vector<std::vector<SparseLink>> owned(moving_);
  for (const SparseLink& link : links) {
    const auto [a, b] = program_.ends[link.link];
    owned[slot_[link.is_reversed ? b : a]].push_back(link);
  }
  for (std::size_t first = 0; first < moving_; first += lanes_) {
    std::size_t rows = 0;
    for (std::size_t slot = first; slot < first + lanes_; ++slot) {
      rows = std::max(rows, owned[slot].size());
    }
    if (rows == 0) {
      continue;
    }
    owners_.push_back({static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(rows)});
    ++law.count;
    for (std::size_t row = 0; row < rows; ++row) {
      if (law.stride > 0 || held_.size() == law.held) {
        held_.resize(held_.size() + 5 * lanes_);
      }
      for (std::size_t lane = 0; lane < lanes_; ++lane) {
        const auto& mine = owned[first + lane];
        row < mine.size() ? add_link(mine[row], lane) : add_nothing(links.front(), first, lane);
      }
    }
  }
}

// To the last row.
template <class T>
void SparseKernel<T>::add_link(const SparseLink& link, std::size_t lane) {
  const auto [a, b] = program_.ends[link.link];
  const std::uint32_t other = slot_[link.is_reversed ? a : b];
  heard_[other].push_back(static_cast<std::uint32_t>(slots_ + others_.size()));
  others_.push_back(2 * other);
  signs_.push_back(link.is_reversed ? T(-1) : T(1));
  pin_all(link, lane);
}

// A lane without a link: what it computes, with somebody's coefficients, is thrown away.
template <class T>
void SparseKernel<T>::add_nothing(const SparseLink& like, std::size_t slot, std::size_t lane) {
  others_.push_back(static_cast<std::uint32_t>(2 * slot));
  signs_.push_back(T(0));
  pin_all(like, lane);
}

template <class T>
void SparseKernel<T>::pin_all(const SparseLink& link, std::size_t lane) {
  const std::size_t first = held_.size() - 5 * lanes_;
  for (std::size_t i = 0; i < 5; ++i) {
    pin(program_.link_runs[link.run].coefficients[i], first + i * lanes_ + lane);
  }
}

// A mass's own, and those of what stands where its force is heard.
template <class T>
void SparseKernel<T>::make_lists() {
  std::vector<std::vector<std::uint32_t>> around(slots_);
  if (sparse_.springs != Sparse::none) {
    const LinkRun& run = program_.link_runs[sparse_.springs];
    for (std::uint32_t link = run.first; link < run.first + run.count; ++link) {
      const std::uint32_t a = slot_[program_.ends[link].a];
      const std::uint32_t b = slot_[program_.ends[link].b];
      around[a].push_back(b);
      around[b].push_back(a);
    }
  }
  std::vector<bool> is_wanted(slots_);
  std::fill_n(is_wanted.begin(), moving_, true);
  for (const OutputSlot& output : program_.outputs) {
    is_wanted[slot_[output.node]] = is_wanted[slot_[output.node]] || output.is_force;
  }
  // Lanes that have fewer than others look up their own y, or a zero.
  const auto add = [&](std::size_t first, const auto& signals, bool is_own) {
    lists_.push_back(static_cast<std::uint32_t>(looked_up_.size()));
    std::size_t rows = 0;
    for (std::size_t slot = first; slot < first + lanes_; ++slot) {
      rows = std::max(rows, is_wanted[slot] ? signals[slot].size() : 0);
    }
    for (std::size_t row = 0; row < rows; ++row) {
      for (std::size_t slot = first; slot < first + lanes_; ++slot) {
        const std::size_t nothing = is_own ? slot : slots_ + others_.size();
        looked_up_.push_back(row < signals[slot].size() ? signals[slot][row]
                                                        : static_cast<std::uint32_t>(nothing));
      }
    }
  };
  for (std::size_t first = 0; first < slots_; first += lanes_) {
    add(first, around, true);
    add(first, heard_, false);
  }
  lists_.push_back(static_cast<std::uint32_t>(looked_up_.size()));
  heard_ = {};
}

template <class T>
void SparseKernel<T>::pin(std::uint32_t coefficient, std::size_t place) {
  auto& places = pinned_[coefficient];
  if (places.empty() || places.back() != place) {
    places.push_back(static_cast<std::uint32_t>(place));
  }
}

template <class T>
void SparseKernel<T>::make_pins() {
  for (auto& places : pinned_) {
    std::sort(places.begin(), places.end());
    places.erase(std::unique(places.begin(), places.end()), places.end());
    pins_.push_back(
        {static_cast<std::uint32_t>(places_.size()), static_cast<std::uint32_t>(places.size())});
    places_.insert(places_.end(), places.begin(), places.end());
  }
  pinned_ = {};
}

template <class T>
void SparseKernel<T>::place(std::size_t, const double* x, const double* v) {
  for (std::size_t node = 0; node < slot_.size(); ++node) {
    x_[slot_[node]] = static_cast<T>(x[node]);
    v_[slot_[node]] = static_cast<T>(v[node]);
  }
  std::fill(force_.begin(), force_.end(), T(0));
  std::fill(signals_.begin(), signals_.end(), T(0));
}

template <class T>
bool SparseKernel<T>::save(std::size_t, double* x, double* v) const {
  for (std::size_t node = 0; node < slot_.size(); ++node) {
    x[node] = static_cast<double>(x_[slot_[node]]);
    v[node] = static_cast<double>(v_[slot_[node]]);
  }
  return true;
}

template <class T>
void SparseKernel<T>::play(const Block<T>& block) {
  SparseState<T> state{.ramps = ramps_of(this->coefficients),
                       .x = x_.data(),
                       .v = v_.data(),
                       .pairs = pairs_.data(),
                       .force = force_.data(),
                       .signals = signals_.data(),
                       .held = held_.data(),
                       .is_pulled = is_pulled_,
                       .moving = moving_,
                       .slots = slots_,
                       .slot = slot_.data(),
                       .lists = lists_.data(),
                       .looked_up = looked_up_.data(),
                       .pins = pins_.data(),
                       .places = places_.data(),
                       .laws = laws_.data(),
                       .law_count = laws_.size(),
                       .owners = owners_.data(),
                       .others = others_.data(),
                       .signs = signs_.data()};
  step_(program_, sparse_, state, block);
  this->coefficients.finish(block.frames);
}

template <class T>
bool SparseKernel<T>::is_near_start(std::size_t, double bound) const {
  for (std::size_t node = 0; node < program_.moving; ++node) {
    const auto x = static_cast<double>(x_[slot_[node]]);
    if (!(std::fabs(x - program_.position[node]) < bound)) {
      return false;
    }
  }
  return true;
}

template class SparseKernel<float>;
template class SparseKernel<double>;

}  // namespace ressort
