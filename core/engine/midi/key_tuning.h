// core/engine/midi: the frequency of every key: what the preset's scale says, and what MIDI Tuning
// Standard messages have said since.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "core/rooms.h"

namespace ressort::engine {

inline constexpr std::size_t key_count = 128;

// [key] of 0: that key makes no sound.
using KeyFrequencies = std::array<double, key_count>;

// Twelve equal semitones in an octave.
inline KeyFrequencies equal_temperament(double a4_hz, double transpose_semitones) {
  KeyFrequencies hz{};
  for (std::size_t key = 0; key < key_count; ++key) {
    hz[key] = a4_hz * std::exp2((static_cast<double>(key) + transpose_semitones - 69.0) / 12.0);
  }
  return hz;
}

// All functions: [audio] wait-free. A key is 0..127.
class KeyTuning {
 public:
  // As the preset has them, transposed already by so many semitones.
  KeyTuning(const KeyFrequencies& preset_hz, double transpose_semitones)
      : preset_hz_(preset_hz), ratio_(std::exp2(transpose_semitones / 12.0)) {
    reset();
  }
  double frequency_hz(std::size_t key) const {
    return said_hz_[key] < 0.0 ? preset_hz_[key] : ratio_ * said_hz_[key];
  }
  // Before it is transposed.
  void retune(std::size_t key, double frequency_hz) { said_hz_[key] = frequency_hz; }
  void reset() { said_hz_.fill(as_preset); }
  void adopt(const KeyTuning& from) { said_hz_ = from.said_hz_; }

 private:
  static constexpr double as_preset = -1.0;
  KeyFrequencies preset_hz_;
  double ratio_;
  KeyFrequencies said_hz_{};
};

}  // namespace ressort::engine
