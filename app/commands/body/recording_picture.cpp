#include "app/commands/body/recording_picture.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "app/commands/svg.h"
#include "app/text.h"
#include "core/linear_algebra/fourier.h"

namespace ressort::commands {
namespace {

constexpr double width = 900.0;
constexpr double left = 62.0;
constexpr double right = 18.0;
constexpr double floor_db = -110.0;
constexpr double lowest_hz = 20.0;
const char* const mode_ink = "#c8402f";
const char* const sound_ink = "#555";
const char* const residual_ink = "#4a74a8";

struct Panel {
  double top = 0.0;
  double height = 0.0;
  double highest_hz = 20000.0;

  double x_of(double frequency_hz) const {
    return left + (width - left - right) * std::log(frequency_hz / lowest_hz) /
                      std::log(highest_hz / lowest_hz);
  }
  double bottom() const { return top + height; }
};

// The magnitude of each bin of all channels, the first so many samples, a power of two.
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
  return 20.0 * std::log10(std::max(magnitude, 1e-15));
}

// The highest bin of each pixel, as an area down to the panel's floor.
std::string curve(const std::vector<double>& bins, double rate_hz, double reference,
                  const Panel& panel, const char* colour) {
  const double bin_hz = 0.5 * rate_hz / static_cast<double>(bins.size());
  std::string path = "M" + px(left) + " " + px(panel.bottom());
  const auto columns = static_cast<int>(2.0 * (width - left - right));
  const double ratio = std::pow(panel.highest_hz / lowest_hz, 1.0 / columns);
  for (int column = 0; column < columns; ++column) {
    const double low_hz = lowest_hz * std::pow(ratio, column);
    const auto from = static_cast<std::size_t>(low_hz / bin_hz);
    const auto to = std::min(bins.size(),
                             std::max(from + 1, static_cast<std::size_t>(low_hz * ratio / bin_hz)));
    if (from >= to) {
      break;
    }
    const double most = *std::max_element(bins.begin() + static_cast<std::ptrdiff_t>(from),
                                          bins.begin() + static_cast<std::ptrdiff_t>(to));
    const double db = std::clamp(level_db(most / reference), floor_db, 0.0);
    path += "L" + px(left + 0.5 * column) + " " + px(panel.top + panel.height * db / floor_db);
  }
  return "<path d=\"" + path + "L" + px(width - right) + " " + px(panel.bottom()) + "Z\" fill=\"" +
         colour + "\"/>\n";
}

std::string frequency_grid(const Panel& panel) {
  std::string svg;
  for (const double hz : {50.0, 100.0, 200.0, 500.0, 1e3, 2e3, 5e3, 1e4}) {
    if (hz < panel.highest_hz) {
      svg += line(panel.x_of(hz), panel.top, panel.x_of(hz), panel.bottom(), grid_ink);
    }
  }
  return svg;
}

std::string frequency_axis(const Panel& panel) {
  std::string svg;
  for (const double hz : {50.0, 100.0, 200.0, 500.0, 1e3, 2e3, 5e3, 1e4}) {
    if (hz < panel.highest_hz) {
      svg += label(panel.x_of(hz), panel.bottom() + 15.0, hertz(hz), "middle");
    }
  }
  return svg + label(width - right, panel.bottom() + 15.0, "Hz");
}

std::string level_axis(const Panel& panel) {
  std::string svg;
  for (double db = 0.0; db >= floor_db; db -= 20.0) {
    const double y = panel.top + panel.height * db / floor_db;
    svg += line(left, y, width - right, y, grid_ink, "0.4") +
           label(left - 6.0, y + 3.5, fixed(db, 0) + (db == 0.0 ? " dB" : ""));
  }
  return svg;
}

// The spectrum's peak that each mode alone would have.
std::string marks(const Identification& found, std::size_t frames, double reference,
                  const Panel& panel) {
  std::string svg;
  for (const IdentifiedMode& mode : found.modes) {
    const double alpha = std::log(1000.0) / (mode.t60_s.value * found.rate_hz);
    double square = 0.0;
    for (const Measured& amplitude : mode.amplitude) {
      square += amplitude.value * amplitude.value;
    }
    const double since =
        (found.onset_s + found.skipped_s - found.time_zero_s) * found.rate_hz;  // samples
    const double peak = 0.5 * std::sqrt(square) * std::exp(-alpha * since) *
                        -std::expm1(-alpha * static_cast<double>(frames)) / -std::expm1(-alpha);
    const double db = std::clamp(level_db(peak / reference), floor_db, 0.0);
    svg += "<circle cx=\"" + px(panel.x_of(mode.frequency_hz.value)) + "\" cy=\"" +
           px(panel.top + panel.height * db / floor_db) + "\" r=\"3.2\" fill=\"none\" stroke=\"" +
           mode_ink + "\" stroke-width=\"1.3\"/>\n";
  }
  return svg;
}

// A bar up to each T60, and a thin one over what it may be.
std::string decays(const Identification& found, const Panel& panel) {
  double least = HUGE_VAL;
  double most = 0.0;
  for (const IdentifiedMode& mode : found.modes) {
    least = std::min(least, mode.t60_s.value);
    most = std::max(most, mode.t60_s.value);
  }
  const double low = std::pow(10.0, std::floor(std::log10(0.7 * least)));
  const double high = std::pow(10.0, std::ceil(std::log10(1.1 * most)));
  const auto y_of = [&](double t60_s) {
    return panel.bottom() -
           panel.height * std::clamp(std::log(t60_s / low) / std::log(high / low), 0.0, 1.0);
  };
  std::string svg = frequency_grid(panel);
  for (double t60_s = low; t60_s < 1.01 * high; t60_s *= 10.0) {
    const int digits = std::max(0, static_cast<int>(std::lround(-std::log10(t60_s))));
    svg += line(left, y_of(t60_s), width - right, y_of(t60_s), grid_ink, "0.4") +
           label(left - 6.0, y_of(t60_s) + 3.5,
                 fixed(t60_s, digits) + (t60_s < high / 2.0 ? "" : " s"));
  }
  for (const IdentifiedMode& mode : found.modes) {
    const double x = panel.x_of(mode.frequency_hz.value);
    svg += line(x, panel.bottom(), x, y_of(mode.t60_s.value), mode_ink, "2");
    svg += line(x, y_of(std::max(low, mode.t60_s.value - mode.t60_s.deviation)), x,
                y_of(mode.t60_s.value + mode.t60_s.deviation), ink, "0.8");
  }
  return svg + box(left, panel.top, width - left - right, panel.height);
}

}  // namespace

