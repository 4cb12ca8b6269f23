#include <algorithm>
#include <cmath>

#include "app/commands/timbre/describe_text.h"
#include "app/text.h"

namespace ressort::commands {
namespace {

constexpr double lowest_hz = 20.0;
constexpr double floor_db = -100.0;
constexpr std::size_t most_points = 2000;  // limit for a curve over time
constexpr double pixels = 1700.0;          // points of a curve over frequency

// A frequency that is drawn over time. Each has its own dash pattern, so that grey print is
// legible.
struct TimeCurve {
  const char* figure;
  const char* title;
  int dashes;
};
constexpr TimeCurve time_curves[] = {{"centroid_hz", "centroid", 1},
                                     {"spread_hz", "spread", 3},
                                     {"rolloff95_hz", "rolloff 95 %", 2}};

double highest_hz(const Description& description) {
  return 0.5 * description.rate_hz;
}

// Levels relative to the strongest bin or line.
std::vector<double> levels_db(const Description& description, SpectrumKind kind) {
  const std::vector<double>& spectrum = description.spectrum;
  const double most = *std::ranges::max_element(spectrum);
  const double factor = kind == SpectrumKind::magnitude ? 20.0 : 10.0;
  std::vector<double> levels;
  for (const double value : spectrum) {
    levels.push_back(value > 0.0 ? std::clamp(factor * std::log10(value / most), floor_db, 0.0)
                                 : floor_db);
  }
  return levels;
}

// Returns the rows of a spectrum. If a pixel covers many bins, the strongest one is kept.
std::string spectrum_rows(const Description& description, SpectrumKind kind) {
  const std::vector<double> levels = levels_db(description, kind);
  const double pixel = std::log(highest_hz(description) / lowest_hz) / pixels;
  std::string rows;
  for (std::size_t k = 0; k < levels.size();) {
    const double first_hz = description.frequencies_hz[k];
    double most = levels[k];
    const bool is_line = description.channels == 0;
    for (++k; k < levels.size() && !is_line &&
              description.frequencies_hz[k] < first_hz * std::exp(pixel);
         ++k) {
      most = std::max(most, levels[k]);
    }
    if (first_hz >= lowest_hz) {
      rows += is_line ? plot::row({first_hz, floor_db}) + plot::row({first_hz, most}) + "\n"
                      : plot::row({first_hz, most});
    }
  }
  return rows;
}

plot::Panel spectrum_panel(const Description& description, const DescriptionOptions& options) {
  const DescribedFrame& frame = description.frames[description.loudest];
  plot::Panel panel{.title = "Spectrum of the " + std::string(options.at ? "" : "loudest ") +
                             "frame, at " +
                             fixed(static_cast<double>(frame.at) / description.rate_hz, 3) + " s",
                    .x = plot::frequency_axis(lowest_hz, highest_hz(description)),
                    .y = {.title = "dB", .from = floor_db, .to = 5.0},
                    .height = 320.0};
  const auto value = [&](const char* figure) { return frame.values[figure_number(figure)]; };
  const auto centroid = value("centroid_hz");
  const auto spread = value("spread_hz");
  const auto rolloff = value("rolloff95_hz");
  const auto clamped = [&](double hz) {
    return std::clamp(hz, lowest_hz, highest_hz(description));
  };
  const auto upright = [](double hz) { return plot::row({hz, floor_db}) + plot::row({hz, 0.0}); };
  if (centroid && spread) {
    panel.series.push_back({.style = "filledcurves y1=" + fixed(floor_db, 0) + " lc rgb '#dddddd'",
                            .data = plot::row({clamped(*centroid - *spread), 0.0}) +
                                    plot::row({clamped(*centroid + *spread), 0.0}),
                            .title = "spread " + with_commas(*spread, 0) + " Hz"});
  }
  panel.series.push_back(
      {.style = "lines lw 1.2 lc rgb '#777777'", .data = spectrum_rows(description, options.kind)});
  if (centroid) {
    panel.series.push_back({.style = "lines lw 2 lc rgb '" + std::string(plot::ink) + "'",
                            .data = upright(clamped(*centroid)),
                            .title = "centroid " + with_commas(*centroid, 0) + " Hz"});
  }
  if (rolloff) {
    panel.series.push_back({.style = "lines lw 1.5 dt 2 lc rgb '" + std::string(plot::ink) + "'",
                            .data = upright(clamped(*rolloff)),
                            .title = "rolloff 95 % " + with_commas(*rolloff, 0) + " Hz"});
  }
  return panel;
}

plot::Panel time_panel(const Description& description) {
  plot::Panel panel{.title = "Centroid, spread and rolloff over time",
                    .x = {.title = "s"},
                    .y = plot::frequency_axis(lowest_hz, highest_hz(description)),
                    .height = 300.0};
  const std::size_t every = 1 + description.frames.size() / most_points;
  const bool is_one = description.frames.size() == 1;
  const std::string style = is_one ? "points pt 7 ps 0.5 dt " : "lines lw 1.5 dt ";
  for (const TimeCurve& curve : time_curves) {
    std::string rows;
    for (std::size_t i = 0; i < description.frames.size(); i += every) {
      const DescribedFrame& frame = description.frames[i];
      const auto value = frame.values[figure_number(curve.figure)];
      rows +=
          value ? plot::row({static_cast<double>(frame.at) / description.rate_hz, *value}) : "\n";
    }
    panel.series.push_back(
        {.style = style + std::to_string(curve.dashes) + " lc rgb '" + plot::ink + "'",
         .data = rows,
         .title = curve.title});
  }
  return panel;
}

}  // namespace

plot::Figure description_figure(const Description& description, const DescriptionOptions& options) {
  return {.title = description.of,
          .panel_width = 900.0,
          .panels = {spectrum_panel(description, options), time_panel(description)}};
}

}  // namespace ressort::commands
