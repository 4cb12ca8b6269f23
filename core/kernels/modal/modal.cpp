#include "core/kernels/modal/modal.h"

#include <algorithm>
#include <cmath>

namespace ressort {
namespace {

constexpr std::size_t most_rows = 16;  // of one sweep

constexpr std::size_t round_up(std::size_t count, std::size_t unit) {
  return (count + unit - 1) / unit * unit;
}

// Hands out cache-aligned arrays; the first round only counts them.
template <class T>
class Arena {
 public:
  explicit Arena(T* memory) : memory_(memory) {}
  T* take(std::size_t count) {
    T* const taken = memory_ == nullptr ? nullptr : memory_ + used_;
    used_ += round_up(count, widest_bytes / sizeof(T));
    return taken;
  }
  std::size_t used() const { return used_; }

 private:
  T* memory_;
  std::size_t used_ = 0;
};

std::size_t link_count(const Modes& modes) {
  std::size_t count = 0;
  for (const ModalHold& hold : modes.holds) {
    count += hold.a.size();
  }
  return count;
}

template <class T>
T norm_of(const std::vector<double>& shape) {
  double sum = 0.0;
  for (const double s : shape) {
    sum += s * s;
  }
  return static_cast<T>(std::sqrt(sum));
}

// The arrays of a kernel and the constant ones' content.
template <class T>
class Furnisher {
 public:
  Furnisher(const Modes& modes, Isa isa, T* memory)
      : modes_(modes),
        padded_(round_up(std::max(modes.modes, 1u), 2 * vector_bytes(isa) / sizeof(T))),
        stride_(round_up(padded_, widest_bytes / sizeof(T))),
        arena_(memory) {}

  std::size_t furnish(ModalState<T>& state) {
    const std::size_t places = modes_.places.size();
    const std::size_t ends = places + modes_.ends.size();
    const std::size_t observed = places + modes_.outputs.size();
    state.modes = padded_;
    state.stride = stride_;
    for (T** row : {&state.q, &state.d, &state.k, &state.z, &state.load, &state.saved_q,
                    &state.saved_d, &state.spread, &state.decay, &state.swing, &state.debt}) {
      *row = arena_.take(stride_);
    }
    state.held_give = arena_.take(link_count(modes_));
    state.loudness = arena_.take(observed);
    state.room = arena_.take(observed);
    state.stiffness = rows(
        modes_.stiffness, [](auto& share) -> auto& { return share.factor; });
    state.damping = rows(
        modes_.damping, [](auto& share) -> auto& { return share.factor; });
    state.pushes = rows(
        modes_.pushes, [](auto& push) -> auto& { return push.shape; });
    state.places = rows(
        modes_.places, [](auto& place) -> auto& { return place.shape; });
    state.outputs = rows(
        modes_.outputs, [](auto& output) -> auto& { return output.place.shape; });
    if (modes_.is_exact) {
      for (T** row : {&state.root, &state.k_step, &state.z_step}) {
        *row = arena_.take(stride_);
      }
      const std::size_t count = shape_count() * stride_;
      T* const shape = arena_.take(count);
      if (shape != nullptr) {
        std::copy_n(state.pushes, count, shape);
      }
      state.shape = shape;
    }
    state.push_norm = norms(
        modes_.pushes, [](auto& push) -> auto& { return push.shape; });
    state.place_norm = norms(
        modes_.places, [](auto& place) -> auto& { return place.shape; });
    state.used = arena_.take(modes_.stiffness.size() + modes_.damping.size() + 1);
    state.late = arena_.take(modes_.pushes.size());
    state.amplitude = arena_.take(max_block_frames * modes_.pushes.size());
    state.compliance = arena_.take(places);
    state.x = arena_.take(ends);
    state.v = arena_.take(ends);
    state.force = arena_.take(ends);
    state.saved_force = arena_.take(places);
    state.kicked = arena_.take(places);
    state.kick = arena_.take(most_rows + places + modes_.pushes.size());
    state.speed = arena_.take(most_rows + places + modes_.pushes.size());
    state.heard = arena_.take(most_rows + modes_.outputs.size());
    state.bundle = arena_.take(most_rows * stride_);
    state.seen = arena_.take(max_block_frames * observed);
    return arena_.used();
  }

 private:
  std::size_t shape_count() const {
    return modes_.pushes.size() + modes_.places.size() + modes_.outputs.size();
  }
  template <class Items, class ShapeOf>
  T* rows(const Items& items, ShapeOf&& shape_of) {
    T* const first = arena_.take(items.size() * stride_);
    for (std::size_t i = 0; first != nullptr && i < items.size(); ++i) {
      const std::vector<double>& shape = shape_of(items[i]);
      std::transform(shape.begin(), shape.end(), first + i * stride_,
                     [](double s) { return static_cast<T>(s); });
    }
    return first;
  }
  template <class Items, class ShapeOf>
  const T* norms(const Items& items, ShapeOf&& shape_of) {
    T* const first = arena_.take(items.size());
    for (std::size_t i = 0; first != nullptr && i < items.size(); ++i) {
      first[i] = norm_of<T>(shape_of(items[i]));
    }
    return first;
  }

