#include "core/kernels/direct/compensated.h"

#include <algorithm>
#include <cmath>

namespace ressort {
namespace {

constexpr auto narrow = [](auto number) { return static_cast<float>(number); };

template <class T>
void narrow_all(const T* from, std::size_t count, Aligned<float>& to) {
  std::transform(from, from + count, to.begin(), narrow);
}

// What a number is more than the nearest float.
template <class T>
float rest_of(T number) {
  return narrow(number - static_cast<T>(narrow(number)));
}

}  // namespace

template <class T>
CompensatedKernel<T>::CompensatedKernel(const Program& program, const Compensated&,
                                        std::size_t voices, Isa isa)
    : Kernel<T>(program, lanes_for<float>(voices, isa)),
      program_(program),
      step_(with_isa(
          isa,
          [&]<Isa level>() { return compensated_step<level>(this->width() * sizeof(float)); })),
      x_(program.position.size() * this->width()),
      rest_(x_.size()),
      v_(x_.size()),
      force_(x_.size()),
      corners_(program.taps.size() * this->width()),
      coefficient_(this->coefficients.value.size()),
      increment_(coefficient_.size()),
      target_(coefficient_.size()),
      passive_(program, this->width()),
      value_(max_block_frames * program.inputs.size() * this->width()),
      value_rest_(value_.size()),
      velocity_(value_.size()),
      audio_(max_block_frames * program.audio_coefficients.size() * this->width()),
      outputs_(max_block_frames * program.outputs.size() * this->width()),
      output_rest_(outputs_.size()) {
  for (std::size_t lane = 0; lane < this->width(); ++lane) {
    this->reset(lane);
  }
}

template <class T>
double CompensatedKernel<T>::position(std::size_t at) const {
  return static_cast<double>(x_[at]) + static_cast<double>(rest_[at]);
}

template <class T>
void CompensatedKernel<T>::set_state(std::size_t lane, const double* x, const double* v) {
  for (std::size_t node = 0; node < program_.position.size(); ++node) {
    const std::size_t at = node * this->width() + lane;
    x_[at] = narrow(x[node]);
    rest_[at] = rest_of(x[node]);
    v_[at] = narrow(v[node]);
    force_[at] = 0.0f;
  }
  passive_.awake[lane] = 0.0f;
}

template <class T>
bool CompensatedKernel<T>::save(std::size_t lane, double* x, double* v) const {
  for (std::size_t node = 0; node < program_.position.size(); ++node) {
    const std::size_t at = node * this->width() + lane;
    x[node] = position(at);
    v[node] = static_cast<double>(v_[at]);
  }
  return true;
}

template <class T>
void CompensatedKernel<T>::play(const Block<T>& block) {
  auto& coefficients = this->coefficients;
  const std::size_t width = this->width();
  const std::size_t inputs = block.frames * program_.inputs.size() * width;
  const std::size_t audio = block.frames * program_.audio_coefficients.size() * width;
  const std::size_t outputs = block.frames * program_.outputs.size() * width;
  narrow_all(coefficients.value.data(), coefficient_.size(), coefficient_);
  narrow_all(coefficients.increment.data(), coefficient_.size(), increment_);
  narrow_all(coefficients.target.data(), coefficient_.size(), target_);
  narrow_all(block.value, inputs, value_);
  std::transform(block.value, block.value + inputs, value_rest_.begin(), rest_of<T>);
  narrow_all(block.velocity, inputs, velocity_);
  narrow_all(block.audio, audio, audio_);
  DirectState<float> state{
      .ramps = {coefficient_.data(), increment_.data(), target_.data(), coefficients.ramping.data(),
                coefficients.ramping.size(), width, coefficients.ramp_frames},
      .x = x_.data(),
      .v = v_.data(),
      .force = force_.data(),
      .corners = corners_.data(),
      .nodes = program_.position.size(),
      .passive = passive_.links,
      .inverse_mass = passive_.inverse_mass.data(),
      .memory = passive_.memory.data(),
      .awake = passive_.awake.data(),
      .felt = passive_.felt_or_null(),
      .rest = rest_.data(),
      .value_rest = value_rest_.data(),
      .output_rest = output_rest_.data()};
  step_(program_, state,
        {.frames = block.frames,
         .value = value_.data(),
         .velocity = velocity_.data(),
         .audio = audio_.data(),
         .outputs = outputs_.data()});
  const auto keep = [&](std::uint32_t c) {
    for (std::size_t i = c * width; i < (c + 1) * width; ++i) {
      coefficients.value[i] = static_cast<T>(coefficient_[i]);
    }
  };
  std::for_each(coefficients.ramping.begin(), coefficients.ramping.end(), keep);
  std::for_each(program_.audio_coefficients.begin(), program_.audio_coefficients.end(), keep);
  coefficients.finish(block.frames);
  for (std::size_t i = 0; i < outputs; ++i) {
    block.outputs[i] = static_cast<T>(outputs_[i]) + static_cast<T>(output_rest_[i]);
  }
}

template <class T>
bool CompensatedKernel<T>::is_near_start(std::size_t lane, double bound) const {
  for (std::size_t node = 0; node < program_.moving; ++node) {
    const double x = position(node * this->width() + lane);
    if (!(std::fabs(x - program_.position[node]) < bound)) {
      return false;
    }
  }
  return true;
}

template class CompensatedKernel<float>;
template class CompensatedKernel<double>;

}  // namespace ressort
