// tests: what several of them need to drive a network by hand and to compare what comes out.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "core/compile/compile.h"
#include "core/model/mdl.h"
#include "tests/catch.h"
#include "tests/scenes.h"

namespace ressort::rig {

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

// A number as a person reads it: Catch would print 1e-13 as 0.
inline std::string show(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.10g", value);
  return text;
}

// The same numbers on every machine (splitmix64).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  double uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(next() >> 11) * 0x1p-53;
  }
  std::size_t below(std::size_t count) { return static_cast<std::size_t>(next() % count); }

 private:
  std::uint64_t state_;
};

// A hand that wanders smoothly within -1..1: a few slow sines of random pitch and phase. It
// starts at 0.
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

// A Program stepped with nothing around it: the kernel alone, one State.
template <class T>
class Bare {
 public:
  static constexpr std::size_t lanes = lane_count<T>;

  explicit Bare(Program program)
      : program_(std::move(program)),
        state_(program_),
        drive_(program_.inputs.size()),
        out_(program_.outputs.size()),
        before_(program_.inputs.size()) {
    for (std::size_t c = 0; c < program_.coefficients.size(); ++c) {
      const double value =
          coefficient_value(program_, program_.coefficients[c], program_.parameters, 1.0);
      state_.coefficient[c] = Lanes<T>{} + static_cast<T>(value);
    }
    for (std::size_t i = 0; i < before_.size(); ++i) {
      before_[i].fill(program_.position[program_.inputs[i].node]);
    }
  }

  // inputs[i] is the same in every lane.
  std::vector<double> step(const std::vector<double>& inputs) {
    for (std::size_t i = 0; i < drive_.size(); ++i) {
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        feed(lane, i, inputs[i]);
      }
    }
    return run(0);
  }

  // One input's position or force in one lane, for the next run().
  void feed(std::size_t lane, std::size_t input, double value) {
    drive_[input].value[lane] = static_cast<T>(value);
    drive_[input].velocity[lane] = static_cast<T>(value - before_[input][lane]);
    before_[input][lane] = value;
  }

  // Steps every lane; gives one lane's outputs.
  std::vector<double> run(std::size_t lane) {
    step_direct(program_, state_, drive_.data(), nullptr, out_.data(), 1);
    return outputs(lane);
  }
  std::vector<double> outputs(std::size_t lane) const {
    std::vector<double> values;
    for (const auto& out : out_) {
      values.push_back(static_cast<double>(out[lane]));
    }
    return values;
  }

  const Program& program() const { return program_; }
  State<T>& state() { return state_; }

 private:
  Program program_;
  State<T> state_;
  std::vector<Drive<T>> drive_;
  std::vector<Lanes<T>> out_;
  std::vector<std::array<double, lanes>> before_;
};

// Two series compared: the largest difference in shares of the largest value, and in dB.
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

}  // namespace ressort::rig
