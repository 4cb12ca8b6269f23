// The direct form as published, and with compensated positions. Compiled for each instruction set,
// without fused multiply-adds: the same bits on every machine.
#include "core/kernels/direct/direct_loops.h"

namespace ressort::kernels::RESSORT_ISA {
namespace {

// A view with positions that are sums of two numbers, x + rest. A step's rounding is kept in the
// rest instead of lost, so that a small motion far from 0 is as exact as one at 0.
template <std::size_t Bytes>
struct Summed : View<float, Bytes> {
  using Base = View<float, Bytes>;
  using V = typename Base::V;
  static constexpr bool takes_rails = false;

  explicit Summed(DirectState<float>& state_in)
      : Base(state_in),
        rest(reinterpret_cast<V*>(state_in.own(0))),
        value_rest(reinterpret_cast<const V*>(state_in.value_rest)),
        output_rest(reinterpret_cast<V*>(state_in.output_rest)) {}

  V between(std::size_t a, std::size_t b) const {
    return Base::between(a, b) + (rest[a] - rest[b]);
  }
  void move(std::size_t node) { shift(node, this->v[node]); }
  void shift(std::size_t node, V way) {
    const V y = way + rest[node];
    const V sum = this->x[node] + y;
    rest[node] = y - (sum - this->x[node]);
    this->x[node] = sum;
  }
  using Exact = std::array<double, Base::lanes>;
  Exact exact_at(const Program& program, std::size_t tap) const {
    Exact position{};
    const TapSlot& slot = program.taps[tap];
    for (std::size_t lane = 0; lane < Base::lanes; ++lane) {
      each_behind(
          program, slot, this->state.corners[tap * Base::lanes + lane],
          [&](std::uint32_t node, float weight) { position[lane] += weight * exact(node, lane); });
    }
    return position;
  }
  void move_to(std::size_t node, const Exact& position) {
    for (std::size_t lane = 0; lane < Base::lanes; ++lane) {
      const auto nearest = static_cast<float>(position[lane]);
      this->v[node][lane] = static_cast<float>(position[lane] - exact(node, lane));
      this->x[node][lane] = nearest;
      rest[node][lane] = static_cast<float>(position[lane] - static_cast<double>(nearest));
    }
  }
  void take_rests(const Program& program) {
    for (const InputSlot& input : program.inputs) {
      if (!input.is_force) {
        rest[input.node] = *value_rest;
      }
      ++value_rest;
    }
  }
  void give_rests(const Program& program) {
    for (const OutputSlot& output : program.outputs) {
      *output_rest++ = output.is_force ? V{} : rest[output.node];
    }
  }

  V* rest;
  const V* value_rest;
  V* output_rest;

 private:
  double exact(std::size_t node, std::size_t lane) const {
    return static_cast<double>(this->x[node][lane]) + static_cast<double>(rest[node][lane]);
  }
};

template <class T>
DirectLoops<T> loops_for(std::size_t bytes) {
  return with_bytes<vector_bytes(Isa::RESSORT_ISA)>(bytes, []<std::size_t pack>() {
    return DirectLoops<T>{step<View<T, pack>, T>, pull_alone<View<T, pack>, T>};
  });
}

}  // namespace
}  // namespace ressort::kernels::RESSORT_ISA

namespace ressort::kernels {

template <>
DirectLoops<float> direct_loops<Isa::RESSORT_ISA, float>(std::size_t bytes) {
  return RESSORT_ISA::loops_for<float>(bytes);
}

template <>
DirectLoops<double> direct_loops<Isa::RESSORT_ISA, double>(std::size_t bytes) {
  return RESSORT_ISA::loops_for<double>(bytes);
}

template <>
DirectLoops<float> compensated_loops<Isa::RESSORT_ISA>(std::size_t bytes) {
  return with_bytes<vector_bytes(Isa::RESSORT_ISA)>(bytes, []<std::size_t pack>() {
    return DirectLoops<float>{RESSORT_ISA::step<RESSORT_ISA::Summed<pack>, float>, nullptr};
  });
}

}  // namespace ressort::kernels
