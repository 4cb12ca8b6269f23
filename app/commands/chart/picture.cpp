#include "app/commands/chart/table.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace ressort::commands {
namespace {

constexpr double deepest_db = -320.0;
const char* const front_style = "steps lw 6 lc rgb '#c4c4c4'";
const char* const floor_style = "lines dt 3 lw 1.4 lc rgb '#606060'";
const char* const failed_style = "points pt 2 ps 1.2 lw 2.4 lc rgb '#b00000'";

// Precisions differ in lightness and in dash pattern, so the figure is legible in grey.
const char* style_of(Precision precision) {
  return precision == Precision::float64 ? " dt 1 lc rgb '#000000'" : " dt 2 lc rgb '#e69f00'";
}

// Gnuplot's point types: open for the network as it is written, filled with a budget.
std::string points_of(const std::string& methods, bool has_budget) {
  static const std::map<std::string, int> open = {
      {"direct", 6}, {"chains", 4}, {"modal", 12}, {"grid", 10}, {"batch", 8}};
  const auto known = open.find(methods.substr(0, methods.find('+')));
  const int type = known == open.end() ? 14 : known->second;
  return "points pt " + std::to_string(has_budget ? type + 1 : type) + " ps 0.9 lw 1.5";
}

double error_db(const ChartRow& row, ChartReference reference) {
  return std::clamp(-row.snr_db[reference], deepest_db, 0.0);
}

bool is_drawn(const ChartRow& row, ChartReference reference) {
  return row.failure.empty() && std::isfinite(row.snr_db[reference]) && row.ns > 0.0;
}

plot::Axis time_axis(const ChartSheet& sheet) {
  plot::Axis axis{.from = HUGE_VAL, .to = 0.0, .is_logarithmic = true};
  for (const ChartRow& row : sheet.rows) {
    if (row.ns > 0.0) {
      axis.from = std::min(axis.from, 0.6 * row.ns);
      axis.to = std::max(axis.to, 2.2 * row.ns);
    }
  }
  return axis.to > 0.0 ? axis : plot::Axis{.from = 1.0, .to = 1e3, .is_logarithmic = true};
}

// The Pareto front as stairs, from the top of the panel to its right edge.
plot::Series front(const ChartSheet& sheet, ChartReference reference, const plot::Panel& panel) {
  std::vector<std::pair<double, double>> points;
  for (const ChartRow& row : sheet.rows) {
    if (row.is_on_front[reference] && is_drawn(row, reference)) {
      points.emplace_back(row.ns, error_db(row, reference));
    }
  }
  std::ranges::sort(points);
  plot::Series series{.style = front_style};
  for (const auto& [ns, db] : points) {
    series.data += (series.data.empty() ? plot::row({ns, panel.y.to}) : "") + plot::row({ns, db});
  }
  if (!points.empty()) {
    series.data += plot::row({panel.x.to, points.back().second});
  }
  return series;
}

plot::Panel panel_of(const ChartSheet& sheet, ChartReference reference, bool has_labels) {
  plot::Panel panel{.x = time_axis(sheet), .y = {.from = -100.0, .to = 8.0}};
  const bool has_floor = reference == physical && sheet.floor_db.has_value();
  double low = has_floor ? -*sheet.floor_db : 0.0;
  for (const ChartRow& row : sheet.rows) {
    low = is_drawn(row, reference) ? std::min(low, error_db(row, reference)) : low;
  }
  panel.y.from = 20.0 * std::floor((low - 8.0) / 20.0);
  if (plot::Series stairs = front(sheet, reference, panel); !stairs.data.empty()) {
    panel.series.push_back(std::move(stairs));
  }
  if (has_floor) {
    panel.series.push_back({.style = floor_style,
                            .data = plot::row({panel.x.from, -*sheet.floor_db}) +
                                    plot::row({panel.x.to, -*sheet.floor_db})});
  }
  std::map<std::string, std::string> lines;   // style and name to points
  std::map<std::string, std::string> glyphs;  // style to points
  plot::Series labels{
      .style = "labels left offset 0.7,0.4 font 'sans,8' noenhanced tc rgb '#303030'",
      .columns = "1:2:3"};
  plot::Series failed{.style = failed_style};
  for (const ChartRow& row : sheet.rows) {
    if (is_drawn(row, reference)) {
      const double db = error_db(row, reference);
      lines[row.way.line + "\n" + style_of(row.way.precision)] += plot::row({row.ns, db});
      glyphs[points_of(row.methods, !row.way.budget.empty()) + style_of(row.way.precision)] +=
          plot::row({row.ns, db});
      if (!row.way.label.empty() && row.way.precision == Precision::float64) {
        labels.data += plot::row({row.ns, db}, row.way.label);
      }
    } else if (!row.failure.empty() && row.ns > 0.0) {
      failed.data += plot::row({row.ns, panel.y.to});
    }
  }
  for (const auto& [key, data] : lines) {
    panel.series.push_back({.style = "lines lw 1" + key.substr(key.find('\n') + 1), .data = data});
  }
  for (const auto& [style, data] : glyphs) {
    panel.series.push_back({.style = style, .data = data});
  }
  if (has_labels && !labels.data.empty()) {
    panel.series.push_back(std::move(labels));
  }
  if (!failed.data.empty()) {
    panel.series.push_back(std::move(failed));
  }
  return panel;
}

// Explains the marks, colours and lines that occur.
std::vector<plot::Series> legend_of(std::span<const ChartSheet> sheets) {
  std::set<std::string> methods;
  std::set<Precision> precisions;
  bool has_budget = false;
  bool has_failed = false;
  bool has_floor = false;
  for (const ChartSheet& sheet : sheets) {
    has_floor |= sheet.floor_db.has_value();
    for (const ChartRow& row : sheet.rows) {
      methods.insert(row.methods.substr(0, row.methods.find('+')));
      precisions.insert(row.way.precision);
      has_budget |= !row.way.budget.empty();
      has_failed |= !row.failure.empty();
    }
  }
  std::vector<plot::Series> legend;
  const auto add = [&](const std::string& style, const std::string& title) {
    legend.push_back({.style = style, .data = {}, .title = title});
  };
  for (const std::string& method : methods) {
    add(points_of(method, false) + " lc rgb '#000000'", method);
  }
  if (has_budget) {
    add("points pt 7 ps 0.9 lc rgb '#000000'", "filled: with a budget");
  }
  for (const Precision precision : precisions) {
    add(std::string("lines lw 3") + style_of(precision), precision_name(precision));
  }
  add(front_style, "Pareto front");
  if (has_floor) {
    add(floor_style, "accuracy of the reference");
  }
  if (has_failed) {
    add(failed_style, "unstable when struck hard");
  }
  return legend;
}

}  // namespace

