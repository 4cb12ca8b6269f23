#include "core/kernels/kernel.h"

#include <algorithm>

namespace ressort::kernels {

template <class T>
Coefficients<T>::Coefficients(const Program& program, std::size_t width_in)
    : width(width_in),
      value(program.coefficients.size() * width),
      increment(value.size()),
      target(value.size()),
      is_ramping(program.coefficients.size()) {
  ramping.reserve(program.coefficients.size());
  // Lanes that no voice has used yet have their points where the others have them. Kernels save
  // work where all lanes agree.
  for (const TapSlot& tap : program.taps) {
    for (const std::uint32_t c : {tap.u, tap.v}) {
      const double start =
          coefficient_value(program, program.coefficients[c], program.parameters, 1.0);
      std::fill_n(value.begin() + static_cast<std::ptrdiff_t>(c * width), width,
                  static_cast<T>(start));
      std::copy_n(value.begin() + static_cast<std::ptrdiff_t>(c * width), width,
                  target.begin() + static_cast<std::ptrdiff_t>(c * width));
    }
  }
}

template <class T>
void Coefficients<T>::set(std::size_t lane, std::uint32_t c, double wanted, bool ramped) {
  const std::size_t at = c * width + lane;
  if (ramped && target[at] == static_cast<T>(wanted)) {
    return;
  }
  if (ramped && !is_ramping[c]) {
    is_ramping[c] = true;
    ramping.push_back(c);
    for (std::size_t i = c * width; i < (c + 1) * width; ++i) {
      target[i] = value[i];
    }
  }
  has_changed = true;
  target[at] = static_cast<T>(wanted);
  if (!ramped) {
    value[at] = target[at];
    increment[at] = T(0);
  }
}

template <class T>
void Coefficients<T>::ramp(std::size_t frames) {
  ramp_frames = ramping.empty() ? 0 : frames;
  for (const std::uint32_t c : ramping) {
    for (std::size_t i = c * width; i < (c + 1) * width; ++i) {
      increment[i] = (target[i] - value[i]) / static_cast<T>(frames);
    }
  }
}

template <class T>
void Coefficients<T>::copy_lane(std::size_t lane, const Coefficients& from, std::size_t from_lane) {
  for (std::uint32_t c = 0; c < is_ramping.size(); ++c) {
    const std::size_t there = c * from.width + from_lane;
    set(lane, c, static_cast<double>(from.value[there]), false);
    if (from.is_ramping[c]) {
      set(lane, c, static_cast<double>(from.target[there]), true);
      increment[c * width + lane] = from.increment[there];
    }
  }
  ramp_frames = std::max(ramp_frames, from.ramp_frames);
}

template <class T>
void Coefficients<T>::finish(std::size_t frames) {
  if (ramp_frames == 0) {
    return;
  }
  ramp_frames -= frames < ramp_frames ? frames : ramp_frames;
  if (ramp_frames == 0) {
    for (const std::uint32_t c : ramping) {
      is_ramping[c] = false;
      std::fill_n(increment.begin() + static_cast<std::ptrdiff_t>(c * width), width, T(0));
    }
    ramping.clear();
  }
}

template <class T>
bool Kernel<T>::read(std::span<const std::uint32_t>, T*, T*) const {
  return false;
}

template class Coefficients<float>;
template class Coefficients<double>;
template class Kernel<float>;
template class Kernel<double>;

}  // namespace ressort::kernels
