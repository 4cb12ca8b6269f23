#include "core/kernels/modal/modal.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <utility>

namespace ressort::kernels {
namespace {

constexpr std::size_t most_rows = 16;  // limit for one sweep

constexpr std::size_t round_up(std::size_t count, std::size_t unit) {
  return (count + unit - 1) / unit * unit;
}

// Allocates cache-aligned arrays from one block. Without memory it only counts.
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

// Returns the links that are not plain, with the ends of the form.
std::vector<PassiveLink> passive_links(const Program& program, const Modes& modes) {
  std::vector<PassiveLink> links;
  for (const ModalHold& hold : modes.holds) {
    const LinkRun& run = program.link_runs[hold.run];
    for (std::size_t i = 0; run.scheme != Scheme::plain && i < hold.a.size(); ++i) {
      links.push_back(
          {.law = run.law, .coefficients = run.coefficients, .ends = {hold.a[i], hold.b[i]}});
    }
  }
  return links;
}

template <class T>
T norm_of(const std::vector<double>& shape) {
  double sum = 0.0;
  for (const double s : shape) {
    sum += s * s;
  }
  return static_cast<T>(std::sqrt(sum));
}

// Lays out the arrays of a kernel, and fills those that are constant.
template <class T>
class StateLayout {
 public:
  StateLayout(const Program& program, const Modes& modes, std::size_t passives, Isa isa, T* memory)
      : program_(program),
        modes_(modes),
        passives_(passives),
        lanes_(vector_bytes(isa) / sizeof(T)),
        padded_(round_up(std::max(modes.modes, 1u), 2 * lanes_)),
        stride_(round_up(padded_, widest_bytes / sizeof(T))),
        row_(modes.is_crossed ? 2 * stride_ : stride_),
        arena_(memory) {}

  std::size_t furnish(ModalState<T>& state) {
    const std::size_t places = modes_.places.size();
    const std::size_t ends = places + modes_.ends.size();
    const std::size_t observed = places + modes_.outputs.size();
    state.shapes.modes = padded_;
    state.shapes.stride = stride_;
    state.shapes.row = row_;
    // Constant numbers.
    state.shapes.stiffness = factors(modes_.stiffness);
    state.shapes.damping = factors(modes_.damping);
    if (modes_.is_crossed) {
      state.shapes.speeds = rows(
          modes_.places, [](auto& place) -> auto& { return place.speed; });
      state.shapes.pole = rows(
          std::array{&modes_.pole}, [](auto& pole) -> auto& { return *pole; });
    }
    state.shapes.push_norm = norms(
        modes_.pushes, [](auto& push) -> auto& { return push.shape; });
    state.shapes.place_norm = norms(
        modes_.places, [](auto& place) -> auto& { return place.shape; });
    state.passive.give = gives();
    take_shapes(state.shapes);
    // Numbers that a copy of the kernel needs, from motion.q to saved.q.
    for (T** row :
         {&state.motion.q, &state.motion.d, &state.motion.k, &state.motion.z, &state.sleep.spread,
          &state.sleep.decay, &state.sleep.amplitude, &state.sleep.debt}) {
      *row = arena_.take(stride_);
    }
    state.sweep.load = arena_.take(row_);
    state.held.give = arena_.take(link_count(modes_));
    state.sleep.loudness = arena_.take(observed);
    state.sleep.room = arena_.take(observed);
    if (modes_.is_exact && !modes_.is_crossed) {
      for (T** row : {&state.motion.root, &state.motion.k_step, &state.motion.z_step}) {
        *row = arena_.take(stride_);
      }
      state.shapes.unscaled = state.shapes.pushes;
      take_shapes(state.shapes);
    }
    state.motion.used = arena_.take(modes_.stiffness.size() + modes_.damping.size() + 1);
    state.inputs.late = arena_.take(modes_.pushes.size());
    state.ends.compliance = arena_.take(places);
    state.ends.soft_speed = arena_.take(stride_);
    state.ends.x = arena_.take(ends);
    state.ends.v = arena_.take(ends);
    state.ends.force = arena_.take(ends);
    state.ends.kicked = arena_.take(places);
    state.sweep.kick = arena_.take(most_rows + places + modes_.pushes.size());
    state.sweep.speed = arena_.take(most_rows + places + modes_.pushes.size());
    state.sweep.heard = arena_.take(most_rows + modes_.outputs.size());
    state.forces.count = static_cast<std::size_t>(
        std::count_if(modes_.outputs.begin(), modes_.outputs.end(),
                      [](const ModalOutput& output) { return output.is_force; }));
    state.forces.rows = arena_.take(2 * state.forces.count * stride_);
    state.forces.still = arena_.take(state.forces.count);
    state.forces.damped = arena_.take(state.forces.count);
    state.forces.before = arena_.take(state.forces.count);
    state.inputs.are_forces =
        std::all_of(modes_.pushes.begin(), modes_.pushes.end(),
                    [](const ModalPush& push) { return push.by == ModalPush::By::force; });
    state.ends.exerted = arena_.take(ends);
    state.passive.shove = arena_.take(places);
    state.passive.count = passives_;
    state.passive.reply = arena_.take(observed * passives_);
    state.passive.gamma = arena_.take(passives_ * passives_);
    state.passive.straight =
        arena_.take(passives_ > 0 ? (2 * most_straight + 1) * most_straight : 0);
    state.passive.memory = arena_.take(passive_rows * passives_);
    state.passive.pushed = arena_.take(passives_);
    for (T** row : {&state.passive.opening, &state.passive.rush, &state.passive.slack,
                    &state.passive.yield, &state.passive.yield_step}) {
      *row = arena_.take(passives_);
    }
    // Numbers of one block.
    for (T** row : {&state.saved.q, &state.saved.d}) {
      *row = arena_.take(stride_);
    }
    state.saved.force = arena_.take(places);
    state.saved.x = arena_.take(ends);
    state.saved.v = arena_.take(ends);
    state.saved.yield = arena_.take(passives_);
    state.saved.yield_step = arena_.take(passives_);
    state.inputs.amplitude = arena_.take(max_block_frames * modes_.pushes.size());
    state.sweep.bundle = arena_.take(most_rows * row_);
    state.sweep.seen = arena_.take(max_block_frames * (observed + state.forces.count));
    const Cluster all{.count = static_cast<std::uint32_t>(passives_)};
    state.passive.numbers = arena_.take(all.numbers());
    return arena_.used();
  }

