#include "core/kernels/dense/dense.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>

#include "core/kernels/dense/dense_stride.h"

namespace ressort::kernels {
namespace {

// To the bit, which is asked for in every block.
template <class T>
bool is_same(const Aligned<T>& a, const Aligned<T>& b) {
  return std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

constexpr std::size_t least_block = 6;  // frames; fewer are stepped
constexpr std::size_t least_held = 8;   // frames on one piece that are worth strides
constexpr std::size_t most_tries = 2;   // of strides that were not, in a block
constexpr std::size_t least_alone = 4;  // blocks without strides after that

std::size_t round_up(std::size_t count, std::size_t to) {
  return (count + to - 1) / to * to;
}

// Hands out pieces of one memory, each on a cache line; first counts, then gives.
template <class T>
class Arena {
 public:
  explicit Arena(T* memory) : memory_(memory) {}
  void give(T*& piece, std::size_t count) {
    piece = memory_ == nullptr ? nullptr : memory_ + used_;
    used_ += round_up(count + dense_pad, widest_bytes / sizeof(T));
  }
  std::size_t used() const { return used_; }

 private:
  T* memory_;
  std::size_t used_ = 0;
};

struct Layout {
  std::size_t stride;
  std::span<const std::uint32_t> sources;
  std::span<const std::uint32_t> slots;
};

// `matrix` as DenseBody says, of coefficients of any kind: their values or how they move.
template <class U, class Value>
void assemble(const Program& program, const Dense& form, const Layout& layout, U* matrix,
              bool summed, Value&& value) {
  const std::span<const std::uint32_t> slots = layout.slots;
  const auto column = [&](std::size_t vector) { return matrix + vector * layout.stride; };
  U* const k_columns = column(own_vectors);
  U* const kz_columns = column(own_vectors + layout.stride);
  std::fill_n(matrix, (own_vectors + 2 * layout.stride + 2 * layout.sources.size()) * layout.stride,
              U(0));
  for (const MassRun& run : program.mass_runs) {
    for (std::uint32_t node = run.first; node < run.first + run.count; ++node) {
      const std::uint32_t i = slots[node];
      column(0)[i] = value(run.inverse_mass);
      column(1)[i] = run.is_oscillator ? value(run.stiffness) : U(0);
      column(2)[i] = run.is_oscillator ? value(run.damping) : U(0);
      column(3)[i] = run.has_gravity ? value(run.gravity) : U(0);
    }
  }
  const auto pull = [&](std::uint32_t mass, std::uint32_t other, U k, U z) {
    if (mass >= layout.stride) {
      return;
    }
    const U kz = summed ? k + z : z;
    k_columns[mass * layout.stride + mass] -= k;
    kz_columns[mass * layout.stride + mass] -= kz;
    if (other < layout.stride) {
      k_columns[other * layout.stride + mass] += k;
      kz_columns[other * layout.stride + mass] += kz;
      return;
    }
    const auto source = static_cast<std::size_t>(
        std::find(layout.sources.begin(), layout.sources.end(), other) - layout.sources.begin());
    column(own_vectors + 2 * layout.stride + 2 * source)[mass] += k;
    column(own_vectors + 2 * layout.stride + 2 * source + 1)[mass] += z;
  };
  for (const DenseSpring& spring : form.springs) {
    const U k = value(spring.stiffness);
    const U z = value(spring.damping);
    pull(slots[spring.a], slots[spring.b], k, z);
    pull(slots[spring.b], slots[spring.a], k, z);
  }
}

}  // namespace

template <class T>
DenseKernel<T>::DenseKernel(const Program& program, const Dense& form, std::size_t, Isa isa)
    : Kernel<T>(program, 1),
      program_(program),
      form_(form),
      steps_(with_isa(isa, [&]<Isa level>() { return dense_steps<level, T>(program.moving); })),
      known_(program.coefficients.size()),
      arranged_(program.inputs.size() * 2 * max_block_frames) {
  body_.masses = program.moving;
  const DensePacks packs = dense_packs(body_.masses, sizeof(T), isa);
  body_.stride = packs.count * packs.bytes / sizeof(T);
  body_.columns = 2 * body_.masses + (form.has_constant ? 1 : 0);
  body_.rows = round_up(body_.columns, vector_bytes(isa) / sizeof(T));
  body_.fixed = program.position.size() - program.moving;
  place_nodes();
  place_links();
  place_signals();
  allocate();
  this->reset(0);
}

template <class T>
void DenseKernel<T>::place_nodes() {
  const std::uint32_t nowhere = no_input;
  std::uint32_t next = 0;
  slots_.assign(program_.position.size(), nowhere);
  const auto place = [&](std::uint32_t node) {
    if (node < program_.moving && slots_[node] == nowhere) {
      slots_[node] = next++;
    }
  };
  if (!form_.ports.empty()) {
    place(program_.ends[form_.ports[0].link].a);
    place(program_.ends[form_.ports[0].link].b);
  }
  for (std::uint32_t node = 0; node < slots_.size(); ++node) {
    place(node);
    if (node >= program_.moving) {
      slots_[node] = static_cast<std::uint32_t>(body_.stride + node - program_.moving);
    }
  }
}

template <class T>
void DenseKernel<T>::place_links() {
  const auto input_of = [&](std::uint32_t node) {
    for (std::uint32_t i = 0; i < program_.inputs.size(); ++i) {
      if (!program_.inputs[i].is_force && program_.inputs[i].node == node) {
        return i;
      }
    }
    return no_input;
  };
  for (const DensePort& port : form_.ports) {
    const LinkRun& run = program_.link_runs[port.run];
    const auto [a, b] = program_.ends[port.link];
    can_step_blocks_ &=
        facts_of(run.law).zone != Zone::everywhere;  // else every block is sample steps
    ports_.push_back({.law = run.law,
                      .coefficients = run.coefficients,
                      .a = slots_[a],
                      .b = slots_[b],
                      .input_a = input_of(a),
                      .input_b = input_of(b),
                      .a_moves = a < program_.moving,
                      .b_moves = b < program_.moving});
  }
  for (const DenseSpring& spring : form_.springs) {
    for (const std::uint32_t end : {spring.a, spring.b}) {
      const std::uint32_t at = slots_[end];
      if (end >= program_.moving &&
          std::find(sources_.begin(), sources_.end(), at) == sources_.end()) {
        sources_.push_back(at);
      }
    }
  }
}

template <class T>
void DenseKernel<T>::place_signals() {
  for (std::uint32_t i = 0; i < program_.inputs.size(); ++i) {
    const auto [input, is_force, node] = program_.inputs[i];
    if (!is_force) {
      driven_.push_back({i, slots_[node]});
    } else if (node < program_.moving) {
      pushes_.push_back({i, slots_[node]});
      signals_.push_back({DenseSignal::Kind::force, i, slots_[node]});
    }
    const auto source = std::find(sources_.begin(), sources_.end(), slots_[node]);
    if (!is_force && source != sources_.end()) {
      const auto at = static_cast<std::uint32_t>(source - sources_.begin());
      signals_.push_back({DenseSignal::Kind::position, i, at});
      signals_.push_back({DenseSignal::Kind::velocity, i, at});
    }
  }
  for (const OutputSlot& output : program_.outputs) {
    heard_.push_back(slots_[output.node]);
  }
}

template <class T>
void DenseKernel<T>::allocate() {
  DenseBody<T>& b = body_;
  b.driven_count = driven_.size();
  b.pushes = pushes_.size();
  b.outputs = program_.outputs.size();
  b.ports = ports_.size();
  b.signals = signals_.size();
  b.sources = sources_.size();
  b.port = ports_.data();
  b.signal = signals_.data();
  b.source = sources_.data();
  b.driven = driven_.data();
  b.push = pushes_.data();
  b.heard = heard_.data();
  sounding_.resize(b.signals);
  b.sounding = sounding_.data();
  b.matrix_vectors = own_vectors + 2 * b.stride + 2 * b.sources;
  T* unit = nullptr;
  const auto lay_out = [&](T* memory) {
    Arena<T> arena(memory);
    arena.give(b.matrix, b.matrix_vectors * b.stride);
    arena.give(b.slope, b.matrix_vectors * b.stride);
    arena.give(b.pace, b.matrix_vectors * b.stride);
    arena.give(unit, (b.pushes + b.ports) * b.stride);
    arena.give(b.reach, (b.pushes + b.ports) * b.stride);
    arena.give(b.echo, b.ports * b.stride);
    arena.give(b.state, b.rows);
    arena.give(b.force, b.stride);
    arena.give(b.port_force, b.ports);
    arena.give(b.x, b.stride + b.fixed);
    arena.give(b.v, b.stride + b.fixed);
    arena.give(b.heard_table, b.columns * dense_frames * b.outputs);
    arena.give(b.port_table, b.ports * b.columns * dense_frames);
    arena.give(b.port_bound, b.ports * b.rows);
    arena.give(b.jump, dense_powers * b.columns * b.rows);
    arena.give(b.injection, b.signals * driven_frames * b.rows);
    arena.give(b.heard_response, b.signals * 2 * driven_frames * b.outputs);
    arena.give(b.port_response, b.signals * b.ports * 2 * driven_frames);
    arena.give(b.scratch, dense_scratch_size(b));
    return arena.used();
  };
  numbers_.resize(lay_out(nullptr));
  lay_out(numbers_.data());
  b.unit = unit;
  for (const DenseInput& push : pushes_) {
    unit[push.slot] = T(1);
    unit += b.stride;
  }
  for (const DenseLink& port : ports_) {
    if (port.a_moves) {
      unit[port.a] -= T(1);
    }
    if (port.b_moves) {
      unit[port.b] += T(1);
    }
    unit += b.stride;
  }
  for (DenseStride<T>& stride : strides_) {
    stride.table.resize(
        has_strides() ? (stride_columns(b.columns) + stride_frames) * stride_row(b.outputs) : 0);
  }
  b.ramps = ramps_of(this->coefficients);
  exact_.resize(b.matrix_vectors * b.stride + dense_build_size(b));
  b.exact = exact_.data();
  b.build = exact_.data() + b.matrix_vectors * b.stride;
}

template <class T>
void DenseKernel<T>::set_state(std::size_t, const double* x, const double* v) {
  for (std::uint32_t node = 0; node < program_.position.size(); ++node) {
    position_of(node) = static_cast<T>(x[node]);
    velocity_of(node) = static_cast<T>(v[node]);
  }
  if (form_.has_constant) {
    body_.state[2 * body_.masses] = T(1);
  }
  std::fill_n(body_.force, body_.stride, T(0));
  std::fill_n(body_.port_force, body_.ports, T(0));
  body_.touches = false;
  body_.has_force = true;
  is_current_ = false;
}

template <class T>
T& DenseKernel<T>::position_of(std::uint32_t node) const {
  return node < body_.masses ? body_.state[slots_[node]] : body_.x[slots_[node]];
}

template <class T>
T& DenseKernel<T>::velocity_of(std::uint32_t node) const {
  return node < body_.masses ? body_.state[body_.masses + slots_[node]] : body_.v[slots_[node]];
}

template <class T>
bool DenseKernel<T>::save(std::size_t, double* x, double* v) const {
  for (std::uint32_t node = 0; node < program_.position.size(); ++node) {
    x[node] = static_cast<double>(position_of(node));
    v[node] = static_cast<double>(velocity_of(node));
  }
  return true;
}

template <class T>
std::size_t DenseKernel<T>::look(std::size_t, std::span<const std::uint32_t> nodes,
                                 std::span<double> numbers) const {
  return look_at(nodes, numbers,
                 [&](std::uint32_t node) { return static_cast<double>(position_of(node)); });
}

template <class T>
DenseDrive<T> DenseKernel<T>::arrange(const Block<T>& block) {
  if (program_.inputs.size() == 1) {
    return {block.value, block.velocity, block.outputs};
  }
  const std::size_t inputs = program_.inputs.size();
  T* const value = arranged_.data();
  T* const velocity = value + inputs * max_block_frames;
  for (std::size_t i = 0; i < inputs; ++i) {
    for (std::size_t n = 0; n < block.frames; ++n) {
      value[i * max_block_frames + n] = block.value[n * inputs + i];
      velocity[i * max_block_frames + n] = block.velocity[n * inputs + i];
    }
  }
  return {value, velocity, block.outputs};
}

template <class T>
void DenseKernel<T>::play(const Block<T>& block) {
  const DenseDrive<T> drive = arrange(block);
  const std::size_t ramped = std::min(this->coefficients.ramp_frames, block.frames);
  if (ramped > 0) {
    ramp(drive, ramped);
    this->coefficients.finish(ramped);
  }
  if (ramped < block.frames) {
    follow_coefficients();
    play(drive, ramped, block.frames);
  }
}

// The matrices are sums of coefficients, so they move as straight as these do.
template <class T>
void DenseKernel<T>::ramp(const DenseDrive<T>& drive, std::size_t frames) {
  const Layout layout{body_.stride, sources_, slots_};
  const Coefficients<T>& c = this->coefficients;
  refresh_force();
  assemble(program_, form_, layout, body_.matrix, true,
           [&](std::uint32_t i) { return c.value[i]; });
  assemble(program_, form_, layout, body_.slope, false,
           [&](std::uint32_t i) { return c.is_ramping[i] ? c.increment[i] : T(0); });
  body_.ramps = ramps_of(this->coefficients);
  body_.damping_moves =
      std::any_of(form_.springs.begin(), form_.springs.end(), [&](const DenseSpring& spring) {
        return c.is_ramping[spring.damping] && c.increment[spring.damping] != T(0);
      });
  steps_.samples(body_, drive, 0, frames, true);
  has_tables_ = false;
  is_current_ = false;
}

template <class T>
void DenseKernel<T>::follow_coefficients() {
  const Layout layout{body_.stride, sources_, slots_};
  const Aligned<T>& value = this->coefficients.value;
  if (is_current_ && is_same(value, known_)) {
    return;
  }
  refresh_force();
  assemble(program_, form_, layout, body_.matrix, true, [&](std::uint32_t i) { return value[i]; });
  if (!is_same(value, known_)) {
    std::copy(value.begin(), value.end(), known_.begin());
    assemble(program_, form_, layout, body_.exact, true,
             [&](std::uint32_t i) { return static_cast<double>(known_[i]); });
    make_pace();
    has_tables_ = false;
    for (DenseStride<T>& stride : strides_) {
      stride.is_known = false;
    }
  }
  is_current_ = false;
}

template <class T>
void DenseKernel<T>::make_pace() {
  const std::size_t stride = body_.stride;
  const double* const exact = body_.exact;
  const double* const own_k = exact + stride;
  const double* const own_z = own_k + stride;
  const double* const weight = own_z + stride;
  const auto by_v = [&](std::size_t column, std::size_t r) {
    const double own = r == column ? own_k[r] + own_z[r] : 0.0;
    return exact[r] * (exact[(own_vectors + stride + column) * stride + r] - own);
  };
  for (std::size_t r = 0; r < stride; ++r) {
    const auto put = [&](std::size_t vector, double value) {
      body_.pace[vector * stride + r] = static_cast<T>(value);
    };
    put(3, -exact[r] * weight[r]);
    for (std::size_t column = 0; column < stride; ++column) {
      const std::size_t vector = own_vectors + column;
      put(vector, exact[r] * (exact[vector * stride + r] - (r == column ? own_k[r] : 0.0)));
      put(vector + stride, by_v(column, r));
    }
    for (std::size_t vector = own_vectors + 2 * stride; vector < body_.matrix_vectors; ++vector) {
      put(vector, exact[r] * exact[vector * stride + r]);
    }
    for (std::size_t unit = 0; unit < body_.pushes + body_.ports; ++unit) {
      body_.reach[unit * stride + r] =
          static_cast<T>(exact[r] * static_cast<double>(body_.unit[unit * stride + r]));
    }
    for (std::size_t p = 0; p < body_.ports; ++p) {
      const T* const unit = body_.unit + (body_.pushes + p) * stride;
      double reached = exact[r] * static_cast<double>(unit[r]);
      for (std::size_t k = 0; k < stride; ++k) {
        reached += by_v(k, r) * exact[k] * static_cast<double>(unit[k]);
      }
      body_.echo[p * stride + r] = static_cast<T>(reached);
    }
  }
}

template <class T>
void DenseKernel<T>::play(const DenseDrive<T>& drive, std::size_t at, std::size_t end) {
  // What leaves its pieces all the time is left alone for some blocks.
  const bool is_left_alone = blocks_alone_ > 0;
  blocks_alone_ -= is_left_alone ? 1 : 0;
  std::size_t tries = has_strides() && !is_left_alone ? most_tries : 0;
  while (at < end) {
    if (tries > 0 && body_.touches && is_current_ && !body_.has_force) {
      const std::size_t stepped = stride(drive, at, end - at);
      tries -= stepped < least_held ? 1 : 0;
      blocks_alone_ = tries > 0 ? 0 : least_alone;
      at += stepped;
      const std::size_t rest = tries > 0 ? std::min(end - at, least_held) : end - at;
      if (body_.touches && rest > 0) {
        steps_.samples(body_, drive, at, rest, false);
        at += rest;
      }
      continue;
    }
    const bool is_block = can_step_blocks_ && !body_.touches && end - at >= least_block;
    if (is_block && is_current_) {
      if (!has_tables_) {
        steps_.build(body_);
        has_tables_ = true;
      }
      const std::size_t stepped = steps_.block(body_, drive, at, std::min(end - at, dense_frames));
      body_.has_force &= stepped == 0;
      at += stepped;
      continue;
    }
    const std::size_t stepped = is_block ? 1 : end - at;
    steps_.samples(body_, drive, at, stepped, false);
    is_current_ = true;
    at += stepped;
  }
}

// A block step leaves no forces behind. What acts next must still be by the matrices of its own
// sample.
template <class T>
void DenseKernel<T>::refresh_force() {
  if (!body_.has_force) {
    steps_.pull(body_);
  }
}

// The force of the next sample is that of the velocity before.
template <class T>
void DenseKernel<T>::strike(std::size_t, std::span<const std::uint32_t> nodes,
                            std::span<const double> changes) {
  refresh_force();
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    velocity_of(nodes[i]) += static_cast<T>(changes[i]);
  }
}

template <class T>
bool DenseKernel<T>::is_near_start(std::size_t, double bound) const {
  for (std::size_t i = 0; i < body_.masses; ++i) {
    if (!(std::fabs(static_cast<double>(body_.state[slots_[i]]) - program_.position[i]) < bound)) {
      return false;
    }
  }
  return true;
}

template class DenseKernel<float>;
template class DenseKernel<double>;

}  // namespace ressort::kernels
