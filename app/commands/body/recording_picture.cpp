#include "app/commands/body/recording.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <complex>
#include <vector>

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

plot::Panel spectrum_panel(const std::string& title, double height, const Scale& scale,
                           std::vector<plot::Series> series) {
  return {.title = title,
          .x = plot::frequency_axis(lowest_hz, scale.highest_hz),
          .y = {.title = "dB", .from = floor_db, .to = 3.0},
          .series = std::move(series),
          .height = height};
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
  plot::Panel panel = spectrum_panel("T60 of each mode", 190.0, scale, {bars, deviations});
  panel.y = {.title = "s",
             .from = std::pow(10.0, std::floor(std::log10(0.7 * least))),
             .to = std::pow(10.0, std::ceil(std::log10(1.1 * most))),
             .is_logarithmic = true};
  return panel;
}

}  // namespace

plot::Figure recording_figure(const Identification& found, const std::string& title) {
  const std::size_t size = std::bit_ceil(found.sound[0].size());
  const std::vector<double> bins = magnitudes(found.sound, size);
  const Scale scale{.rate_hz = found.rate_hz,
                    .highest_hz = std::min(20000.0, 0.5 * found.rate_hz),
                    .reference = std::max(1e-30, *std::max_element(bins.begin(), bins.end()))};
  return {
      .title = title + ": " + counted(found.modes.size(), "mode", "modes"),
      .panel_width = 900.0,
      .panels = {spectrum_panel("Spectrum of the recording, and the peak of each mode", 310.0,
                                scale, {filled(bins, scale, "#777777"), peaks(found, scale)}),
                 decay_panel(found, scale),
                 spectrum_panel("Residual: " + fixed(found.residual_db, 1) + " dB", 230.0, scale,
                                {filled(magnitudes(found.residual, size), scale, "#4a74a8")})}};
}

}  // namespace ressort::commands