 private:
  void take_shapes(ModalShapes<T>& shapes) {
    shapes.pushes = rows(
        modes_.pushes, [](auto& push) -> auto& { return push.shape; });
    shapes.places = rows(
        modes_.places, [](auto& place) -> auto& { return place.shape; });
    shapes.outputs = rows(
        modes_.outputs, [](auto& output) -> auto& { return output.place.shape; });
  }
  const T* gives() {
    T* const first = arena_.take(passives_);
    T* next = first;
    for (const ModalHold& hold : modes_.holds) {
      if (first != nullptr && program_.link_runs[hold.run].scheme != Scheme::plain) {
        next = std::transform(hold.give.begin(), hold.give.end(), next,
                              [](double give) { return static_cast<T>(give); });
      }
    }
    return first;
  }
  // Returns the factors of all shares, for each share only the packs in which it has any.
  const T* factors(const std::vector<ModalShare>& shares) {
    const auto room = [&](const ModalShare& share) {
      return round_up(share.first % lanes_ + share.factor.size(), lanes_);
    };
    std::size_t count = 0;
    for (const ModalShare& share : shares) {
      count += room(share);
    }
    T* const first = arena_.take(count);
    T* row = first;
    for (const ModalShare& share : shares) {
      if (first != nullptr) {
        std::transform(share.factor.begin(), share.factor.end(), row + share.first % lanes_,
                       [](double factor) { return static_cast<T>(factor); });
        row += room(share);
      }
    }
    return first;
  }
  // Returns rows of shapes. A shape of crossed modes has two parts.
  template <class Items, class ShapeOf>
  T* rows(const Items& items, ShapeOf&& shape_of) {
    T* const first = arena_.take(items.size() * row_);
    for (std::size_t i = 0; first != nullptr && i < items.size(); ++i) {
      const std::vector<double>& shape = shape_of(items[i]);
      for (std::size_t n = 0; n < shape.size(); ++n) {
        const std::size_t part = n / modes_.modes;
        first[i * row_ + part * stride_ + n % modes_.modes] = static_cast<T>(shape[n]);
      }
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

  const Program& program_;
  const Modes& modes_;
  std::size_t passives_;
  std::size_t lanes_;
  std::size_t padded_;
  std::size_t stride_;
  std::size_t row_;
  Arena<T> arena_;
};

}  // namespace

template <class T>
ModalKernel<T>::ModalKernel(const Program& program, const Modes& modes, std::size_t, Isa isa)
    : Kernel<T>(program, 1),
      program_(program),
      modes_(modes),
      step_(with_isa(isa, [&]<Isa level>() { return modal_step<level, T>(modes.is_crossed); })),
      rows_(modes.places.size() + modes.pushes.size() + 2 * modes.outputs.size() + most_rows),
      bundled_rows_(rows_.size()),
      indices_(modes.pushes.size() + 2 * modes.places.size() + modes.holds.size() + modes.modes),
      held_ends_(link_count(modes)),
      passive_(passive_links(program, modes)),
      state_{} {
  const std::size_t passives = passive_.size();
  active_.links.reserve(passives);
  active_.clusters.resize(1);
  numbers_.resize(StateLayout<T>(program, modes, passives, isa, nullptr).furnish(state_));
  StateLayout<T>(program, modes, passives, isa, numbers_.data()).furnish(state_);
  state_.passive.links = passive_.data();
  state_.passive.active = &active_;
  state_.sweep.rows = rows_.data();
  state_.sweep.bundled_rows = bundled_rows_.data();
  state_.inputs.push_of = indices_.data();
  state_.held.row_of = state_.inputs.push_of + modes.pushes.size();
  state_.held.place_of = state_.held.row_of + modes.places.size();
  state_.held.count_of = state_.held.place_of + modes.places.size();
  state_.ends.soft = state_.held.count_of + modes.holds.size();
  state_.held.ends = held_ends_.data();
  state_.sleep.silence = static_cast<T>(modes.silence);
  state_.sleep.lately_kept =
      static_cast<T>(std::pow(1e-3, static_cast<double>(check_frames) / program.rate_hz));
  this->reset(0);
}

template <class T>
void ModalKernel<T>::set_state(std::size_t, const double* x, const double* v) {
  const std::size_t places = modes_.places.size();
  // At the initial state of the model no mass is displaced.
  const bool is_start = x == program_.position.data() && v == program_.velocity.data();
  const std::size_t block = std::size_t{modes_.modes} * program_.moving;
  for (std::size_t i = 0; i < modes_.modes; ++i) {
    double q = modes_.q[i];
    double d = modes_.d[i];
    const double* basis = modes_.basis.data() + i * program_.moving;
    for (std::size_t node = 0; !is_start && node < program_.moving; ++node, ++basis) {
      const double moved = x[node] - program_.position[node];
      const double faster = v[node] - program_.velocity[node];
      q += basis[0] * moved + (modes_.is_crossed ? basis[2 * block] * faster : 0.0);
      d += modes_.is_crossed ? basis[block] * moved + basis[3 * block] * faster : basis[0] * faster;
    }
    state_.motion.q[i] = static_cast<T>(q);
    state_.motion.d[i] = static_cast<T>(d);
  }
  for (std::size_t i = 0; i < modes_.ends.size(); ++i) {
    state_.ends.x[places + i] = static_cast<T>(x[modes_.ends[i].node]);
    state_.ends.v[places + i] = static_cast<T>(v[modes_.ends[i].node]);
  }
  for (std::size_t p = 0; modes_.is_crossed && p < places; ++p) {
    double position = modes_.places[p].offset;
    double velocity = 0.0;
    for (const ModalPlace::Mass& mass : modes_.places[p].masses) {
      position += mass.weight * x[mass.node];
      velocity += mass.weight * v[mass.node];
    }
    state_.ends.x[p] = static_cast<T>(position);
    state_.ends.v[p] = static_cast<T>(velocity);
  }
  // Links exert no force in the first sample.
  state_.motion.may_move = true;
  std::fill_n(state_.motion.used, modes_.stiffness.size() + modes_.damping.size() + 1, T(0));
  std::fill_n(state_.inputs.late, modes_.pushes.size(), T(0));
  std::fill_n(state_.ends.force, places + modes_.ends.size(), T(0));
  std::fill_n(state_.passive.pushed, passive_.size(), T(0));
  std::fill_n(state_.passive.yield, passive_.size(), T(0));
  std::fill_n(state_.passive.yield_step, passive_.size(), T(0));
  state_.passive.pulls = false;
  state_.passive.is_pushed = false;
  state_.held.touched_frames = 0;
  state_.held.surprised_frames = 0;
  state_.ends.kick_norm = T(0);
  if (state_.motion.root != nullptr) {
    std::fill_n(state_.motion.root, state_.shapes.modes, T(1));
  }
  state_.motion.is_stale = true;
  state_.motion.fresh_frames = 0;
  wake_all();
  std::fill_n(state_.sleep.debt, state_.shapes.modes, T(0));
  std::fill_n(state_.sleep.loudness, places + modes_.outputs.size(), T(0));
}

// Adds velocities. They are divided by 1 - lZ, because the damping of the next sample must not act
// on them, as it does not act on the force of that sample. All modes wake.
template <class T>
void ModalKernel<T>::strike(std::size_t, std::span<const std::uint32_t> nodes,
                            std::span<const double> changes) {
  const std::size_t block = std::size_t{modes_.modes} * program_.moving;
  for (std::size_t i = 0; i < modes_.modes; ++i) {
    const auto sum = [&](std::size_t of) {
      const double* const basis = modes_.basis.data() + of * block + i * program_.moving;
      double felt = 0.0;
      for (std::size_t k = 0; k < nodes.size(); ++k) {
        felt += basis[nodes[k]] * changes[k];
      }
      return felt;
    };
    if (modes_.is_crossed) {
      const std::complex<double> pole(1.0 + modes_.pole[i], modes_.pole[modes_.modes + i]);
      const std::complex<double> before = std::complex<double>(sum(4), sum(5)) / pole;
      state_.motion.q[i] += static_cast<T>(before.real());
      state_.motion.d[i] += static_cast<T>(before.imag());
      continue;
    }
    const double damping = state_.motion.is_stale ? 0.0 : static_cast<double>(state_.motion.z[i]);
    const double gain =
        state_.motion.root != nullptr ? static_cast<double>(state_.motion.root[i]) : 1.0;
    // A mode that decays within a sample, such as one above half the rate, does not ring.
    state_.motion.d[i] += damping < 1.0 ? static_cast<T>(gain * sum(0) / (1.0 - damping)) : T(0);
  }
  wake_all();
}

template <class T>
void ModalKernel<T>::wake_all() {
  state_.sleep.awake = modes_.modes;
  state_.sleep.swept = state_.shapes.modes;
  state_.sleep.until_check = check_frames;
}

template <class T>
Awake ModalKernel<T>::awake() const {
  return {state_.sleep.awake, modes_.modes};
}

template <class T>
double ModalKernel<T>::owed(std::size_t listener) const {
  const std::size_t places = modes_.places.size();
  const T* const row = listener < places
                           ? state_.shapes.places + listener * state_.shapes.row
                           : state_.shapes.outputs + (listener - places) * state_.shapes.row;
  double sum = 0.0;
  for (std::size_t i = 0; i < modes_.modes; ++i) {
    sum += std::fabs(static_cast<double>(row[i])) * static_cast<double>(state_.sleep.debt[i]);
  }
  return sum;
}

template <class T>
bool ModalKernel<T>::copy_from(const Kernel<T>& from) {
  const auto& other = static_cast<const ModalKernel&>(from);
  this->coefficients = other.coefficients;
  std::copy<const T*>(other.state_.motion.q, other.state_.saved.q, state_.motion.q);
  indices_ = other.indices_;
  held_ends_ = other.held_ends_;
  active_.links = other.active_.links;
  active_.alone = other.active_.alone;
  active_.clusters[0].count = other.active_.clusters[0].count;
  state_.take_pace(other.state_);
  state_.sweep.bundled_modes = 0;  // The rows point into this kernel's memory.
  return true;
}

template <class T>
bool ModalKernel<T>::save(std::size_t, double*, double*) const {
  return false;
}

template <class T>
void ModalKernel<T>::play(const Block<T>& block) {
  state_.ramps = ramps_of(this->coefficients);
  state_.motion.may_move |= std::exchange(this->coefficients.has_changed, false);
  step_(program_, modes_, state_, block);
  if (state_.sleep.silence > 0) {
    remember_peaks(block);
  }
  this->coefficients.finish(block.frames);
}

// Updates the peak of each output: the smaller of the output and its displacement from rest.
template <class T>
void ModalKernel<T>::remember_peaks(const Block<T>& block) {
  const std::size_t outputs = modes_.outputs.size();
  for (std::size_t o = 0; o < outputs; ++o) {
    const auto rest = static_cast<T>(modes_.outputs[o].place.rest);
    T& loudness = state_.sleep.loudness[modes_.places.size() + o];
    for (std::size_t n = 0; n < block.frames; ++n) {
      const T y = block.outputs[n * outputs + o];
      loudness = std::max(loudness, std::min(std::abs(y), std::abs(y - rest)));
    }
  }
}

template <class T>
std::size_t ModalKernel<T>::read_positions(std::size_t, std::span<const std::uint32_t>,
                                           std::span<double> numbers) const {
  if (numbers.size() < modes_.modes || modes_.is_crossed) {
    return 0;
  }
  for (std::size_t i = 0; i < modes_.modes; ++i) {
    const double root =
        state_.motion.root != nullptr ? static_cast<double>(state_.motion.root[i]) : 1.0;
    numbers[i] = root * static_cast<double>(state_.motion.q[i]);
  }
  return modes_.modes;
}

template <class T>
bool ModalKernel<T>::is_near_start(std::size_t, double bound) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < modes_.modes; ++i) {
    const double root =
        state_.motion.root != nullptr ? static_cast<double>(state_.motion.root[i]) : 1.0;
    const double moved = root * static_cast<double>(state_.motion.q[i]) - modes_.q[i];
    const double turned =
        modes_.is_crossed ? static_cast<double>(state_.motion.d[i]) - modes_.d[i] : 0.0;
    sum += moved * moved + turned * turned;
  }
  return modes_.reach * std::sqrt(sum) < bound;
}

template class ModalKernel<float>;
template class ModalKernel<double>;

}  // namespace ressort::kernels