  const Modes& modes_;
  std::size_t padded_;
  std::size_t stride_;
  Arena<T> arena_;
};

}  // namespace

template <class T>
ModalKernel<T>::ModalKernel(const Program& program, const Modes& modes, std::size_t, Isa isa)
    : Kernel<T>(program, 1),
      program_(program),
      modes_(modes),
      step_(with_isa(isa, [&]<Isa level>() { return modal_step<level, T>(); })),
      rows_(modes.places.size() + modes.pushes.size() + modes.outputs.size() + most_rows),
      bundled_rows_(rows_.size()),
      indices_(modes.pushes.size() + 2 * modes.places.size() + modes.holds.size()),
      held_ends_(link_count(modes)),
      state_{} {
  numbers_.resize(Furnisher<T>(modes, isa, nullptr).furnish(state_));
  Furnisher<T>(modes, isa, numbers_.data()).furnish(state_);
  state_.rows = rows_.data();
  state_.bundled_rows = bundled_rows_.data();
  state_.push_of = indices_.data();
  state_.row_of = state_.push_of + modes.pushes.size();
  state_.place_of = state_.row_of + modes.places.size();
  state_.held = state_.place_of + modes.places.size();
  state_.held_ends = held_ends_.data();
  state_.silence = static_cast<T>(modes.silence);
  state_.quiet = static_cast<T>(modes.quiet);
  state_.lately_kept =
      static_cast<T>(std::pow(1e-3, static_cast<double>(check_frames) / program.rate_hz));
  this->reset(0);
}

template <class T>
void ModalKernel<T>::set_state(std::size_t, const double* x, const double* v) {
  const std::size_t places = modes_.places.size();
  const double* basis = modes_.basis.data();
  // Where the model starts, nothing is displaced.
  const bool is_start = x == program_.position.data() && v == program_.velocity.data();
  for (std::size_t i = 0; i < modes_.modes; ++i) {
    double q = modes_.q[i];
    double d = modes_.d[i];
    for (std::size_t node = 0; !is_start && node < program_.moving; ++node, ++basis) {
      q += *basis * (x[node] - program_.position[node]);
      d += *basis * (v[node] - program_.velocity[node]);
    }
    state_.q[i] = static_cast<T>(q);
    state_.d[i] = static_cast<T>(d);
  }
  for (std::size_t i = 0; i < modes_.ends.size(); ++i) {
    state_.x[places + i] = static_cast<T>(x[modes_.ends[i].node]);
    state_.v[places + i] = T(0);
  }
  // No link has computed anything yet: in the first sample there is nothing to feel.
  std::fill_n(state_.used, modes_.stiffness.size() + modes_.damping.size() + 1, T(0));
  std::fill_n(state_.late, modes_.pushes.size(), T(0));
  std::fill_n(state_.force, places + modes_.ends.size(), T(0));
  state_.touched_frames = 0;
  state_.surprised_frames = 0;
  state_.kick_norm = T(0);
  if (modes_.is_exact) {
    std::fill_n(state_.root, state_.modes, T(1));
  }
  state_.is_stale = true;
  state_.fresh_frames = 0;
  state_.awake = modes_.modes;
  state_.swept = state_.modes;
  state_.until_check = check_frames;
  state_.is_long_check = false;
  std::fill_n(state_.debt, state_.modes, T(0));
  std::fill_n(state_.loudness, places + modes_.outputs.size(), T(0));
}

template <class T>
Awake ModalKernel<T>::awake() const {
  return {state_.awake, modes_.modes};
}

template <class T>
double ModalKernel<T>::owed(std::size_t listener) const {
  const std::size_t places = modes_.places.size();
  const T* const row = listener < places ? state_.places + listener * state_.stride
                                         : state_.outputs + (listener - places) * state_.stride;
  double sum = 0.0;
  for (std::size_t i = 0; i < modes_.modes; ++i) {
    sum += std::fabs(static_cast<double>(row[i])) * static_cast<double>(state_.debt[i]);
  }
  return sum;
}

template <class T>
bool ModalKernel<T>::save(std::size_t, double*, double*) const {
  return false;
}

template <class T>
void ModalKernel<T>::play(const Block<T>& block) {
  state_.ramps = ramps_of(this->coefficients);
  step_(program_, modes_, state_, block);
  this->coefficients.finish(block.frames);
}

template <class T>
bool ModalKernel<T>::is_near_start(std::size_t, double bound) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < modes_.modes; ++i) {
    const double root = modes_.is_exact ? static_cast<double>(state_.root[i]) : 1.0;
    const double moved = root * static_cast<double>(state_.q[i]) - modes_.q[i];
    sum += moved * moved;
  }
  return modes_.reach * std::sqrt(sum) < bound;
}

template class ModalKernel<float>;
template class ModalKernel<double>;

}  // namespace ressort
