#include "app/commands/body/recording.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <complex>
#include <utility>
#include <vector>

#include "app/commands/gallery/spectrogram.h"
#include "app/rooms.h"
#include "app/text.h"
#include "core/linear_algebra/fourier.h"

namespace ressort::commands {
namespace {

constexpr double floor_db = -110.0;
constexpr double lowest_hz = 20.0;
constexpr double pixels = 1600.0;  // points of a spectrum

// Root of the power of all channels in each bin, over the first `size` samples, a power of two.
std::vector<double> magnitudes(const std::vector<std::vector<double>>& channels, std::size_t size) {
  Fourier fourier(size);
  std::vector<double> power(size / 2);
  std::vector<double> padded(size);
  std::vector<std::complex<double>> bins(fourier.bins());
  for (const std::vector<double>& channel : channels) {
    std::copy_n(channel.begin(), std::min(size, channel.size()), padded.begin());
    fourier.forward(padded, bins);
    for (std::size_t k = 0; k < power.size(); ++k) {
      power[k] += std::norm(bins[k]);
    }
  }
  for (double& bin : power) {
    bin = std::sqrt(bin);
  }
  return power;
}

double level_db(double magnitude) {
  return std::clamp(20.0 * std::log10(std::max(magnitude, 1e-15)), floor_db, 0.0);
}

// Spectra of a recording share their reference and their axes.
struct Scale {
  double rate_hz = 0.0;
  double highest_hz = 0.0;
  double reference = 1.0;  // the strongest bin
};

// The strongest bin of each pixel, filled down to the floor.
plot::Series filled(const std::vector<double>& bins, const Scale& scale, const char* colour) {
  const double bin_hz = 0.5 * scale.rate_hz / static_cast<double>(bins.size());
  const double ratio = std::pow(scale.highest_hz / lowest_hz, 1.0 / pixels);
  plot::Series series{.style =
                          "filledcurves y1=" + fixed(floor_db, 0) + " lc rgb '" + colour + "'"};
  for (double low_hz = lowest_hz; low_hz < scale.highest_hz; low_hz *= ratio) {
    const auto from = static_cast<std::size_t>(low_hz / bin_hz);
    const auto to = std::min(bins.size(),
                             std::max(from + 1, static_cast<std::size_t>(low_hz * ratio / bin_hz)));
    if (from >= to) {
      break;
    }
    const double most = *std::max_element(bins.begin() + static_cast<std::ptrdiff_t>(from),
                                          bins.begin() + static_cast<std::ptrdiff_t>(to));
    series.data += plot::row({low_hz, level_db(most / scale.reference)});
  }
  return series;
}

// The height of the peak that each mode alone has in the spectrum: the geometric sum of its decay.
plot::Series peaks(const Identification& found, const Scale& scale) {
  const auto frames = static_cast<double>(found.sound[0].size());
  plot::Series series{
      .style = "points pt 6 ps 0.7 lw 1.3 lc rgb '" + std::string(plot::accent) + "'",
      .data = {},
      .title = "modes"};
  const double since_samples =
      (found.onset_s + found.skipped_s - found.time_zero_s) * found.rate_hz;
  for (const IdentifiedMode& mode : found.modes) {
    const double alpha = std::log(1000.0) / (mode.t60_s.value * found.rate_hz);
    double square = 0.0;
    for (const Measured& amplitude : mode.amplitude) {
      square += amplitude.value * amplitude.value;
    }
    const double peak = 0.5 * std::sqrt(square) * std::exp(-alpha * since_samples) *
                        -std::expm1(-alpha * frames) / -std::expm1(-alpha);
    series.data += plot::row({mode.frequency_hz.value, level_db(peak / scale.reference)});
  }
  return series;
}

plot::Panel spectrum_panel(const std::string& title, const Scale& scale,
                           std::vector<plot::Series> series) {
  return {.title = title,
          .x = plot::frequency_axis(lowest_hz, scale.highest_hz),
          .y = {.title = "dB", .from = floor_db, .to = 3.0},
          .series = std::move(series),
          .height = 270.0};
}

// Three spectrograms with one gain, which sets the recording's peak to -12 dBFS.
std::vector<plot::Panel> spectrogram_panels(const RecordingParts& parts) {
  constexpr std::size_t rows = 109;  // 12 in an octave
  constexpr std::size_t columns = 120;
  constexpr double longest_s = 2.0;
  const double length_s =
      std::min(longest_s, static_cast<double>(parts.recording.frames()) / parts.recording.rate_hz);
  const double gain_db = -12.0 - to_dbfs(peak_of(parts.recording));
  std::vector<plot::Panel> panels;
  const std::pair<const char*, const Sound*> shown[] = {{"Recording", &parts.recording},
                                                        {"Modes and noise", &parts.sum},
                                                        {"Without the modes", &parts.residual}};
  for (const auto& [title, sound] : shown) {
    Spectrogram cells = find_spectrogram(*sound, {0.0, length_s}, rows, columns);
    for (double& cell : cells.dbfs) {
      cell += gain_db;
    }
    panels.push_back(spectrogram_panel(cells, {50.0, 100.0, 200.0, 500.0, 1e3, 2e3, 5e3, 1e4}));
    panels.back().title = title;
    panels.back().x.title = "s";
    panels.back().y.title = "Hz";
    panels.back().height = 300.0;
  }
  return panels;
}

plot::Panel decay_panel(const Identification& found, const Scale& scale) {
  plot::Series bars{.style = "impulses lw 2 lc rgb '" + std::string(plot::accent) + "'"};
  plot::Series deviations{.style = "yerrorbars pt 0 lw 1 lc rgb '" + std::string(plot::ink) + "'",
                          .data = {},
                          .title = "standard deviation",
                          .columns = "1:2:3:4"};
  double least = HUGE_VAL;
  double most = 0.0;
  for (const IdentifiedMode& mode : found.modes) {
    const Measured& t60_s = mode.t60_s;
    least = std::min(least, t60_s.value);
    most = std::max(most, t60_s.value);
    bars.data += plot::row({mode.frequency_hz.value, t60_s.value});
    deviations.data += plot::row({mode.frequency_hz.value, t60_s.value,
                                  std::max(0.1 * t60_s.value, t60_s.value - t60_s.deviation),
                                  t60_s.value + t60_s.deviation});
  }
  plot::Panel panel = spectrum_panel("T60 of each mode", scale, {bars, deviations});
  panel.y = {.title = "s",
             .from = std::pow(10.0, std::floor(std::log10(0.7 * least))),
             .to = std::pow(10.0, std::ceil(std::log10(1.1 * most))),
             .is_logarithmic = true};
  return panel;
}

}  // namespace

plot::Figure recording_figure(const Identification& found, const RecordingParts& parts,
                              const std::string& title) {
  const std::size_t size = std::bit_ceil(found.sound[0].size());
  const std::vector<double> bins = magnitudes(found.sound, size);
  const Scale scale{.rate_hz = found.rate_hz,
                    .highest_hz = std::min(20000.0, 0.5 * found.rate_hz),
                    .reference = std::max(1e-30, *std::ranges::max_element(bins))};
  plot::Figure figure{.title = title + ": " + counted(found.modes.size(), "mode", "modes"),
                      .columns = 3,
                      .panels = spectrogram_panels(parts)};
  figure.panels.push_back(spectrum_panel("Spectrum and the peak of each mode", scale,
                                         {filled(bins, scale, "#777777"), peaks(found, scale)}));
  figure.panels.push_back(decay_panel(found, scale));
  figure.panels.push_back(
      spectrum_panel("Residual: " + fixed(found.residual_db, 1) + " dB", scale,
                     {filled(magnitudes(found.residual, size), scale, "#4a74a8")}));
  return figure;
}

}  // namespace ressort::commands
