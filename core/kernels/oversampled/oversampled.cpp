#include "core/kernels/oversampled/oversampled.h"

#include <algorithm>
#include <utility>

#include "core/kernels/oversampled/oversampled_form.h"

namespace ressort::kernels {

static_assert(most_oversampling <= max_block_frames);

template <class T>
OversampledKernel<T>::OversampledKernel(const Program& program, const Oversampled& form,
                                        std::size_t voices, Isa isa)
    : OversampledKernel(program, form, make_kernel<T>(*form.fine, voices, isa),
                        form.coarse ? make_kernel<T>(*form.coarse, voices, isa) : nullptr) {}

template <class T>
OversampledKernel<T>::OversampledKernel(const Program& program, const Oversampled& form,
                                        std::unique_ptr<Kernel<T>> fine,
                                        std::unique_ptr<Kernel<T>> coarse)
    : Kernel<T>(program, fine->width()),
      program_(program),
      times_(form.times),
      fine_(std::move(fine)),
      coarse_(std::move(coarse)),
      warp_(this->width()),
      value_(times_ * program.inputs.size() * this->width()),
      velocity_(value_.size()),
      audio_(times_ * program.audio_coefficients.size() * this->width()),
      outputs_(times_ * program.outputs.size() * this->width()),
      position_(program.position.size()),
      speed_(program.position.size()) {
  for (const Coefficient& coefficient : program.coefficients) {
    factor_.push_back(
        static_cast<T>(rate_factor(coefficient.unit, 1.0 / static_cast<double>(times_))));
    is_stiffness_.push_back(coefficient.unit == Unit::stiffness);
  }
  for (std::size_t lane = 0; lane < this->width(); ++lane) {
    this->reset(lane);
  }
}

template <class T>
void OversampledKernel<T>::tune(std::size_t lane, const VoicePitch& pitch) {
  if (!coarse_ || !(pitch.is_new || is_coarse(lane))) {
    return;
  }
  this->coefficients.has_changed = true;
  const auto times = static_cast<double>(times_);
  if (pitch.warp > 0.0 && pitch.share * times * times <= 1.0) {
    warp_[lane] = static_cast<T>(pitch.warp);
    return;
  }
  const bool is_moved =
      is_coarse(lane) && !pitch.is_new && coarse_->save(lane, position_.data(), speed_.data());
  warp_[lane] = T(0);
  if (is_moved) {
    for (double& speed : speed_) {
      speed /= times;
    }
    fine_->set_state(lane, position_.data(), speed_.data());
  }
}

template <class T>
void OversampledKernel<T>::set_state(std::size_t lane, const double* x, const double* v) {
  for (std::size_t node = 0; node < speed_.size(); ++node) {
    speed_[node] = v[node] / steps_of(lane);
  }
  of(lane).set_state(lane, x, speed_.data());
}

template <class T>
bool OversampledKernel<T>::save(std::size_t lane, double* x, double* v) const {
  if (!of(lane).save(lane, x, v)) {
    return false;
  }
  for (std::size_t node = 0; node < speed_.size(); ++node) {
    v[node] *= steps_of(lane);
  }
  return true;
}

template <class T>
void OversampledKernel<T>::strike(std::size_t lane, std::span<const std::uint32_t> nodes,
                                  std::span<const double> changes) {
  refine_coefficients();  // A voice may be struck before its first step.
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const double change = changes[i] / steps_of(lane);
    of(lane).strike(lane, nodes.subspan(i, 1), {&change, 1});
  }
}

template <class T>
std::size_t OversampledKernel<T>::read_positions(std::size_t lane,
                                                 std::span<const std::uint32_t> nodes,
                                                 std::span<double> numbers) const {
  return of(lane).read_positions(lane, nodes, numbers);
}

