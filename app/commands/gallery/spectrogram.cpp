#include "app/commands/gallery/spectrogram.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "app/text.h"

namespace ressort::commands {
namespace {

// Levels in a figure, from white to black.
constexpr double lightest_dbfs = -96.0;
constexpr double darkest_dbfs = -16.0;
constexpr double periods = 34.0;
constexpr double shortest_window_s = 0.012;
constexpr double longest_window_s = 0.3;

using Wavelet = std::vector<std::complex<double>>;

Wavelet make_wavelet(double frequency_hz, double rate_hz) {
  const double length_s = std::clamp(periods / frequency_hz, shortest_window_s, longest_window_s);
  const auto count = static_cast<std::size_t>(length_s * rate_hz) | 1U;
  Wavelet made(count);
  for (std::size_t n = 0; n < count; ++n) {
    const double middle = static_cast<double>(n) - 0.5 * static_cast<double>(count - 1);
    const double phase = 2.0 * std::numbers::pi * frequency_hz / rate_hz * middle;
    // A Hann window sums to half its length, so a sinusoid of amplitude 1 gives 1.
    const double weight =
        2.0 / static_cast<double>(count) *
        (1.0 + std::cos(2.0 * std::numbers::pi * middle / static_cast<double>(count)));
    made[n] = std::polar(weight, phase);
  }
  return made;
}

double power_at(const std::vector<double>& samples, const Wavelet& wavelet, long long middle) {
  const auto count = static_cast<long long>(wavelet.size());
  const long long first = middle - count / 2;
  const long long begin = std::max(0LL, -first);
  const long long end = std::min(count, static_cast<long long>(samples.size()) - first);
  std::complex<double> sum;
  for (long long n = begin; n < end; ++n) {
    sum += samples[static_cast<std::size_t>(first + n)] * wavelet[static_cast<std::size_t>(n)];
  }
  return std::norm(sum);
}

}  // namespace

double Spectrogram::frequency_hz(std::size_t row) const {
  return lowest_hz *
         std::pow(highest_hz / lowest_hz, static_cast<double>(row) / static_cast<double>(rows - 1));
}

Spectrogram find_spectrogram(const Sound& sound, Stretch stretch, std::size_t rows,
                             std::size_t columns) {
  Spectrogram made{
      .from_s = stretch.from_s, .to_s = stretch.to_s, .rows = rows, .columns = columns};
  made.dbfs.assign(rows * columns, silence_db);
  std::vector<const std::vector<double>*> heard;  // without copies of the first channel
  for (const std::vector<double>& channel : sound.channels) {
    if (heard.empty() || channel != *heard[0]) {
      heard.push_back(&channel);
    }
  }
  for (std::size_t row = 0; row < rows; ++row) {
    if (made.frequency_hz(row) >= 0.5 * sound.rate_hz) {
      break;
    }
    const Wavelet wavelet = make_wavelet(made.frequency_hz(row), sound.rate_hz);
    for (std::size_t column = 0; column < columns; ++column) {
      const double share = (static_cast<double>(column) + 0.5) / static_cast<double>(columns);
      const double time_s = made.from_s + share * (made.to_s - made.from_s);
      double power = 0.0;
      for (const std::vector<double>* const channel : heard) {
        power += power_at(*channel, wavelet, std::llround(time_s * sound.rate_hz));
      }
      made.dbfs[row * columns + column] =
          to_dbfs(std::sqrt(power / static_cast<double>(heard.size())));
    }
  }
  return made;
}

Spectrogram downsampled(const Spectrogram& from, std::size_t rows, std::size_t columns) {
  Spectrogram made = from;
  made.rows = rows;
  made.columns = columns;
  made.dbfs.assign(rows * columns, silence_db);
  for (std::size_t row = 0; row < from.rows; ++row) {
    for (std::size_t column = 0; column < from.columns; ++column) {
      double& cell = made.dbfs[row * rows / from.rows * columns + column * columns / from.columns];
      cell = std::max(cell, from.at(row, column));
    }
  }
  return made;
}

plot::Panel spectrogram_panel(const Spectrogram& shown, std::initializer_list<double> ticks_hz) {
  // The rows are at equal ratios of frequency, so the axis counts octaves.
  const double lowest = std::log2(shown.lowest_hz);
  const double highest = std::log2(shown.highest_hz);
  const double step_s = (shown.to_s - shown.from_s) / static_cast<double>(shown.columns);
  const double step_octaves = (highest - lowest) / static_cast<double>(shown.rows - 1);
  plot::Series cells{.style = "image", .is_matrix = true};
  cells.columns = "(" + fixed(shown.from_s + 0.5 * step_s, 9) + "+" + fixed(step_s, 9) + "*$1):(" +
                  fixed(lowest, 9) + "+" + fixed(step_octaves, 9) + "*$2):3";
  for (std::size_t row = 0; row < shown.rows; ++row) {
    for (std::size_t column = 0; column < shown.columns; ++column) {
      cells.data += fixed(std::max(lightest_dbfs, shown.at(row, column)), 0) + " ";
    }
    cells.data += "\n";
  }
  plot::Panel panel{.x = {.from = shown.from_s, .to = shown.to_s},
                    .y = {.from = lowest, .to = highest},
                    .series = {cells},
                    .colours = plot::ColourMap::grey,
                    .lightest = lightest_dbfs,
                    .darkest = darkest_dbfs};
  for (const double hz : ticks_hz) {
    panel.y.ticks.push_back(
        {std::log2(hz), hz < 1000.0 ? fixed(hz, 0) : fixed(hz / 1000.0, 0) + "k"});
  }
  return panel;
}

}  // namespace ressort::commands
