// core/engine: positions for a display, live or in slow motion.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/engine/bank.h"
#include "core/engine/readings.h"
#include "core/kernels/kernel.h"

namespace ressort::engine {

class Viewer {
 public:
  explicit Viewer(double rate_hz) : rate_hz_(rate_hz) {}

  // `parts`: [part] or empty. Called before the engine plays. [any thread but audio]
  void watch(std::vector<WatchedPart> parts) { watched_ = std::move(parts); }

  // Writes the watched positions of the voice in `lane`, part by part, until `numbers` is full.
  // Returns how many it wrote. [audio] wait-free, O(numbers + the waveguides' samples)
  template <class T>
  std::size_t read(const Bank<T>& bank, std::size_t lane, std::span<double> numbers) const {
    std::size_t at = 0;
    bool is_full = false;
    const auto add = [&](std::size_t more) {
      at += more;
      is_full = is_full || more == 0;
    };
    for (std::size_t p = 0; p < watched_.size() && !is_full; ++p) {
      const WatchedPart& wanted = watched_[p];
      const Kernel<T>& kernel = bank.parts[p].of(lane);
      const std::size_t within = lane % bank.parts[p].width;
      if (!wanted.nodes.empty()) {
        add(kernel.read_positions(within, wanted.nodes, numbers.subspan(at)));
      }
      for (std::size_t i = 0; i < wanted.waveguides && !is_full; ++i) {
        const std::size_t room = std::min(waveguide_points, numbers.size() - at);
        add(room < waveguide_points ? 0
                                    : kernel.read_waveguide(within, i, numbers.subspan(at, room)));
      }
    }
    return at;
  }

  // Requests one slow-motion view of a voice with this frequency; an empty `numbers` cancels it.
  // [audio]
  void request_slow_view(std::span<double> numbers, double frequency_hz) {
    slow_count_ = 0;
    slow_numbers_ = numbers;
    slow_hz_ = frequency_hz;
  }
  // Takes the requested view if the moment has come. A stroboscope at frequency - 1 / period shows
  // a motion that takes strobe_period_s. Called once in max_block_frames. [audio]
  template <class T>
  void advance(const Bank<T>& bank, std::size_t lane) {
    ++updates_;
    if (slow_numbers_.empty()) {
      return;
    }
    constexpr double tolerance = 0.02;  // periods
    const double seconds = static_cast<double>(updates_ * max_block_frames) / rate_hz_;
    const double periods = seconds * (slow_hz_ - 1.0 / strobe_period_s);
    if (std::fabs(periods - std::rint(periods)) < tolerance) {
      slow_count_ = read(bank, lane, slow_numbers_);
      slow_numbers_ = {};
    }
  }
  // Returns how many numbers the slow view has written, once; 0 before that. [audio]
  std::size_t take_slow_view() { return std::exchange(slow_count_, 0); }

 private:
  double rate_hz_;
  std::vector<WatchedPart> watched_;
  std::span<double> slow_numbers_;  // destination of the requested view; empty: none
  double slow_hz_ = 0.0;
  std::size_t slow_count_ = 0;
  std::uint64_t updates_ = 0;
};

}  // namespace ressort::engine
