// tests: compares a kernel with the direct one under the same inputs and parameter changes.
#pragma once

#include <span>

#include "tests/support/harness.h"

namespace ressort::support {

struct ComparisonOptions {
  std::size_t frames = 44100;
  std::uint64_t seed = 1;
  double reach = 0.1;      // Amplitude of the inputs, in positions or forces.
  double push = 0.0;       // Amplitude of force inputs, if not 0.
  double lowest_hz = 0.5;  // Lowest frequency of position inputs.
  double highest_hz = 6.0;
  bool turns = false;  // Parameters change by up to a tenth, ramped over 128 samples.
  double pitch = 1.0;  // Stiffness factor of the first voice.
  Isa isa = best_isa();
};

// The inputs of a comparison. Blocks have uneven lengths, as if cut by events.
struct Score {
  struct Block {
    std::size_t frames = 0;
    std::vector<double> parameters;  // New values at the start of the block; empty: unchanged.
  };
  double pitch = 1.0;
  std::vector<Block> blocks;
  std::vector<std::vector<double>> inputs;  // [frame][input]
  std::vector<std::vector<double>> audio;   // [frame][audio parameter]
};

inline Score score_of(const Program& program, const ComparisonOptions& options) {
  std::vector<Motion> motions;
  for (std::size_t i = 0; i < program.inputs.size(); ++i) {
    const bool is_force = program.inputs[i].is_force;
    motions.emplace_back(options.seed + i, is_force ? 20.0 : options.lowest_hz,
                         is_force ? 5000.0 : options.highest_hz);
  }
  Score score{.pitch = options.pitch, .blocks = {}, .inputs = {}, .audio = {}};
  Random random(options.seed);
  std::size_t next_turn = 1000;
  for (std::size_t at = 0; at < options.frames; at += score.blocks.back().frames) {
    Score::Block block;
    if (options.turns && at >= next_turn) {
      block.parameters = program.parameters;
      for (double& parameter : block.parameters) {
        parameter *= random.uniform(0.9, 1.1);
      }
      next_turn = at + 500 + random.below(3000);
    }
    const std::size_t longest = random.below(4) == 0 ? 1 + random.below(64) : 64;
    block.frames = std::min(longest, options.frames - at);
    score.blocks.push_back(std::move(block));
  }
  for (std::size_t n = 0; n < options.frames; ++n) {
    score.inputs.emplace_back();
    for (std::size_t i = 0; i < motions.size(); ++i) {
      const InputSlot& input = program.inputs[i];
      const double start = input.is_force ? 0.0 : program.position[input.node];
      const bool is_pushed = input.is_force && options.push != 0.0;
      score.inputs[n].push_back(start + (is_pushed ? options.push : options.reach) * motions[i](n));
    }
    score.audio.emplace_back();
    for (std::size_t i = 0; i < program.audio_parameters.size(); ++i) {
      score.audio[n].push_back(0.02 + 0.01 * std::sin(0.3 * static_cast<double>(n * (i + 1))));
    }
  }
  return score;
}

// One kernel, played block by block.
template <class T>
class KernelRunner {
 public:
  KernelRunner(const Program& program, double pitch, Isa isa)
      : program_(program),
        kernel_(make_kernel<T>(program_, 1, isa)),
        width_(kernel_->width()),
        parameters_(program.parameters),
        pitch_(pitch) {
    value_.resize(max_block_frames * program_.inputs.size() * width_);
    velocity_.resize(value_.size());
    audio_.resize(max_block_frames * program_.audio_coefficients.size() * width_);
    outputs_.resize(max_block_frames * program_.outputs.size() * width_);
    turn(program_.parameters, pitch, false);
    for (const InputSlot& input : program_.inputs) {
      before_.push_back(input.is_force ? 0.0 : program_.position[input.node]);
    }
  }

  void turn(const std::vector<double>& parameters, double pitch, bool ramped) {
    parameters_ = parameters;
    pitch_ = pitch;
    for (std::uint32_t c = 0; c < program_.coefficients.size(); ++c) {
      for (std::size_t lane = 0; lane < width_; ++lane) {
        kernel_->coefficients.set(lane, c, coefficient(c), ramped);
      }
    }
    if (ramped) {
      kernel_->coefficients.ramp(128);
    }
  }

