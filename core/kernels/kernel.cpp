#include "core/kernels/kernel.h"

#include <algorithm>

#include "core/kernels/chains/chains.h"
#include "core/kernels/chorus/chorus.h"
#include "core/kernels/dense/dense.h"
#include "core/kernels/direct/compensated.h"
#include "core/kernels/direct/direct.h"
#include "core/kernels/direct/fourth.h"
#include "core/kernels/domains/sharded.h"
#include "core/kernels/grid/grid.h"
#include "core/kernels/modal/modal.h"
#include "core/kernels/slow/slow.h"

namespace ressort {

template <class T>
Coefficients<T>::Coefficients(const Program& program, std::size_t width_in)
    : width(width_in),
      value(program.coefficients.size() * width),
      increment(value.size()),
      target(value.size()),
      is_ramping(program.coefficients.size()) {
  ramping.reserve(program.coefficients.size());
}

template <class T>
void Coefficients<T>::set(std::size_t lane, std::uint32_t c, double wanted, bool ramped) {
  if (ramped && !is_ramping[c]) {
    is_ramping[c] = true;
    ramping.push_back(c);
    for (std::size_t i = c * width; i < (c + 1) * width; ++i) {
      target[i] = value[i];
    }
  }
  const std::size_t at = c * width + lane;
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
void Coefficients<T>::go_on(std::size_t lane, const Coefficients& from, std::size_t from_lane) {
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
    }
    ramping.clear();
  }
}

template <class T>
bool Kernel<T>::read(std::span<const std::uint32_t>, T*, T*) const {
  return false;
}

template <class T>
bool Kernel<T>::mend(std::span<const std::uint32_t>, const T*, const T*) {
  return false;
}

template <class T>
std::unique_ptr<Kernel<T>> make_kernel(const Program& program, std::size_t voices, Isa isa) {
  struct Maker {
    const Program& program;
    std::size_t voices;
    Isa isa;
    std::unique_ptr<Kernel<T>> operator()(const Direct&) const {
      return std::make_unique<DirectKernel<T>>(program, voices, isa);
    }
    std::unique_ptr<Kernel<T>> operator()(const Chains&) const {
      return std::make_unique<ChainsKernel<T>>(program, isa);
    }
    std::unique_ptr<Kernel<T>> operator()(const Dense& form) const {
      return std::make_unique<DenseKernel<T>>(program, form, isa);
    }
    std::unique_ptr<Kernel<T>> operator()(const Modes& modes) const {
      return std::make_unique<ModalKernel<T>>(program, modes, isa);
    }
    std::unique_ptr<Kernel<T>> operator()(const Grid& grid) const {
      return std::make_unique<GridKernel<T>>(program, grid, isa);
    }
    std::unique_ptr<Kernel<T>> operator()(const Chorus& chorus) const {
      return std::make_unique<ChorusKernel<T>>(program, chorus, voices, isa);
    }
    std::unique_ptr<Kernel<T>> operator()(const Shards& shards) const {
      return std::make_unique<ShardedKernel<T>>(program, shards, voices, isa);
    }
    std::unique_ptr<Kernel<T>> operator()(const Fourth& fourth) const {
      return std::make_unique<FourthKernel<T>>(program, fourth, voices, isa);
    }
    std::unique_ptr<Kernel<T>> operator()(const Compensated&) const {
      return std::make_unique<CompensatedKernel<T>>(program, voices, isa);
    }
    std::unique_ptr<Kernel<T>> operator()(const Slow& slow) const {
      return std::make_unique<SlowKernel<T>>(program, slow, isa);
    }
  };
  return std::visit(Maker{program, voices, isa}, program.form);
}

template class Coefficients<float>;
template class Coefficients<double>;
template class Kernel<float>;
template class Kernel<double>;
template std::unique_ptr<Kernel<float>> make_kernel(const Program&, std::size_t, Isa);
template std::unique_ptr<Kernel<double>> make_kernel(const Program&, std::size_t, Isa);

}  // namespace ressort
