#include "tests/bench/faust_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "app/commands/svg.h"
#include "tests/support/rooms.h"

namespace ressort::bench {
namespace {

constexpr double left = 210.0;  // pixels
constexpr double right = 20.0;
constexpr double width = 760.0;
constexpr double top = 60.0;
constexpr double bottom = 40.0;
constexpr double line_height = 26.0;

constexpr std::array<double, 11> ticks{0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0, 50.0, 100.0};

struct Kind {
  const char* name;
  bool is_engine;
  bool is_double;
  const char* colour;
  double below;  // the middle of a scene's line
};
constexpr std::array<Kind, 4> kinds{{{"kernel, double", false, true, "#4a90d9", -7.5},
                                     {"engine, double", true, true, "#14508c", -2.5},
                                     {"kernel, float", false, false, "#f0a050", 2.5},
                                     {"engine, float", true, false, "#b35900", 7.5}}};

// The row of the engine, or of the kernel that it plays.
const Row* row_of(const Kind& kind, const std::string& scene, const std::vector<Row>& rows) {
  const auto find = [&](const std::string& method) -> const Row* {
    const auto row = std::find_if(rows.begin(), rows.end(), [&](const Row& known) {
      return known.scene == scene && known.is_double == kind.is_double && known.method == method;
    });
    return row == rows.end() ? nullptr : &*row;
  };
  const Row* const engine = find("ressort");
  return kind.is_engine || engine == nullptr ? engine : find(engine->form);
}

// From `least` to `most` times as fast, logarithmically.
struct Axis {
  double least;
  double most;
  double at(double times) const {
    return left + (width - left - right) * std::log(times / least) / std::log(most / least);
  }
};

Axis axis_of(const std::vector<Row>& rows) {
  Axis axis{0.5, 2.0};
  for (const Row& row : rows) {
    if (row.than_best_faust && row.method == "ressort") {
      axis.least = std::min(axis.least, *row.than_best_faust / 1.2);
      axis.most = std::max(axis.most, *row.than_best_faust * 2.0);
    }
  }
  return axis;
}

std::string disc(double x, double y, const char* colour) {
  return "<circle cx='" + px(x) + "' cy='" + px(y) + "' r='2.6' fill='" + colour + "'/>\n";
}

std::string mark(const Kind& kind, const Row& row, const Axis& axis, double middle) {
  const double times = *row.than_best_faust;
  const double y = middle + kind.below;
  return line(axis.at(times * row.median_ns / row.upper_ns), y,
              axis.at(times * row.median_ns / row.lower_ns), y, kind.colour, "1.6") +
         disc(axis.at(times), y, kind.colour);
}

}  // namespace

std::string faust_picture(const std::string& machine, const std::vector<Row>& rows) {
  std::vector<std::string> scenes;
  for (const Row& row : rows) {
    if (row.than_best_faust && row.method == "ressort" && row.is_double) {
      scenes.push_back(row.scene);
    }
  }
  if (scenes.empty()) {
    return {};
  }
  const Axis axis = axis_of(rows);
  const double end = top + line_height * static_cast<double>(scenes.size());
  std::string svg = svg_head(width, end + bottom, 11.0) +
                    label(left, 18.0, "times faster than the best of FAUST; " + machine, "start");
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    const double x = left + 130.0 * static_cast<double>(i);
    svg += disc(x + 4.0, 36.0, kinds[i].colour) + label(x + 12.0, 40.0, kinds[i].name, "start");
  }
  for (const double times : ticks) {
    if (times >= axis.least && times <= axis.most) {
      const bool is_one = times == 1.0;
      char text[20];
      std::snprintf(text, sizeof text, "%g", times);
      svg += line(axis.at(times), top, axis.at(times), end, is_one ? "#c00" : grid_ink,
                  is_one ? "1.6" : "0.7") +
             label(axis.at(times), end + 16.0, text, "middle");
    }
  }
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    const double middle = top + line_height * (static_cast<double>(i) + 0.5);
    svg += label(left - 10.0, middle + 4.0, scenes[i]);
    for (const Kind& kind : kinds) {
      const Row* const row = row_of(kind, scenes[i], rows);
      if (row != nullptr && row->than_best_faust) {
        svg += mark(kind, *row, axis, middle);
      }
    }
  }
  return svg + "</svg>\n";
}

}  // namespace ressort::bench
