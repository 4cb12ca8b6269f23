// app/commands: spectrograms with a logarithmic frequency axis. Pure.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <vector>

#include "app/commands/gallery/sound.h"
#include "app/plot/plot.h"

namespace ressort::commands {

struct Spectrogram {
  double lowest_hz = 27.5;
  double highest_hz = 14080.0;  // nine octaves higher
  double from_s = 0.0;
  double to_s = 0.0;
  std::size_t rows = 0;  // rows at equal ratios, from the lowest to the highest frequency
  std::size_t columns = 0;
  std::vector<double> dbfs;  // [row][column], level of a sinusoid, mean power of the channels

  double at(std::size_t row, std::size_t column) const { return dbfs[row * columns + column]; }
  double frequency_hz(std::size_t row) const;
};

// Computes a constant-Q transform (Brown 1991). The Hann window of each frequency has 34 periods,
// two rows' bandwidth, clamped to 12 ms to 0.3 s. Frequencies above half the rate are silent.
// O(columns * rate * sum of the windows)
Spectrogram find_spectrogram(const Sound& sound, Stretch stretch, std::size_t rows,
                             std::size_t columns);

// Downsamples to fewer cells, each with its highest level.
Spectrogram downsampled(const Spectrogram& from, std::size_t rows, std::size_t columns);

// Draws the cells as an image, from white at -96 to black at -16 dBFS.
plot::Panel spectrogram_panel(const Spectrogram& shown, std::initializer_list<double> ticks_hz);

}  // namespace ressort::commands
