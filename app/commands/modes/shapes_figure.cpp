#include "app/commands/modes/shapes_figure.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "app/rooms.h"
#include "app/session/modes/known_modes.h"
#include "app/text.h"
#include "core/analysis/modes/layout.h"

namespace ressort::commands {
namespace {

constexpr std::size_t most_dots = 900;  // largest number of masses drawn in a panel
constexpr double up_colour = 0xc8402f;
constexpr double down_colour = 0x2f6fc8;
constexpr double still_colour = 0xbbbbbb;

double colour_of(double share) {
  return std::fabs(share) < 1e-3 ? still_colour : share > 0.0 ? up_colour : down_colour;
}

// Seen from above: a dot for each mass, of the size of its displacement.
plot::Panel plane_panel(const MassLayout& layout, const std::vector<double>& share) {
  plot::Panel panel{.has_axes = false, .is_true = true};
  std::size_t dots = 0;
  double low[2] = {HUGE_VAL, HUGE_VAL};
  double high[2] = {-HUGE_VAL, -HUGE_VAL};
  for (const auto& row : layout.rows) {
    for (const LayoutPoint& point : row) {
      ++dots;
      low[0] = std::min(low[0], point.x);
      low[1] = std::min(low[1], point.y);
      high[0] = std::max(high[0], point.x);
      high[1] = std::max(high[1], point.y);
    }
  }
  panel.x = {.from = low[0] - 0.7, .to = high[0] + 0.7};
  panel.y = {.from = -high[1] - 0.7, .to = -low[1] + 0.7};
  const std::size_t too_many = dots / most_dots;
  const std::size_t every = 1 + static_cast<std::size_t>(std::sqrt(static_cast<double>(too_many)));
  const double largest =
      std::clamp(22.0 / std::sqrt(static_cast<double>(std::min(dots, most_dots))), 0.4, 2.4);
  plot::Series series{.style = "points pt 7 ps variable lc rgb variable", .columns = "1:2:3:4"};
  for (const auto& row : layout.rows) {
    for (const LayoutPoint& point : row) {
      if (every > 1 && (static_cast<std::size_t>(point.x) % every != 0 ||
                        static_cast<std::size_t>(point.y) % every != 0)) {
        continue;
      }
      const double part = share[point.mass];
      series.data +=
          plot::row({point.x, -point.y, std::max(0.12, largest * std::sqrt(std::fabs(part))),
                     colour_of(part)});
    }
  }
  panel.series = {std::move(series)};
  return panel;
}

// One row of masses below the other, each over the whole width.
plot::Panel line_panel(const MassLayout& layout, const std::vector<double>& share) {
  plot::Panel panel{.has_axes = false};
  const auto rows = static_cast<double>(layout.rows.size());
  plot::Series rest{.style = "lines lc rgb '#bbbbbb'"};
  plot::Series shape{.style = "lines lw 1.2 lc rgb '" + std::string(plot::ink) + "'"};
  plot::Series dots{.style = "points pt 7 ps 0.4 lc rgb variable", .columns = "1:2:3"};
  for (std::size_t r = 0; r < layout.rows.size(); ++r) {
    const std::vector<LayoutPoint>& row = layout.rows[r];
    const double middle = rows - 0.5 - static_cast<double>(r);
    const double step = 1.0 / std::max(1.0, static_cast<double>(row.size() - 1));
    rest.data += plot::row({0.0, middle}) + plot::row({1.0, middle}) + "\n";
    for (std::size_t i = 0; i < row.size(); i += 1 + row.size() / most_dots) {
      const double x = step * static_cast<double>(i);
      const double part = share[row[i].mass];
      shape.data += plot::row({x, middle + 0.45 * part});
      dots.data += row.size() <= 40 ? plot::row({x, middle + 0.45 * part, colour_of(part)}) : "";
    }
    shape.data += "\n";
  }
  panel.x = {.from = -0.04, .to = 1.04};
  panel.y = {.from = 0.0, .to = rows};
  panel.series = {std::move(rest), std::move(shape)};
  if (!dots.data.empty()) {
    panel.series.push_back(std::move(dots));
  }
  return panel;
}

}  // namespace

plot::Figure network_shapes_figure(const NetworkModes& modes, const Network& network,
                                   const std::string& title) {
  const MassLayout layout = layout_of(network);
  const std::size_t count = std::min(modes.modes.size(), most_drawn_modes);
  plot::Figure figure{.title = title,
                      .panel_width = 260.0,
                      .panel_height = 190.0,
                      .columns = std::clamp<std::size_t>(count, 1, 4)};
  std::vector<double> share(modes.network.masses.size());
  for (std::size_t m = 0; m < count; ++m) {
    const NetworkMode& mode = modes.modes[m];
    double most = 0.0;
    for (std::size_t row = 0; row < modes.system.size(); ++row) {
      const double displacement = modes.displacement(m, static_cast<std::uint32_t>(row));
      share[modes.system.masses[row]] = displacement;
      most = std::max(most, std::fabs(displacement));
    }
    for (double& one : share) {
      one /= most > 0.0 ? most : 1.0;
    }
    figure.panels.push_back(layout.is_plane ? plane_panel(layout, share)
                                            : line_panel(layout, share));
    figure.panels.back().title =
        std::to_string(m + 1) + ": " + fixed(mode.frequency_hz, 2) + " Hz, " +
        note_name(mode.frequency_hz) + ", " +
        (std::isfinite(mode.t60_s) ? fixed(mode.t60_s, 2) + " s" : "undamped");
  }
  return figure;
}

}  // namespace ressort::commands
