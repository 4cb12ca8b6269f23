#include "core/kernels/direct/compensated.h"

#include <algorithm>

namespace ressort::kernels {
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

NodeLayout layout_of(const Program& program, std::size_t width) {
  NodeLayout layout = layout_in_rows<float>(program, width, compensated_rows);
  layout.rest = compensated_rows - 1;
  return layout;
}

}  // namespace

template <class T>
CompensatedKernel<T>::CompensatedKernel(const Program& program, const Compensated&,
                                        std::size_t voices, Isa isa)
    : NodeKernel<T, float>(program, layout_of(program, lanes_for<float>(voices, isa))),
      loops_(with_isa(
          isa,
          [&]<Isa level>() { return compensated_loops<level>(this->width() * sizeof(float)); })),
      coefficient_(this->coefficients.value.size()),
      increment_(coefficient_.size()),
      target_(coefficient_.size()),
      value_(max_block_frames * program.inputs.size() * this->width()),
      value_rest_(value_.size()),
      velocity_(value_.size()),
      audio_(max_block_frames * program.audio_coefficients.size() * this->width()),
      outputs_(max_block_frames * program.outputs.size() * this->width()),
      output_rest_(outputs_.size()) {
  this->reset_lanes();
}

template <class T>
void CompensatedKernel<T>::play(const Block<T>& block) {
  auto& coefficients = this->coefficients;
  const Program& program = this->program_;
  const std::size_t width = this->width();
  const std::size_t inputs = block.frames * program.inputs.size() * width;
  const std::size_t audio = block.frames * program.audio_coefficients.size() * width;
  const std::size_t outputs = block.frames * program.outputs.size() * width;
  narrow_all(coefficients.value.data(), coefficient_.size(), coefficient_);
  narrow_all(coefficients.increment.data(), coefficient_.size(), increment_);
  narrow_all(coefficients.target.data(), coefficient_.size(), target_);
  narrow_all(block.value, inputs, value_);
  std::transform(block.value, block.value + inputs, value_rest_.begin(), rest_of<T>);
  narrow_all(block.velocity, inputs, velocity_);
  narrow_all(block.audio, audio, audio_);
  DirectState<float> state(
      {coefficient_.data(), increment_.data(), target_.data(), coefficients.ramping.data(),
       coefficients.ramping.size(), width, coefficients.ramp_frames},
      this->nodes_);
  state.value_rest = value_rest_.data();
  state.output_rest = output_rest_.data();
  loops_.step(program, state,
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
  std::for_each(program.audio_coefficients.begin(), program.audio_coefficients.end(), keep);
  coefficients.finish(block.frames);
  for (std::size_t i = 0; i < outputs; ++i) {
    block.outputs[i] = static_cast<T>(outputs_[i]) + static_cast<T>(output_rest_[i]);
  }
}

template class CompensatedKernel<float>;
template class CompensatedKernel<double>;

}  // namespace ressort::kernels