plot::Figure sheet_figure(const ChartSheet& sheet, const std::string& made_by) {
  plot::Figure figure{.title = sheet.scene + ": " + sheet.about,
                      .caption = made_by,
                      .panel_width = 480.0,
                      .panel_height = 360.0,
                      .columns = 2,
                      .legend = legend_of({&sheet, 1}),
                      .legend_columns = 5};
  for (const ChartReference reference : {physical, published}) {
    plot::Panel panel = panel_of(sheet, reference, true);
    panel.title =
        reference == physical ? "against the continuous network" : "against the published scheme";
    panel.x.title = "time per sample, one core (ns)";
    panel.y.title = "error, first " + plot::number(1e3 * sheet.window_s) + " ms (dB)";
    figure.panels.push_back(std::move(panel));
  }
  return figure;
}

plot::Figure overview_figure(const std::vector<ChartSheet>& sheets, const std::string& made_by) {
  plot::Figure figure{.title = "Error against the continuous network over time per sample",
                      .caption = made_by,
                      .panel_width = 320.0,
                      .panel_height = 250.0,
                      .columns = std::min<std::size_t>(3, sheets.size()),
                      .legend = legend_of(sheets),
                      .legend_columns = 5};
  for (std::size_t i = 0; i < sheets.size(); ++i) {
    plot::Panel panel = panel_of(sheets[i], physical, false);
    panel.title = sheets[i].scene;
    panel.x.title = i + figure.columns >= sheets.size() ? "ns per sample" : "";
    panel.y.title = i % figure.columns == 0 ? "dB" : "";
    figure.panels.push_back(std::move(panel));
  }
  return figure;
}

}  // namespace ressort::commands
