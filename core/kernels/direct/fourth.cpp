#include "core/kernels/direct/fourth.h"

#include <algorithm>
#include <cmath>

namespace ressort {

template <class T>
FourthKernel<T>::FourthKernel(const Program& program, const Fourth& form, std::size_t voices,
                              Isa isa)
    : Kernel<T>(program, lanes_for<T>(voices, isa)),
      program_(program),
      form_(form),
      step_(with_isa(
          isa, [&]<Isa level>() { return fourth_step<level, T>(this->width() * sizeof(T)); })),
      x_(program.position.size() * this->width()),
      v_(x_.size()),
      force_(x_.size()),
      damping_(x_.size()),
      ahead_(x_.size()),
      faster_(x_.size()),
      corners_(program.taps.size() * this->width()) {
  for (std::size_t lane = 0; lane < this->width(); ++lane) {
    this->reset(lane);
  }
}

template <class T>
void FourthKernel<T>::set_state(std::size_t lane, const double* x, const double* v) {
  for (std::size_t node = 0; node < program_.position.size(); ++node) {
    const std::size_t at = node * this->width() + lane;
    x_[at] = static_cast<T>(x[node]);
    v_[at] = static_cast<T>(v[node]);
    force_[at] = damping_[at] = T(0);
  }
}

template <class T>
bool FourthKernel<T>::save(std::size_t lane, double* x, double* v) const {
  for (std::size_t node = 0; node < program_.position.size(); ++node) {
    const std::size_t at = node * this->width() + lane;
    x[node] = static_cast<double>(x_[at]);
    v[node] = static_cast<double>(v_[at]);
  }
  return true;
}

template <class T>
void FourthKernel<T>::play(const Block<T>& block) {
  FourthState<T> state{.ramps = ramps_of(this->coefficients),
                       .x = x_.data(),
                       .v = v_.data(),
                       .force = force_.data(),
                       .damping = damping_.data(),
                       .ahead = ahead_.data(),
                       .faster = faster_.data(),
                       .corners = corners_.data(),
                       .nodes = program_.position.size()};
  step_(program_, form_, state, block);
  this->coefficients.finish(block.frames);
}

template <class T>
bool FourthKernel<T>::is_near_start(std::size_t lane, double bound) const {
  for (std::size_t node = 0; node < program_.moving; ++node) {
    const auto x = static_cast<double>(x_[node * this->width() + lane]);
    if (!(std::fabs(x - program_.position[node]) < bound)) {
      return false;
    }
  }
  return true;
}

template class FourthKernel<float>;
template class FourthKernel<double>;

}  // namespace ressort