  // Takes inputs[frame][input] and audio[frame][audio parameter]; returns [frame][output].
  std::vector<double> play(std::span<const std::vector<double>> inputs,
                           std::span<const std::vector<double>> audio = {}) {
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
    fill_audio(audio);
    kernel_->step({.frames = inputs.size(),
                   .value = value_.data(),
                   .velocity = velocity_.data(),
                   .audio = audio_.data(),
                   .outputs = outputs_.data()});
    std::vector<double> heard;
    for (std::size_t i = 0; i < inputs.size() * program_.outputs.size(); ++i) {
      heard.push_back(static_cast<double>(outputs_[i * width_]));
    }
    return heard;
  }

  const Kernel<T>& kernel() const { return *kernel_; }

 private:
  double coefficient(std::uint32_t c) const {
    return coefficient_value(program_, program_.coefficients[c], parameters_, pitch_);
  }

  void fill_audio(std::span<const std::vector<double>> audio) {
    auto place = audio_.begin();
    for (const std::vector<double>& values : audio) {
      for (std::size_t i = 0; i < values.size(); ++i) {
        parameters_[program_.audio_parameters[i].parameter] = values[i];
      }
      for (const std::uint32_t c : program_.audio_coefficients) {
        place = std::fill_n(place, width_, static_cast<T>(coefficient(c)));
      }
    }
  }

  Program program_;
  std::unique_ptr<Kernel<T>> kernel_;
  std::size_t width_;
  std::vector<double> parameters_;
  double pitch_;
  Aligned<T> value_;
  Aligned<T> velocity_;
  Aligned<T> audio_;
  Aligned<T> outputs_;
  std::vector<double> before_;
};

// [frame][output]
template <class T>
std::vector<double> perform(const Program& program, const Score& score, Isa isa) {
  KernelRunner<T> fighter(program, score.pitch, isa);
  const std::span inputs(score.inputs);
  const std::span audio(score.audio);
  std::vector<double> heard;
  std::size_t at = 0;
  for (const Score::Block& block : score.blocks) {
    if (!block.parameters.empty()) {
      fighter.turn(block.parameters, score.pitch, true);
    }
    const auto some =
        fighter.play(inputs.subspan(at, block.frames), audio.subspan(at, block.frames));
    heard.insert(heard.end(), some.begin(), some.end());
    at += block.frames;
  }
  return heard;
}

// Plays the direct form in double.
inline std::vector<double> perform_directly(const Program& program, const Score& score) {
  Program plain = program;
  plain.form = Form();
  return perform<double>(plain, score, Isa::base);
}

// Returns one Comparison per output.
inline std::vector<Comparison> compare(std::size_t outputs, std::span<const double> expected,
                                       std::span<const double> found) {
  std::vector<Comparison> comparisons(outputs);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    comparisons[i % outputs].add(expected[i], found[i]);
  }
  return comparisons;
}

// Compares `formed` in precision T with the same Program in the direct form in double.
template <class T>
std::vector<Comparison> compare_kernels(const Program& formed, const ComparisonOptions& options) {
  const Score score = score_of(formed, options);
  return compare(formed.outputs.size(), perform_directly(formed, score),
                 perform<T>(formed, score, options.isa));
}

// Checks every output on every instruction set: double to within `relative`, float to at least
// `db`.
inline void same_as_direct(const Program& program, ComparisonOptions options, double relative,
                           double db) {
  for (const Isa isa : isas()) {
    options.isa = isa;
    INFO(isa_name(isa));
    for (const Comparison& output : compare_kernels<double>(program, options)) {
      INFO("double is off by " << show(output.relative()));
      CHECK(output.peak > 0.0);
      CHECK(output.relative() < relative);
    }
    for (const Comparison& output : compare_kernels<float>(program, options)) {
      INFO("float has " << output.snr_db() << " dB");
      CHECK(output.snr_db() > db);
    }
  }
}

}  // namespace ressort::support
