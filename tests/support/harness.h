// tests: drives networks and compares outputs.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "core/compile/compile.h"
#include "core/compile/machine.h"
#include "core/kernels/kernel.h"
#include "core/model/language/mdl.h"
#include "tests/support/catch.h"
#include "tests/support/networks/scenes.h"
#include "tests/support/random.h"
#include "tests/support/rooms.h"

namespace ressort::support {

inline Network network_of(const std::string& text) {
  ParsedNetwork parsed = parse_network(text);
  std::string errors;
  for (const Diagnostic& diagnostic : parsed.diagnostics) {
    if (diagnostic.severity == Severity::error) {
      errors += to_string(diagnostic, "scene") + "\n";
    }
  }
  INFO(errors);
  REQUIRE(parsed.ok());
  return std::move(parsed.network);
}

// Returns the Program in published units, before a form is chosen.
inline Program program_of(const std::string& text) {
  return make_program(network_of(text), Network::reference_rate_hz, true);
}

// Returns all instruction sets that both machine and build support.
inline std::vector<Isa> isas() {
  std::vector<Isa> all;
  for (const Isa isa : {Isa::base, Isa::v3, Isa::v4}) {
    if (has_isa(isa)) {
      all.push_back(isa);
    }
  }
  return all;
}

// A smooth random motion within -1..1: a sum of slow sines with random frequency and phase. Starts
// at 0.
class Motion {
 public:
  Motion(std::uint64_t seed, double lowest_hz, double highest_hz) {
    Random random(seed);
    for (Sine& sine : sines_) {
      const double hz = lowest_hz * std::pow(highest_hz / lowest_hz, random.uniform(0.0, 1.0));
      sine = {2.0 * std::numbers::pi * hz / 44100.0, random.uniform(0.0, 6.28)};
    }
  }
  double operator()(std::size_t n) const {
    double sum = 0.0;
    for (const Sine& sine : sines_) {
      sum += std::sin(sine.step * static_cast<double>(n) + sine.phase) - std::sin(sine.phase);
    }
    return sum / (2.0 * static_cast<double>(sines_.size()));
  }

 private:
  struct Sine {
    double step = 0.0;
    double phase = 0.0;
  };
  std::array<Sine, 5> sines_;
};

// The kernel of a Program, stepped directly.
template <class T>
class Bare {
 public:
  explicit Bare(Program program, std::size_t voices = 1, Isa isa = best_isa())
      : program_(std::move(program)), kernel_(make_kernel<T>(program_, voices, isa)) {
    value_.resize(program_.inputs.size() * lanes());
    velocity_.resize(value_.size());
    outputs_.resize(program_.outputs.size() * lanes());
    last_ = outputs_;
    for (std::size_t lane = 0; lane < lanes(); ++lane) {
      set_coefficients(lane, program_.parameters, 1.0, false);
      for (const InputSlot& input : program_.inputs) {
        before_.push_back(input.is_force ? 0.0 : program_.position[input.node]);
      }
    }
  }

  std::size_t lanes() const { return kernel_->width(); }

  void set_coefficients(std::size_t lane, const std::vector<double>& parameters, double factor,
                        bool ramped) {
    for (std::uint32_t c = 0; c < program_.coefficients.size(); ++c) {
      kernel_->coefficients.set(
          lane, c, coefficient_value(program_, program_.coefficients[c], parameters, factor),
          ramped);
    }
  }

  // inputs[i] is the same in every lane.
  std::vector<double> step(const std::vector<double>& inputs) {
    for (std::size_t i = 0; i < program_.inputs.size(); ++i) {
      for (std::size_t lane = 0; lane < lanes(); ++lane) {
        feed(lane, i, inputs[i]);
      }
    }
    return run(0);
  }

  // Sets one input's position or force in one lane for the next run().
  void feed(std::size_t lane, std::size_t input, double value) {
    double& before = before_[lane * program_.inputs.size() + input];
    value_[input * lanes() + lane] = static_cast<T>(value);
    velocity_[input * lanes() + lane] = static_cast<T>(value - before);
    before = value;
  }

  // Steps every lane; returns one lane's outputs.
  std::vector<double> run(std::size_t lane) {
    last_ = outputs_;
    kernel_->step({.frames = 1,
                   .value = value_.data(),
                   .velocity = velocity_.data(),
                   .audio = nullptr,
                   .outputs = outputs_.data()});
    return outputs(lane);
  }
  // Adds the positions and velocities of each channel, without levels.
  std::vector<double> outputs(std::size_t lane) const {  // [channel]
    std::vector<double> values;
    for (std::size_t i = 0; i < program_.outputs.size(); ++i) {
      const auto& output = program_.outputs[i];
      values.resize(std::max<std::size_t>(values.size(), output.channel + 1));
      const auto now = static_cast<double>(outputs_[i * lanes() + lane]);
      const auto last = static_cast<double>(last_[i * lanes() + lane]);
      values[output.channel] += output.derivative == 1 ? now - last : now;
    }
    return values;
  }

  const Program& program() const { return program_; }
  Kernel<T>& kernel() { return *kernel_; }

 private:
  Program program_;
  std::unique_ptr<Kernel<T>> kernel_;
  Aligned<T> value_;  // [input][lane]
  Aligned<T> velocity_;
  Aligned<T> outputs_;
  Aligned<T> last_;
  std::vector<double> before_;  // [lane][input]
};

// Compares two series: the largest difference relative to the largest value, and in dB.
struct Comparison {
  double peak = 0.0;
  double worst = 0.0;
  double signal = 0.0;
  double noise = 0.0;

  void add(double expected, double found) {
    const double difference = std::fabs(found - expected);
    peak = std::max(peak, std::fabs(expected));
    worst = std::isfinite(difference) ? std::max(worst, difference)
                                      : std::numeric_limits<double>::infinity();
    signal += expected * expected;
    noise += difference * difference;
  }
  double relative() const { return worst / peak; }
  double snr_db() const { return 10.0 * std::log10(signal / noise); }
};

}  // namespace ressort::support
