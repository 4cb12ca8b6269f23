// core/kernels: strides of a dense body: the tables of one that its one link holds, and the way of
// a block through them. Member functions, for dense.cpp, which instantiates them.
#pragma once

#include <algorithm>

#include "core/kernels/dense/dense.h"
#include "core/laws/laws.h"

namespace ressort::kernels {

// One link between a mass, which is the state's first, and what does not wait for the masses.
template <class T>
bool DenseKernel<T>::has_strides() const {
  return ports_.size() == 1 && ports_[0].a_moves != ports_[0].b_moves && signals_.empty() &&
         body_.columns <= stride_state && body_.outputs <= stride_outputs;
}

template <class T>
std::size_t DenseKernel<T>::stride(const DenseDrive<T>& drive, std::size_t at, std::size_t count) {
  const DenseLink& port = ports_[0];
  const std::uint32_t other = port.a_moves ? port.b : port.a;
  const std::uint32_t input = port.a_moves ? port.input_b : port.input_a;
  const T by = port.a_moves ? T(1) : T(-1);
  const T* const state = body_.state;
  const auto c = [&](std::size_t i) { return this->coefficients.value[port.coefficients[i]]; };
  return with_law<T>(port.law, c, [&]<class ForceLaw>(const ForceLaw& law) -> std::size_t {
    if constexpr (laws::Straight<ForceLaw, T>) {
      const T d = by * (state[0] - body_.x[other]);
      const laws::StraightPiece<T> piece = law.piece(d);
      if (!(piece.low < d && d < piece.high)) {
        return 0;
      }
      DenseHold<T> hold{.stiffness = piece.stiffness,
                        .damping = piece.damping,
                        .force = -by * piece.offset,
                        .low = port.a_moves ? piece.low : -piece.high,
                        .high = port.a_moves ? piece.high : -piece.low,
                        .start = body_.x[other],
                        .start_speed = body_.v[other],
                        .position = nullptr,
                        .velocity = nullptr};
      if (input != no_input) {
        hold.position = drive.value + input * max_block_frames + at;
        hold.velocity = drive.velocity + input * max_block_frames + at;
      }
      const std::size_t stepped = steps_.stride(body_, stride_table(piece.stiffness, piece.damping),
                                                hold, drive.outputs + at * body_.outputs, count);
      if (stepped > 0) {
        for (const DenseInput& driven : driven_) {
          const std::size_t last = driven.input * max_block_frames + at + stepped - 1;
          body_.x[driven.slot] = drive.value[last];
          body_.v[driven.slot] = drive.velocity[last];
        }
        body_.port_force[0] = law.force(by * (state[0] - body_.x[other]),
                                        by * (state[body_.masses] - body_.v[other]));
        body_.touches = body_.port_force[0] != T(0);
      }
      return stepped;
    } else {
      return 0;
    }
  });
}

template <class T>
const T* DenseKernel<T>::stride_table(T stiffness, T damping) {
  for (const DenseStride<T>& known : strides_) {
    if (known.is_known && known.stiffness == stiffness && known.damping == damping) {
      return known.table.data();
    }
  }
  DenseStride<T>& stride = strides_[next_stride_];
  next_stride_ = (next_stride_ + 1) % strides_.size();
  stride.is_known = true;
  stride.stiffness = stiffness;
  stride.damping = damping;
  build_stride(stride);
  return stride.table.data();
}

// What becomes of each number of the state, and of a force in each frame, by stepping through.
template <class T>
void DenseKernel<T>::build_stride(DenseStride<T>& stride) const {
  const std::size_t n = body_.masses;
  const auto vector = [&](std::size_t i) { return body_.exact + i * body_.stride; };
  std::array<double, most_dense_masses> constant{};
  for (std::size_t r = 0; r < n; ++r) {
    constant[r] = -vector(3)[r];
    for (std::size_t i = 0; i < body_.sources; ++i) {
      const double* const source = vector(own_vectors + 2 * body_.stride + 2 * i);
      constant[r] += source[r] * static_cast<double>(body_.x[body_.source[i]]) +
                     source[body_.stride + r] * static_cast<double>(body_.v[body_.source[i]]);
    }
  }
  const auto step = [&](std::array<double, stride_state>& s, double pull) {
    std::array<double, stride_state> force{};
    for (std::size_t r = 0; r < n; ++r) {
      force[r] = -vector(1)[r] * s[r] - vector(2)[r] * s[n + r];
      force[r] += body_.columns > 2 * n ? constant[r] * s[2 * n] : 0.0;
      for (std::size_t k = 0; k < n; ++k) {
        const double stiff = vector(own_vectors + k)[r];
        const double both = vector(own_vectors + body_.stride + k)[r];
        force[r] += stiff * s[k] + (both - stiff) * s[n + k];
      }
    }
    force[0] += pull - static_cast<double>(stride.stiffness) * s[0] -
                static_cast<double>(stride.damping) * s[n];
    for (std::size_t r = 0; r < n; ++r) {
      s[n + r] += force[r] * vector(0)[r];
      s[r] += s[n + r];
    }
  };
  const std::size_t row = stride_row(body_.outputs);
  const std::size_t columns = stride_columns(body_.columns);
  std::fill(stride.table.begin(), stride.table.end(), T(0));
  for (std::size_t c = 0; c < columns + stride_frames; ++c) {
    const bool is_state = c < columns;
    if (is_state && c >= body_.columns) {
      continue;
    }
    T* const to = stride.table.data() + c * row;
    std::array<double, stride_state> s{};
    if (is_state) {
      s[c] = 1.0;
    }
    for (std::size_t frame = 0; frame < stride_frames; ++frame) {
      step(s, c == columns + frame ? 1.0 : 0.0);
      to[stride_state + frame] = static_cast<T>(s[0]);
      for (std::size_t o = 0; o < body_.outputs; ++o) {
        to[stride_state + stride_frames + frame * body_.outputs + o] = static_cast<T>(s[heard_[o]]);
      }
    }
    for (std::size_t r = 0; r < stride_state; ++r) {
      to[r] = static_cast<T>(s[r] - (r == c ? 1.0 : 0.0));
    }
  }
}

}  // namespace ressort::kernels