std::string recording_picture(const Identification& found, const std::string& title) {
  const double highest_hz = std::min(20000.0, 0.5 * found.rate_hz);
  const Panel sound{.top = 44.0, .height = 240.0, .highest_hz = highest_hz};
  const Panel decay{.top = 322.0, .height = 110.0, .highest_hz = highest_hz};
  const Panel rest{.top = 470.0, .height = 160.0, .highest_hz = highest_hz};
  const std::size_t frames = found.sound[0].size();
  const std::size_t size = std::bit_ceil(frames);
  const std::vector<double> bins = magnitudes(found.sound, size);
  const double reference = std::max(1e-30, *std::max_element(bins.begin(), bins.end()));
  const auto panel_of = [&](const std::vector<double>& shown, const Panel& panel,
                            const char* colour) {
    return curve(shown, found.rate_hz, reference, panel, colour) + frequency_grid(panel) +
           level_axis(panel);
  };
  const auto frame_of = [](const Panel& panel) {
    return box(left, panel.top, width - left - right, panel.height);
  };
  return svg_head(width, 660.0, 11.0) + "<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n" +
         "<text x=\"" + px(left) + "\" y=\"18\" font-size=\"14\">" + escaped(title) + ": " +
         counted(found.modes.size(), "mode", "modes") + "</text>\n" +
         label(left, 37.0, "spectrum of the recording, and of each mode its peak", "start") +
         panel_of(bins, sound, sound_ink) + marks(found, frames, reference, sound) +
         frame_of(sound) + frequency_axis(sound) +
         label(left, decay.top - 7.0, "T60 of each mode, and how uncertain it is", "start") +
         decays(found, decay) +
         label(left, rest.top - 7.0,
               "what the modes leave of it: " + fixed(found.residual_db, 1) + " dB", "start") +
         panel_of(magnitudes(found.residual, size), rest, residual_ink) + frame_of(rest) +
         frequency_axis(rest) + "</svg>\n";
}

}  // namespace ressort::commands
