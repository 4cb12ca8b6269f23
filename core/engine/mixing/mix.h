// core/engine: what goes to the voices of one kernel from outside, and what they add to the
// channels.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "core/kernels/isa.h"

namespace ressort::engine {

// What lies between two cuts: nothing happens within it, and all voices can be computed in one go.
// Frames [at, at + frames) of a block's channels.
struct Segment {
  std::span<const double* const> inputs;  // null where there is none
  std::span<double* const> outputs;
  std::size_t at = 0;
  std::size_t frames = 0;
  std::size_t end() const { return at + frames; }
};

// The voices of one kernel of a part: lanes [first, end).
struct VoiceGroup {
  std::size_t part = 0;
  std::size_t first = 0;
  std::size_t end = 0;
};

// [frame][output][lane]
template <class T>
struct Heard {
  const T* outputs = nullptr;
  std::size_t frames = 0;
  std::size_t count = 0;  // outputs
  std::size_t width = 1;  // lanes; one, or as many as fit into whole packs of 16 bytes
  std::size_t lanes = 1;  // the first of them, in whole packs of 16 bytes, too
};

// Sounds that move as many inputs, side by side in each row, of all lanes: on top of where these
// rest, or of what is there.
template <class T>
struct AudioInput {
  static constexpr std::size_t most = 4;  // sounds

  std::size_t count;  // a power of 2
  std::array<const double*, most> samples;
  std::array<double, most> scale;   // of the samples
  std::array<double, most> before;  // the last scaled samples
  std::size_t frames;
  std::array<T, most> rest;  // where the inputs are without them,
  bool rests;                // and stay; if not, the rows say where
  T* value;                  // [frame * step + input * width + lane]
  T* velocity;               // of positions; null: these are forces
  std::size_t step;
  std::size_t width;  // lanes; 1 where there are several inputs
};

using IsSilent = bool (*)(const double* samples, std::size_t frames);

template <class T>
struct Mixer {
  IsSilent is_silent;
  // The same row in every frame, [frame * step + i].
  void (*fill_rows)(const T* row, std::size_t step, std::size_t frames, T* value);
  void (*add_audio)(const AudioInput<T>& input);
  // channels[output][frame] += the sum of gain[lane] * y; what has the gain 0 may be anything.
  void (*add_voices)(const Heard<T>& heard, const T* gain, double* const* channels);
  // The same if every y that has a gain is below `bound`; whether it was. The largest |y| of each
  // lane; infinity where one is not below, or is no number.
  bool (*mix)(const Heard<T>& heard, double bound, const T* gain, double* const* channels, T* peak);
};

template <Isa isa, class T>
Mixer<T> make_mixer();

}  // namespace ressort::engine
