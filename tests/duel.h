// tests: a kernel against the direct one, the same hands and the same turns of parameters on both.
#pragma once

#include "tests/rig.h"

namespace ressort::rig {

struct DuelOptions {
  std::size_t frames = 44100;
  std::uint64_t seed = 1;
  double reach = 0.1;      // of the first input's motion, in positions or forces
  double lowest_hz = 0.5;  // of the position inputs' motion
  double highest_hz = 6.0;
  bool turns = false;  // parameters move by up to a tenth, ramped over 128 samples
  double pitch = 1.0;  // stiffness factor of the first voice
  Isa isa = best_isa();
};

// One kernel, driven block by block.
template <class T>
class Fighter {
 public:
  Fighter(const Program& program, double pitch, Isa isa)
      : program_(program), kernel_(make_kernel<T>(program_, 1, isa)), width_(kernel_->width()) {
    value_.resize(max_block_frames * program_.inputs.size() * width_);
    velocity_.resize(value_.size());
    outputs_.resize(max_block_frames * program_.outputs.size() * width_);
    turn(program_.parameters, pitch, false);
    for (const InputSlot& input : program_.inputs) {
      before_.push_back(input.is_force ? 0.0 : program_.position[input.node]);
    }
  }

  void turn(const std::vector<double>& parameters, double pitch, bool ramped) {
    for (std::uint32_t c = 0; c < program_.coefficients.size(); ++c) {
      const double value = coefficient_value(program_, program_.coefficients[c], parameters, pitch);
      for (std::size_t lane = 0; lane < width_; ++lane) {
        kernel_->coefficients.set(lane, c, value, ramped);
      }
    }
    if (ramped) {
      kernel_->coefficients.ramp(128);
    }
  }

  // inputs[frame][input]; gives [frame][output].
  std::vector<double> play(const std::vector<std::vector<double>>& inputs) {
    const std::size_t count = program_.inputs.size();
    for (std::size_t n = 0; n < inputs.size(); ++n) {
      for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t lane = 0; lane < width_; ++lane) {
          const std::size_t at = (n * count + i) * width_ + lane;
          value_[at] = static_cast<T>(inputs[n][i]);
          velocity_[at] = static_cast<T>(inputs[n][i] - before_[i]);
        }
        before_[i] = inputs[n][i];
      }
    }
    kernel_->step({.frames = inputs.size(),
                   .value = value_.data(),
                   .velocity = velocity_.data(),
                   .audio = nullptr,
                   .outputs = outputs_.data()});
    std::vector<double> heard;
    for (std::size_t i = 0; i < inputs.size() * program_.outputs.size(); ++i) {
      heard.push_back(static_cast<double>(outputs_[i * width_]));
    }
    return heard;
  }

 private:
  Program program_;
  std::unique_ptr<Kernel<T>> kernel_;
  std::size_t width_;
  Aligned<T> value_;
  Aligned<T> velocity_;
  Aligned<T> outputs_;
  std::vector<double> before_;
};

// How far `formed` in precision T is from the same Program in the direct form in double: one
// Comparison for each output. Blocks are of uneven lengths, as a host's events cut them.
template <class T>
std::vector<Comparison> duel(const Program& formed, const DuelOptions& options) {
  Program plain = formed;
  plain.form = Direct{};
  Fighter<double> reference(plain, options.pitch, Isa::base);
  Fighter<T> kernel(formed, options.pitch, options.isa);
  std::vector<Motion> motions;
  for (std::size_t i = 0; i < formed.inputs.size(); ++i) {
    const bool is_force = formed.inputs[i].is_force;
    motions.emplace_back(options.seed + i, is_force ? 20.0 : options.lowest_hz,
                         is_force ? 5000.0 : options.highest_hz);
  }
  Random random(options.seed);
  std::vector<Comparison> outputs(formed.outputs.size());
  std::vector<double> parameters = formed.parameters;
  std::size_t next_turn = 1000;
  for (std::size_t at = 0; at < options.frames;) {
    if (options.turns && at >= next_turn) {
      for (std::size_t i = 0; i < parameters.size(); ++i) {
        parameters[i] = formed.parameters[i] * random.uniform(0.9, 1.1);
      }
      reference.turn(parameters, options.pitch, true);
      kernel.turn(parameters, options.pitch, true);
      next_turn = at + 500 + random.below(3000);
    }
    const std::size_t longest = random.below(4) == 0 ? 1 + random.below(64) : 64;
    const std::size_t frames = std::min(longest, options.frames - at);
    std::vector<std::vector<double>> inputs(frames);
    for (std::size_t n = 0; n < frames; ++n) {
      for (std::size_t i = 0; i < motions.size(); ++i) {
        const double start =
            formed.inputs[i].is_force ? 0.0 : formed.position[formed.inputs[i].node];
        inputs[n].push_back(start + options.reach * motions[i](at + n));
      }
    }
    const auto expected = reference.play(inputs);
    const auto found = kernel.play(inputs);
    for (std::size_t i = 0; i < expected.size(); ++i) {
      outputs[i % outputs.size()].add(expected[i], found[i]);
    }
    at += frames;
  }
  return outputs;
}

}  // namespace ressort::rig
