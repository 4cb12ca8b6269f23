// core/engine: the vectorised loops that feed a kernel's inputs and mix its outputs.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/kernels/isa.h"

namespace ressort::engine {

// Frames [at, at + frames) of a block, between two events. All voices are computed in one go.
struct Segment {
  std::span<const double* const> inputs;  // null: absent
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

// The outputs of one kernel to be mixed.
template <class T>
struct Heard {
  const T* outputs = nullptr;  // [frame][output][lane]
  std::size_t frames = 0;
  std::size_t count = 0;  // outputs
  std::size_t width = 1;  // lanes of a row; one, or a multiple of a 16-byte pack
  std::size_t lanes = 1;  // leading lanes to mix, a multiple of a 16-byte pack, too
};

// Audio channels that drive adjacent inputs of a row, in all lanes. They are added to the inputs'
// rest positions, or to the present content of the rows.
template <class T>
struct AudioInput {
  static constexpr std::size_t most = 4;  // channels in one pass

  std::size_t count;  // a power of 2
  std::array<const double*, most> samples;
  std::array<double, most> scale;   // factors on the samples
  std::array<double, most> before;  // last scaled samples
  std::size_t frames;
  std::array<T, most> rest;  // positions of the inputs without audio
  bool rests;                // add to `rest`; if not, to the rows' content
  T* value;                  // [frame * step + input * width + lane]
  T* velocity;               // same layout; null if the inputs are forces
  std::size_t step;
  std::size_t width;  // lanes; 1 if there are several inputs
};

inline constexpr std::size_t rows_together = 8;

using IsSilent = bool (*)(const double* samples, std::size_t frames);
// Multiplies a channel by white noise: every `step`-th number of splitmix64() after `state`.
using MakeNoise = void (*)(double* samples, std::size_t frames, std::uint64_t state,
                           std::uint64_t step);

template <class T>
struct Mixer {
  IsSilent is_silent;
  MakeNoise make_noise;
  // Writes the same row to every frame: value[frame * step + i].
  void (*fill_rows)(const T* row, std::size_t step, std::size_t frames, T* value);
  // Multiplies every frame by the same row, which is given `rows_together` times.
  void (*scale_rows)(const T* rows, std::size_t step, std::size_t frames, T* value);
  void (*add_audio)(const AudioInput<T>& input);
  // channels[output][frame] += sum of gain[lane] * y. Lanes with gain 0 may hold any values.
  void (*add_voices)(const Heard<T>& heard, const T* gain, double* const* channels);
  // Finds the peak |y| of each lane; infinity if it is not below `bound` or not a number. If all
  // lanes with a gain are within the bound, it also mixes like add_voices() and returns true.
  bool (*mix)(const Heard<T>& heard, double bound, const T* gain, double* const* channels, T* peak);
};

template <Isa isa, class T>
Mixer<T> make_mixer();

}  // namespace ressort::engine