template <class T>
void OversampledKernel<T>::refine_coefficients() {
  const std::size_t width = this->width();
  fine_->coefficients.has_changed = true;
  if (coarse_) {
    coarse_->coefficients.has_changed = true;
  }
  for (std::size_t c = 0; c < factor_.size(); ++c) {
    for (std::size_t lane = 0; lane < width; ++lane) {
      const T value = this->coefficients.value[c * width + lane];
      fine_->coefficients.value[c * width + lane] = value * factor_[c];
      if (coarse_) {
        // A lane of the coarse kernel without a voice stays stable, too.
        coarse_->coefficients.value[c * width + lane] = !is_coarse(lane)   ? value * factor_[c]
                                                        : is_stiffness_[c] ? value * warp_[lane]
                                                                           : value;
      }
    }
  }
}

template <class T>
void OversampledKernel<T>::step_finely(const T* value, const T* velocity, const T* audio) {
  const std::size_t width = this->width();
  const T part = T(1) / static_cast<T>(times_);
  for (std::size_t i = 0; i < program_.inputs.size() * width; ++i) {
    const bool is_force = program_.inputs[i / width].is_force;
    for (std::size_t step = 0; step < times_; ++step) {
      const std::size_t at = step * program_.inputs.size() * width + i;
      const T left = static_cast<T>(times_ - 1 - step) * part;
      value_[at] = is_force ? value[i] * part * part : value[i] - left * velocity[i];
      velocity_[at] = velocity[i] * part;
    }
  }
  const auto& turned = program_.audio_coefficients;
  for (std::size_t i = 0; i < turned.size() * width; ++i) {
    for (std::size_t step = 0; step < times_; ++step) {
      audio_[step * turned.size() * width + i] = audio[i] * factor_[turned[i / width]];
    }
  }
  fine_->step({.frames = times_,
               .value = value_.data(),
               .velocity = velocity_.data(),
               .audio = turned.empty() ? nullptr : audio_.data(),
               .outputs = outputs_.data()});
}

template <class T>
void OversampledKernel<T>::play(const Block<T>& block) {
  Ramps<T> ramps = ramps_of(this->coefficients);
  const std::size_t width = this->width();
  const std::size_t inputs = program_.inputs.size() * width;
  const std::size_t outputs = program_.outputs.size() * width;
  const std::size_t turned = program_.audio_coefficients.size() * width;
  const auto end = warp_.begin() + static_cast<std::ptrdiff_t>(std::min(width, block.lanes));
  const bool has_fine = std::find(warp_.begin(), end, T(0)) != end;
  const bool has_coarse = std::find_if(warp_.begin(), end, [](T w) { return w > T(0); }) != end;
  if (std::exchange(this->coefficients.has_changed, false)) {
    refine_coefficients();
  }
  for (std::size_t frame = 0; frame < block.frames;) {
    const bool moves = ramps.frames > 0;
    if (moves) {
      advance(ramps);
      refine_coefficients();
    }
    const std::size_t next = moves ? frame + 1 : block.frames;
    if (has_coarse) {
      coarse_->step({.frames = next - frame,
                     .value = block.value + frame * inputs,
                     .velocity = block.velocity + frame * inputs,
                     .is_still = block.is_still,
                     .audio = block.audio + frame * turned,
                     .outputs = block.outputs + frame * outputs,
                     .lanes = block.lanes});
    }
    for (; has_fine && frame < next; ++frame) {
      step_finely(block.value + frame * inputs, block.velocity + frame * inputs,
                  block.audio + frame * turned);
      const T* const last = outputs_.data() + outputs_.size() - outputs;
      for (std::size_t i = 0; i < outputs; ++i) {
        block.outputs[frame * outputs + i] =
            is_coarse(i % width) ? block.outputs[frame * outputs + i] : last[i];
      }
    }
    frame = next;
  }
  this->coefficients.finish(block.frames);
}

template <class T>
bool OversampledKernel<T>::is_near_start(std::size_t lane, double bound) const {
  return of(lane).is_near_start(lane, bound);
}

template class OversampledKernel<float>;
template class OversampledKernel<double>;

}  // namespace ressort::kernels
