#include "app/timing.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <vector>

#include "app/denormals.h"
#include "core/engine/kernel.h"

namespace ressort {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::microseconds longest{3000};  // for all parts
constexpr std::size_t least_blocks = 3;

template <class T>
double measured_ns(const Program& program, std::size_t voices, Isa isa, Clock::duration patience) {
  std::vector<std::unique_ptr<Kernel<T>>> kernels;
  do {
    kernels.push_back(make_kernel<T>(program, voices, isa));
  } while (kernels.size() * kernels[0]->width() < voices);
  const std::size_t width = kernels[0]->width();
  for (const auto& kernel : kernels) {
    for (std::size_t lane = 0; lane < width; ++lane) {
      for (std::uint32_t c = 0; c < program.coefficients.size(); ++c) {
        kernel->coefficients.set(
            lane, c, coefficient_value(program, program.coefficients[c], program.parameters, 1.0),
            false);
      }
    }
  }
  Aligned<T> value(max_block_frames * width * program.inputs.size());
  for (std::size_t i = 0; i < value.size(); ++i) {
    const InputSlot& input = program.inputs[i / width % program.inputs.size()];
    value[i] = input.is_force ? T(0) : static_cast<T>(program.position[input.node]);
  }
  const Aligned<T> velocity(value.size());
  const Aligned<T> audio(max_block_frames * width * program.audio_coefficients.size());
  Aligned<T> outputs(max_block_frames * width * program.outputs.size());
  const DenormalsFlushed flushed;
  auto fastest = Clock::duration::max();
  const auto end = Clock::now() + patience;
  for (std::size_t block = 0; block < least_blocks || Clock::now() < end; ++block) {
    const auto start = Clock::now();
    for (const auto& kernel : kernels) {
      kernel->step({.frames = max_block_frames,
                    .value = value.data(),
                    .velocity = velocity.data(),
                    .audio = audio.data(),
                    .outputs = outputs.data()});
    }
    fastest = std::min(fastest, Clock::now() - start);
  }
  return std::chrono::duration<double, std::nano>(fastest).count() / max_block_frames;
}

}  // namespace

void measure(Plan& plan, const Engine& engine, const CompileOptions& options, int voices) {
  auto part = plan.parts.begin();
  for (const Program& program : engine.machine().parts) {
    if (program.moving == 0) {
      continue;
    }
    const auto patience = longest / static_cast<long>(plan.parts.size());
    const auto count = static_cast<std::size_t>(std::max(1, voices));
    (part++)->measured_ns = options.precision == Precision::float32
                                ? measured_ns<float>(program, count, options.isa, patience)
                                : measured_ns<double>(program, count, options.isa, patience);
  }
}

}  // namespace ressort
