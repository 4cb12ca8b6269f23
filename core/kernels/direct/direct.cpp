#include "core/kernels/direct/direct.h"

#include <algorithm>
#include <cmath>

namespace ressort {
template <class T>
DirectKernel<T>::DirectKernel(const Program& program, const Direct&, std::size_t voices, Isa isa)
    : Kernel<T>(program, lanes_for<T>(voices, isa)),
      program_(program),
      step_(with_isa(
          isa, [&]<Isa level>() { return direct_step<level, T>(this->width() * sizeof(T)); })),
      x_(program.position.size() * this->width()),
      v_(x_.size()),
      force_(x_.size()),
      corners_(program.taps.size() * this->width()),
      passive_(program, this->width()) {
  for (std::size_t lane = 0; lane < this->width(); ++lane) {
    this->reset(lane);
  }
}

template <class T>
void DirectKernel<T>::set_state(std::size_t lane, const double* x, const double* v) {
  for (std::size_t node = 0; node < program_.position.size(); ++node) {
    const std::size_t at = node * this->width() + lane;
    x_[at] = static_cast<T>(x[node]);
    v_[at] = static_cast<T>(v[node]);
    force_[at] = T(0);
  }
  passive_.awake[lane] = T(0);
}

template <class T>
bool DirectKernel<T>::save(std::size_t lane, double* x, double* v) const {
  for (std::size_t node = 0; node < program_.position.size(); ++node) {
    const std::size_t at = node * this->width() + lane;
    x[node] = static_cast<double>(x_[at]);
    v[node] = static_cast<double>(v_[at]);
  }
  return true;
}

template <class T>
bool DirectKernel<T>::read(std::span<const std::uint32_t> nodes, T* x, T* v) const {
  const std::size_t width = this->width();
  for (const std::uint32_t node : nodes) {
    x = std::copy_n(x_.data() + node * width, width, x);
    v = std::copy_n(v_.data() + node * width, width, v);
  }
  return true;
}

template <class T>
bool DirectKernel<T>::write_nodes(std::span<const std::uint32_t> nodes, const T* x, const T* v) {
  const std::size_t width = this->width();
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    std::copy_n(x + i * width, width, x_.data() + nodes[i] * width);
    std::copy_n(v + i * width, width, v_.data() + nodes[i] * width);
  }
  std::fill(force_.begin(), force_.end(), T(0));
  std::fill(passive_.awake.begin(), passive_.awake.end(), T(1));
  this->step({});
  return true;
}

template <class T>
void DirectKernel<T>::play(const Block<T>& block) {
  DirectState<T> state{.ramps = ramps_of(this->coefficients),
                       .x = x_.data(),
                       .v = v_.data(),
                       .force = force_.data(),
                       .corners = corners_.data(),
                       .nodes = program_.position.size(),
                       .passive = passive_.links,
                       .inverse_mass = passive_.inverse_mass.data(),
                       .memory = passive_.memory.data(),
                       .awake = passive_.awake.data(),
                       .felt = passive_.felt_or_null()};
  step_(program_, state, block);
  this->coefficients.finish(block.frames);
}

template <class T>
bool DirectKernel<T>::is_near_start(std::size_t lane, double bound) const {
  for (std::size_t node = 0; node < program_.moving; ++node) {
    const auto x = static_cast<double>(x_[node * this->width() + lane]);
    if (!(std::fabs(x - program_.position[node]) < bound)) {
      return false;
    }
  }
  return true;
}

template class DirectKernel<float>;
template class DirectKernel<double>;

}  // namespace ressort
