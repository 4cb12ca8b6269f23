#include "app/commands/modes/shapes_svg.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include "app/commands/svg.h"
#include "app/session/modes/known_modes.h"
#include "app/text.h"
#include "core/analysis/modes/layout.h"

namespace ressort::commands {
namespace {

constexpr double panel_width = 260.0;
constexpr double panel_height = 190.0;
constexpr double caption_height = 26.0;
constexpr double margin = 14.0;
constexpr std::size_t columns = 4;
constexpr std::size_t most_dots = 900;  // of a panel

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", value);
  return text;
}

// Of one panel.
class PanelDrawer {
 public:
  PanelDrawer(const MassLayout& layout, const std::vector<double>& displacement)
      : layout_(layout), displacement_(displacement) {
    for (const auto& row : layout.rows) {
      for (const LayoutPoint& point : row) {
        left_ = std::min(left_, point.x);
        right_ = std::max(right_, point.x);
        low_ = std::min(low_, point.y);
        high_ = std::max(high_, point.y);
        dots_ += 1;
        most_ = std::max(most_, std::fabs(displacement[point.mass]));
      }
    }
  }

  std::string draw() const { return layout_.is_plane ? plane() : lines(); }

 private:
  double share(const LayoutPoint& point) const {
    return most_ > 0.0 ? displacement_[point.mass] / most_ : 0.0;
  }

  std::string plane() const {
    const double width = panel_width - 2.0 * margin;
    const double height = panel_height - caption_height - 2.0 * margin;
    const double scale =
        std::min(width / std::max(1.0, right_ - left_), height / std::max(1.0, high_ - low_));
    const std::size_t too_many = dots_ / most_dots;
    const std::size_t every =
        1 + static_cast<std::size_t>(std::sqrt(static_cast<double>(too_many)));
    const double area = width * height / static_cast<double>(std::min(dots_, most_dots));
    const double largest = std::clamp(0.6 * std::sqrt(area), 2.0, 9.0);
    std::string svg;
    for (const auto& row : layout_.rows) {
      for (const LayoutPoint& point : row) {
        const bool is_shown = every == 1 || (static_cast<std::size_t>(point.x) % every == 0 &&
                                             static_cast<std::size_t>(point.y) % every == 0);
        if (!is_shown) {
          continue;
        }
        const double x = margin + 0.5 * width + (point.x - 0.5 * (left_ + right_)) * scale;
        const double y = 0.5 * height + margin + (point.y - 0.5 * (low_ + high_)) * scale;
        const double part = share(point);
        const double size = std::max(0.8, largest * std::sqrt(std::fabs(part)));
        svg += "<circle cx='" + number(x) + "' cy='" + number(y) + "' r='" + number(size) +
               "' class='" +
               (std::fabs(part) < 1e-3 ? "still"
                : part > 0.0           ? "up"
                                       : "down") +
               "'/>\n";
      }
    }
    return svg;
  }

  // A row below the other, each over all the width.
  std::string lines() const {
    const auto rows = static_cast<double>(layout_.rows.size());
    const double height = (panel_height - caption_height - margin) / rows;
    std::string svg;
    for (std::size_t r = 0; r < layout_.rows.size(); ++r) {
      const std::vector<LayoutPoint>& row = layout_.rows[r];
      const double middle = 8.0 + height * (static_cast<double>(r) + 0.5);
      const double step =
          (panel_width - 2.0 * margin) / std::max(1.0, static_cast<double>(row.size() - 1));
      svg += "<path class='rest' d='M" + number(margin) + " " + number(middle) + "H" +
             number(panel_width - margin) + "'/>\n";
      std::string path;
      std::string dots;
      const std::size_t every = 1 + row.size() / most_dots;
      for (std::size_t i = 0; i < row.size(); i += every) {
        const double part = share(row[i]);
        const std::string x = number(margin + step * static_cast<double>(i));
        const std::string y = number(middle - 0.45 * height * part);
        path += (path.empty() ? "M" : "L") + x + " " + y;
        if (row.size() <= 40) {
          dots += "<circle cx='" + x + "' cy='" + y + "' r='2.2' class='" +
                  (part < 0.0 ? "down" : "up") + "'/>\n";
        }
      }
      svg += "<path class='shape' d='" + path + "'/>\n" + dots;
    }
    return svg;
  }

  const MassLayout& layout_;
  const std::vector<double>& displacement_;  // [mass]
  double left_ = 1e300;
  double right_ = -1e300;
  double low_ = 1e300;
  double high_ = -1e300;
  double most_ = 0.0;
  std::size_t dots_ = 0;
};

}  // namespace

std::string shapes_svg(const NetworkModes& modes, const Network& network,
                       const std::string& title) {
  const MassLayout layout = layout_of(network);
  const std::size_t count = std::min(modes.modes.size(), most_drawn_modes);
  const std::size_t rows = (count + columns - 1) / columns;
  constexpr double head = 34.0;
  const double width =
      panel_width * static_cast<double>(std::min(columns, std::max<std::size_t>(count, 1)));
  const double height = head + panel_height * static_cast<double>(rows);
  std::string svg =
      "<svg xmlns='http://www.w3.org/2000/svg' width='" + number(width) + "' height='" +
      number(height) + "' viewBox='0 0 " + number(width) + " " + number(height) +
      "'>\n<style>text{font:13px sans-serif;fill:#222}.up{fill:#c8402f}.down{fill:#2f6fc8}"
      ".still{fill:#bbb}.rest{stroke:#bbb;fill:none}.shape{stroke:#222;fill:none}"
      ".frame{stroke:#ddd;fill:none}</style>\n<rect width='100%' height='100%' "
      "fill='#fff'/>\n<text x='14' y='22' style='font-size:16px'>" +
      escaped(title) + "</text>\n";
  std::vector<double> displacement(modes.network.masses.size());
  for (std::size_t m = 0; m < count; ++m) {
    const NetworkMode& mode = modes.modes[m];
    for (std::size_t row = 0; row < modes.system.size(); ++row) {
      displacement[modes.system.masses[row]] =
          modes.displacement(m, static_cast<std::uint32_t>(row));
    }
    const double x = panel_width * static_cast<double>(m % columns);
    const std::size_t row_of_panels = m / columns;
    const double y = head + panel_height * static_cast<double>(row_of_panels);
    svg += "<g transform='translate(" + number(x) + " " + number(y) +
           ")'>\n<rect class='frame' x='4' "
           "y='2' width='" +
           number(panel_width - 8.0) + "' height='" + number(panel_height - 6.0) + "'/>\n" +
           PanelDrawer(layout, displacement).draw() + "<text x='14' y='" +
           number(panel_height - 14.0) + "'>" + std::to_string(m + 1) + ": " +
           fixed(mode.frequency_hz, 2) + " Hz, " + note_name(mode.frequency_hz) + ", " +
           (std::isfinite(mode.t60_s) ? fixed(mode.t60_s, 2) + " s" : "endless") +
           "</text>\n</g>\n";
  }
  return svg + "</svg>\n";
}

}  // namespace ressort::commands
