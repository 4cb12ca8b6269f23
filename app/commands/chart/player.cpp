#include "app/commands/chart/player.h"

#include <algorithm>
#include <cmath>

#include "app/realtime/denormals.h"
#include "core/kernels/kernel.h"

namespace ressort::commands {
namespace {

constexpr std::size_t most_kept = std::size_t{1} << 22;  // samples of a motion

// An input, with its first positions computed in advance, so that timing excludes them.
struct InputTrack {
  double at(std::size_t n) const {
    return n < kept.size() ? kept[n] : motion(static_cast<double>(n + 1) / rate_hz);
  }
  InputMotion motion;  // null: at rest
  double rate_hz = 0.0;
  double start = 0.0;
  std::vector<double> kept = {};
};

// One part's kernel with the buffers of its inputs and outputs.
template <class T>
struct PlayedPart {
  PlayedPart(const Program& program_in, Isa isa)
      : program(program_in),
        kernel(make_kernel<T>(program, 1, isa)),
        lanes(kernel->width()),
        value(max_block_frames * lanes * program.inputs.size()),
        velocity(value.size()),
        outputs(max_block_frames * lanes * program.outputs.size()),
        before(program.inputs.size()) {
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      for (std::uint32_t c = 0; c < program.coefficients.size(); ++c) {
        kernel->coefficients.set(
            lane, c, coefficient_value(program, program.coefficients[c], program.parameters, 1.0),
            false);
      }
    }
  }
  void feed(std::size_t frame, std::size_t input, double x, double v) {
    const std::size_t first = (frame * program.inputs.size() + input) * lanes;
    for (std::size_t i = first; i < first + lanes; ++i) {
      value[i] = static_cast<T>(x);
      velocity[i] = static_cast<T>(v);
    }
  }

  const Program& program;
  std::unique_ptr<Kernel<T>> kernel;
  std::size_t lanes;
  Aligned<T> value;  // [frame][input][lane]
  Aligned<T> velocity;
  Aligned<T> outputs;          // [frame][output][lane]
  std::vector<double> before;  // [input] previous position
};

template <class T>
class KernelPlayer final : public ChartPlayer {
 public:
  KernelPlayer(const Machine& machine, const std::vector<InputMotion>& motions, double seconds,
               Isa isa)
      : channels_(machine.channels) {
    for (std::size_t i = 0; i < machine.inputs.size(); ++i) {
      const InputMotion& motion = motions[i];
      InputTrack& track = tracks_.emplace_back(
          InputTrack{motion, machine.rate_hz, motion ? motion(0.0) : machine.inputs[i].position});
      const auto wanted = static_cast<std::size_t>(std::lround(seconds * machine.rate_hz));
      for (std::size_t n = 0; motion && n < std::min(wanted, most_kept); ++n) {
        track.kept.push_back(motion(static_cast<double>(n + 1) / machine.rate_hz));
      }
    }
    parts_.reserve(machine.parts.size());
    for (const Program& program : machine.parts) {
      if (program.moving > 0) {
        parts_.emplace_back(program, isa);
      }
    }
    rewind();
  }

  void rewind() override {
    for (PlayedPart<T>& part : parts_) {
      for (std::size_t lane = 0; lane < part.lanes; ++lane) {
        part.kernel->reset(lane);
      }
    }
    frame_ = 0;
    for (PlayedPart<T>& part : parts_) {
      for (std::size_t i = 0; i < part.program.inputs.size(); ++i) {
        const InputTrack& track = tracks_[part.program.inputs[i].input];
        part.before[i] = track.start;
        for (std::size_t n = 0; n < max_block_frames; ++n) {
          part.feed(n, i, track.start, 0.0);
        }
      }
    }
  }

  void play(std::size_t frames, double* outputs) override {
    const DenormalsFlushed flushed;
    if (outputs != nullptr) {
      std::fill_n(outputs, frames * channels_, 0.0);
    }
    for (std::size_t done = 0; done < frames;) {
      const std::size_t count = std::min(max_block_frames, frames - done);
      for (PlayedPart<T>& part : parts_) {
        feed(part, count);
        part.kernel->step({.frames = count,
                           .value = part.value.data(),
                           .velocity = part.velocity.data(),
                           .audio = nullptr,
                           .outputs = part.outputs.data()});
        if (outputs != nullptr) {
          collect(part, count, outputs + done * channels_);
        }
      }
      frame_ += count;
      done += count;
    }
  }

  bool save(States& x, States& v) const override {
    x.resize(parts_.size());
    v.resize(parts_.size());
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      x[i].resize(parts_[i].program.position.size());
      v[i].resize(x[i].size());
      if (!parts_[i].kernel->save(0, x[i].data(), v[i].data())) {
        return false;
      }
    }
    return true;
  }

 private:
  void feed(PlayedPart<T>& part, std::size_t count) {
    for (std::size_t i = 0; i < part.program.inputs.size(); ++i) {
      const InputTrack& track = tracks_[part.program.inputs[i].input];
      for (std::size_t n = 0; track.motion && n < count; ++n) {
        const double x = track.at(frame_ + n);
        part.feed(n, i, x, x - part.before[i]);
        part.before[i] = x;
      }
    }
  }

  void collect(const PlayedPart<T>& part, std::size_t count, double* outputs) const {
    const auto& slots = part.program.outputs;
    for (std::size_t n = 0; n < count; ++n) {
      for (std::size_t i = 0; i < slots.size(); ++i) {
        outputs[n * channels_ + slots[i].channel] +=
            static_cast<double>(part.outputs[(n * slots.size() + i) * part.lanes]);
      }
    }
  }

  std::size_t channels_;
  std::vector<InputTrack> tracks_;  // [input]
  std::vector<PlayedPart<T>> parts_;
  std::size_t frame_ = 0;
};

}  // namespace

std::unique_ptr<ChartPlayer> make_player(const Machine& machine,
                                         const std::vector<InputMotion>& motions, double seconds,
                                         Precision precision, Isa isa) {
  if (precision == Precision::float64) {
    return std::make_unique<KernelPlayer<double>>(machine, motions, seconds, isa);
  }
  return std::make_unique<KernelPlayer<float>>(machine, motions, seconds, isa);
}

}  // namespace ressort::commands
