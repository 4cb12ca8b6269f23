// app/commands: which frequencies sound when, on a logarithmic axis. Pure.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "app/commands/gallery/sound.h"

namespace ressort::commands {

struct Spectrogram {
  double lowest_hz = 27.5;
  double highest_hz = 14080.0;  // nine octaves higher
  double from_s = 0.0;
  double to_s = 0.0;
  std::size_t rows = 0;  // from the lowest, at equal ratios, the last one at the highest
  std::size_t columns = 0;
  std::vector<double> dbfs;  // [row][column], of a steady sinusoid; the channels' powers added up

  double at(std::size_t row, std::size_t column) const { return dbfs[row * columns + column]; }
  double frequency_hz(std::size_t row) const;
};

// By the constant-Q transform (Brown 1991): each frequency under a Hann window of 34 of its
// periods, two rows' width, but no shorter than 12 ms and no longer than 0.3 s. What is above
// half the rate stays silent. O(columns * rate * sum of the windows)
Spectrogram find_spectrogram(const Sound& sound, Stretch stretch, std::size_t rows,
                             std::size_t columns);

// The same in fewer cells, each as loud as the loudest that it holds.
Spectrogram made_smaller(const Spectrogram& from, std::size_t rows, std::size_t columns);

// As a grey picture for a page, "data:image/png;base64,...": `lightest_dbfs` and less is white,
// `darkest_dbfs` and more black, in 48 steps. Low frequencies are below.
std::string to_data_url(const Spectrogram& spectrogram, double lightest_dbfs, double darkest_dbfs);

}  // namespace ressort::commands
