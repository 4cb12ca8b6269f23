#include "core/kernels/slow/slow.h"

#include <algorithm>
#include <cmath>

namespace ressort::kernels {
namespace {

constexpr int most_trials = 6;  // to find the speed at which a mass on its own spring begins

}  // namespace

template <class T>
SlowKernel<T>::Stepper::Stepper(const Program& program_in, Isa isa)
    : program(program_in),
      kernel(make_kernel<T>(program, 1, isa)),
      value(program.inputs.size() * kernel->width()),
      velocity(value.size()),
      outputs(program.outputs.size() * kernel->width()) {}

template <class T>
void SlowKernel<T>::Stepper::take(const Coefficients<T>& coefficients,
                                  const std::vector<T>& factor) {
  for (std::size_t c = 0; c < factor.size(); ++c) {
    kernel->coefficients.value[c * kernel->width()] = coefficients.value[c] * factor[c];
  }
}

template <class T>
void SlowKernel<T>::Stepper::step(const Coefficients<T>& coefficients,
                                  const std::vector<T>& factor) {
  take(coefficients, factor);
  kernel->step({.frames = 1,
                .value = value.data(),
                .velocity = velocity.data(),
                .audio = nullptr,
                .outputs = outputs.data()});
}

template <class T>
SlowKernel<T>::SlowKernel(const Program& program, const Slow& form, std::size_t, Isa isa)
    : Kernel<T>(program, 1),
      program_(program),
      frames_(form.frames),
      fine_(*form.fine, isa),
      coarse_(*form.coarse, isa),
      same_(program.coefficients.size(), T(1)),
      rows_(points * program.position.size()),
      x_(program.position.size()),
      v_(x_.size()),
      aim_(x_.size()),
      pushed_(program.inputs.size()) {
  for (const Coefficient& coefficient : program.coefficients) {
    factor_.push_back(static_cast<T>(rate_factor(coefficient.unit, static_cast<double>(frames_))));
  }
  for (std::size_t i = 0; i <= frames_; ++i) {
    const double t = static_cast<double>(i) / static_cast<double>(frames_);
    weight_.push_back(-t * (t - 1.0) * (t - 2.0) / 6.0);
    weight_.push_back((t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0);
    weight_.push_back(-(t + 1.0) * t * (t - 2.0) / 2.0);
    weight_.push_back((t + 1.0) * t * (t - 1.0) / 6.0);
  }
  this->reset(0);
}

template <class T>
void SlowKernel<T>::set_state(std::size_t, const double* x, const double* v) {
  fine_.kernel->set_state(0, x, v);
  std::copy_n(x, x_.size(), rows_.begin());
  is_fine_ = true;
  since_ = 0;
  std::fill(pushed_.begin(), pushed_.end(), T(0));
}

template <class T>
double SlowKernel<T>::interpolated(std::size_t node, std::size_t sample) const {
  const double* const weight = weight_.data() + points * sample;
  double sum = 0.0;
  for (std::size_t i = 0; i < points; ++i) {
    sum += weight[i] * rows_[i * x_.size() + node];
  }
  return sum;
}

template <class T>
bool SlowKernel<T>::save(std::size_t, double* x, double* v) const {
  if (is_fine_) {
    return fine_.kernel->save(0, x, v);
  }
  for (std::size_t node = 0; node < x_.size(); ++node) {
    x[node] = interpolated(node, since_);
    v[node] =
        since_ > 0 ? x[node] - interpolated(node, since_ - 1) : interpolated(node, 1) - x[node];
  }
  return true;
}

// A coarse step feels it with the forces that are gathered for it.
template <class T>
void SlowKernel<T>::strike(std::size_t, std::span<const std::uint32_t> nodes,
                           std::span<const double> changes) {
  if (is_fine_) {
    fine_.take(this->coefficients, same_);  // a voice may be struck before its first step
    return fine_.kernel->strike(0, nodes, changes);
  }
  coarse_.take(this->coefficients, factor_);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const double change = changes[i] * static_cast<double>(frames_);
    coarse_.kernel->strike(0, nodes.subspan(i, 1), {&change, 1});
  }
}

template <class T>
std::size_t SlowKernel<T>::look(std::size_t, std::span<const std::uint32_t> nodes,
                                std::span<double> numbers) const {
  return is_fine_ ? fine_.kernel->look(0, nodes, numbers)
                  : look_at(nodes, numbers,
                            [&](std::uint32_t node) { return interpolated(node, since_); });
}

template <class T>
void SlowKernel<T>::step_fine(const T* value, const T* velocity) {
  for (std::size_t i = 0; i < program_.inputs.size(); ++i) {
    fine_.value[i * fine_.kernel->width()] = value[i];
    fine_.velocity[i * fine_.kernel->width()] = velocity[i];
    pushed_[i] = program_.inputs[i].is_force ? T(0) : value[i];
  }
  fine_.step(this->coefficients, same_);
}

// What a force does in a step of D samples is D times what it is in sum; a hand is where it is
// last.
template <class T>
void SlowKernel<T>::gather(const T* value) {
  for (std::size_t i = 0; i < program_.inputs.size(); ++i) {
    pushed_[i] = program_.inputs[i].is_force ? pushed_[i] + value[i] : value[i];
  }
}

template <class T>
void SlowKernel<T>::step_coarse() {
  const std::size_t width = coarse_.kernel->width();
  for (std::size_t i = 0; i < program_.inputs.size(); ++i) {
    const bool is_force = program_.inputs[i].is_force;
    const T value = is_force ? pushed_[i] * static_cast<T>(frames_) : pushed_[i];
    coarse_.velocity[i * width] = value - coarse_.value[i * width];
    coarse_.value[i * width] = value;
    pushed_[i] = is_force ? T(0) : value;
  }
  coarse_.step(this->coefficients, factor_);
  std::copy(rows_.begin() + static_cast<std::ptrdiff_t>(x_.size()), rows_.end(), rows_.begin());
  coarse_.kernel->save(0, x_.data(), v_.data());
  std::copy(x_.begin(), x_.end(), rows_.end() - static_cast<std::ptrdiff_t>(x_.size()));
}

// The first coarse step is to lead from where the fine ones began to where they ended: masses fly
// there, but those on springs of their own are held back on the way.
template <class T>
void SlowKernel<T>::start_coarse() {
  const std::size_t nodes = x_.size();
  std::vector<double>& speed = v_;
  fine_.kernel->save(0, aim_.data(), speed.data());
  const std::size_t width = coarse_.kernel->width();
  for (std::size_t i = 0; i < program_.inputs.size(); ++i) {
    coarse_.value[i * width] = pushed_[i];
    coarse_.velocity[i * width] = T(0);
  }
  for (std::size_t node = 0; node < nodes; ++node) {
    speed[node] = aim_[node] - rows_[node];
  }
  for (int trial = 0; trial < most_trials; ++trial) {
    coarse_.kernel->set_state(0, rows_.data(), speed.data());
    coarse_.step(this->coefficients, factor_);
    coarse_.kernel->save(0, x_.data(), v_.data());
    for (std::size_t node = 0; node < nodes; ++node) {
      speed[node] += aim_[node] - x_[node];
    }
  }
  const auto row = static_cast<std::ptrdiff_t>(nodes);
  std::copy_n(rows_.begin(), row, rows_.begin() + 2 * row);
  std::copy(aim_.begin(), aim_.end(), rows_.begin() + 3 * row);
  step_coarse();
  step_coarse();
  is_fine_ = false;
}

template <class T>
void SlowKernel<T>::play(const Block<T>& block) {
  Ramps<T> ramps = ramps_of(this->coefficients);
  const std::size_t inputs = program_.inputs.size();
  for (std::size_t frame = 0; frame < block.frames; ++frame) {
    advance(ramps);
    const T* const value = block.value + frame * inputs;
    T* output = block.outputs + frame * program_.outputs.size();
    if (is_fine_) {
      step_fine(value, block.velocity + frame * inputs);
      for (std::size_t i = 0; i < program_.outputs.size(); ++i) {
        output[i] = fine_.outputs[i * fine_.kernel->width()];
      }
    } else {
      gather(value);
      for (const OutputSlot& slot : program_.outputs) {
        *output++ = static_cast<T>(interpolated(slot.node, since_ + 1));
      }
    }
    if (++since_ == frames_) {
      since_ = 0;
      if (is_fine_) {
        start_coarse();
      } else {
        step_coarse();
      }
    }
  }
  this->coefficients.finish(block.frames);
}

template <class T>
bool SlowKernel<T>::is_near_start(std::size_t, double bound) const {
  return (is_fine_ ? fine_ : coarse_).kernel->is_near_start(0, bound);
}

template class SlowKernel<float>;
template class SlowKernel<double>;

}  // namespace ressort::kernels
