#include "core/compile/make_engine.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/engine/voices.h"
#include "core/format.h"
#include "core/kernels/passive/clusters.h"
#include "core/kernels/registry.h"
#include "core/kernels/threads/executor.h"

namespace ressort::compile {
namespace {

std::string in_bytes(std::uint64_t bytes) {
  const double mega = static_cast<double>(bytes) / 1e6;
  return mega < 1e3 ? formatted("%.0f MB", mega) : formatted("%.1f GB", mega / 1e3);
}

}  // namespace

std::uint64_t engine_bytes(const Machine& machine, int voices, Precision precision,
                           const Executor* executor) {
  const std::uint64_t number_bytes =
      precision == Precision::float32 ? sizeof(float) : sizeof(double);
  constexpr std::uint64_t fixed_bytes = 131'072;  // MIDI channels, tunings, the mix
  std::uint64_t bytes = 0;
  for (const Program& program : machine.parts) {
    bytes += voice_bytes(program, number_bytes);
  }
  // Live helpers need a copy, and a spare copy for the tasks of a late helper.
  const std::uint64_t places = executor != nullptr && executor->is_live() ? 3 : 1;
  return fixed_bytes + places * bytes * lane_count(voices);
}

std::optional<Error> check_memory(const Machine& machine, int voices, Precision precision,
                                  const Executor* executor, std::uint64_t most_bytes) {
  const auto bytes_of = [&](int count) {
    return engine_bytes(machine, count, precision, executor);
  };
  if (bytes_of(voices) <= most_bytes) {
    return std::nullopt;
  }
  int fitting = voices;
  while (fitting > 0 && bytes_of(fitting) > most_bytes) {
    --fitting;
  }
  std::size_t masses = 0;
  for (const Program& program : machine.parts) {
    masses += program.moving;
  }
  return Error{std::to_string(voices) + (voices == 1 ? " voice" : " voices") + " of " +
               std::to_string(masses) + " masses need " + in_bytes(bytes_of(voices)) +
               " of memory, but only " + in_bytes(most_bytes) + " are free; " +
               (fitting > 0 ? "lower the voices to " + std::to_string(fitting)
                            : std::string("use a smaller model"))};
}

std::optional<double> find_gain(const Machine& machine, const Playing& playing, Precision precision,
                                Isa isa, const Progress& progress) {
  constexpr double forte = 0.8;
  constexpr double most_steps = 4e6;
  constexpr double most_steps_at_worst = 1e9;
  constexpr double most_steps_of_block = 4e6;
  // Passive links are solved together by Newton's method.
  constexpr double steps_of_shared_link = 200.0;
  double steps = 1.0;  // steps per sample
  double at_worst = 1.0;
  for (const Program& program : machine.parts) {
    at_worst += worst_steps(program);
    steps += program.moving;
    for (const Cluster& cluster : passive_tables(program).clusters) {
      steps += steps_of_shared_link * cluster.count;
    }
  }
  const double least = 0.05 * machine.rate_hz;
  const double most = std::min(machine.rate_hz, most_steps_at_worst / at_worst);
  if (most < least) {
    return std::nullopt;
  }
  Engine engine(machine, playing, precision, isa, progress);
  const auto frames = static_cast<std::size_t>(std::clamp(most_steps / steps, least, most));
  const auto block =
      static_cast<std::size_t>(std::clamp(most_steps_of_block / at_worst, 1.0, 256.0));
  std::vector<std::vector<double>> channels(machine.channels, std::vector<double>(block));
  std::vector<double*> outputs;
  for (std::vector<double>& channel : channels) {
    outputs.push_back(channel.data());
  }
  const Event note{.kind = EventKind::note_on, .index = 60, .value = forte};
  double peak = 0.0;
  for (std::size_t at = 0; at < frames; at += block) {
    progress.spend(static_cast<std::size_t>(static_cast<double>(block) * at_worst));
    engine.process({&note, at == 0 ? std::size_t{1} : std::size_t{0}}, {}, outputs, block);
    for (const std::vector<double>& channel : channels) {
      for (const double sample : channel) {
        peak = std::max(peak, std::fabs(sample));
      }
    }
  }
  return peak > 1e-12 ? found_gain_peak / peak : 1.0;
}

std::unique_ptr<Engine> make_engine(Machine machine, Playing playing, Precision precision, Isa isa,
                                    const Progress& progress, Executor* executor) {
  return std::make_unique<Engine>(std::move(machine), std::move(playing), precision, isa, progress,
                                  executor);
}

}  // namespace ressort::compile
