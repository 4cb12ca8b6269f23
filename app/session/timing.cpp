#include "app/session/timing.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <vector>

#include "app/realtime/denormals.h"
#include "app/realtime/dsp_load.h"
#include "app/text.h"
#include "core/kernels/kernel.h"

namespace ressort::session {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::microseconds longest{3000};  // for all parts
constexpr std::size_t least_blocks = 3;
constexpr double most_steps = 1e6;  // a sample, of all voices; larger parts are not measured

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
    if (static_cast<double>(count) * worst_steps(program) > most_steps) {
      ++part;
      continue;
    }
    (part++)->measured_ns = options.precision == Precision::float32
                                ? measured_ns<float>(program, count, options.isa, patience)
                                : measured_ns<double>(program, count, options.isa, patience);
  }
}

std::string overload_warning(const Plan& plan, int voices, double rate_hz, Precision precision) {
  double predicted_ns = 0.0;
  for (const Part& part : plan.parts) {
    predicted_ns += part.predicted_ns;
  }
  const double share = predicted_ns * 1e-9 * rate_hz;
  if (!(share > DspLoad::most)) {
    return {};
  }
  const double each = share / std::max(1, voices);
  const int fitting = static_cast<int>(DspLoad::most / each);
  const auto percent = [](double part) {
    return "about " + std::to_string(std::llround(100.0 * part)) + " % of one core";
  };
  return (voices > 1 ? "all " + std::to_string(voices) + " voices" : std::string("its one voice")) +
         " would take " + percent(share) +
         (fitting > 0  ? ": " + std::to_string(fitting) + " fit"
          : voices > 1 ? ", one alone " + percent(each)
                       : "") +
         "; to lower the load, use " + ways_to_lower_load(fitting, precision);
}

std::string ways_to_lower_load(int voices, Precision precision) {
  std::vector<std::string> ways;
  if (voices > 0) {
    ways.push_back("-p " + std::to_string(voices));
  } else {
    ways.emplace_back("a smaller model");
  }
  ways.emplace_back("a lower rate");
  if (precision != Precision::float32) {
    ways.emplace_back("--precision float");
  }
  return joined(ways, ", ");
}

}  // namespace ressort::session
