#include "tests/bench/figures.h"

#include <algorithm>
#include <array>
#include <map>

#include "tests/support/rooms.h"

namespace ressort::bench {
namespace {

// One method in one precision.
struct Curve {
  std::string method;
  bool is_double = true;
  std::string data;
};

// Draws only the fastest variant of FAUST of each scene.
std::vector<Curve> curves_of(const std::string& family, const std::vector<Row>& rows) {
  std::vector<Curve> curves;
  const auto add = [&](const Row& row, const std::string& method, double times) {
    auto curve = std::find_if(curves.begin(), curves.end(), [&](const Curve& known) {
      return known.method == method && known.is_double == row.is_double;
    });
    if (curve == curves.end()) {
      curve = curves.insert(curve, {method, row.is_double, ""});
    }
    const double ns_per_mass = row.median_ns / static_cast<double>(row.masses * row.voices);
    curve->data += plot::row({static_cast<double>(row.masses), times * ns_per_mass});
  };
  for (const Row& row : rows) {
    if (row.family == family && !row.method.starts_with("faust")) {
      add(row, row.method, 1.0);
    }
    if (row.family == family && row.method == "ressort" && row.is_double && row.than_best_faust) {
      add(row, "best FAUST", *row.than_best_faust);
    }
  }
  return curves;
}

// Methods have the same style in all panels.
std::string style_of(const Curve& curve) {
  static const std::map<std::string, std::string> colours{
      {"ressort", "#000000"}, {"direct", "#d55e00"}, {"chains", "#0072b2"},    {"modal", "#009e73"},
      {"grid", "#cc79a7"},    {"batch", "#c0a000"},  {"best FAUST", "#8c4a1f"}};
  const auto known = colours.find(curve.method);
  return "linespoints pt 7 ps 0.4 lc rgb '" +
         (known == colours.end() ? std::string("#808080") : known->second) + "' lw " +
         (curve.method == "ressort" ? "2.5" : "1.2") + " dt " + (curve.is_double ? "1" : "2");
}

// A kind of marker in the comparison with FAUST.
struct Kind {
  const char* name;
  bool is_engine;
  bool is_double;
  const char* colour;
  double above;  // vertical offset from the middle of the scene's line, in lines
};
constexpr std::array<Kind, 4> kinds{{{"kernel, double", false, true, "#4a90d9", 0.28},
                                     {"engine, double", true, true, "#14508c", 0.1},
                                     {"kernel, float", false, false, "#f0a050", -0.1},
                                     {"engine, float", true, false, "#b35900", -0.28}}};

// Returns the row of the engine, or of the kernel that the engine plays.
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

}  // namespace

plot::Figure cost_figure(const std::string& machine, const std::vector<Row>& rows) {
  plot::Figure figure{.title = machine, .panel_width = 620.0, .panel_height = 480.0, .columns = 2};
  std::map<std::string, std::string> legend;
  for (const char* const family : {"chains", "meshes"}) {
    plot::Panel panel{.title = family,
                      .x = {.title = "masses", .is_logarithmic = true},
                      .y = {.title = "ns per mass and sample", .is_logarithmic = true}};
    for (const Curve& curve : curves_of(family, rows)) {
      panel.series.push_back({.style = style_of(curve), .data = curve.data});
      legend[curve.method + (curve.is_double ? "" : ", float")] = style_of(curve);
    }
    if (!panel.series.empty()) {
      figure.panels.push_back(std::move(panel));
    }
  }
  for (const auto& [title, style] : legend) {
    figure.legend.push_back({.style = style, .data = {}, .title = title});
  }
  figure.legend_columns = 5;
  return figure;
}

plot::Figure faust_figure(const std::string& machine, const std::vector<Row>& rows) {
  std::vector<std::string> scenes;
  double least = 0.5;
  double most = 2.0;
  for (const Row& row : rows) {
    if (row.than_best_faust && row.method == "ressort") {
      least = std::min(least, *row.than_best_faust / 1.2);
      most = std::max(most, *row.than_best_faust * 2.0);
      if (row.is_double) {
        scenes.push_back(row.scene);
      }
    }
  }
  plot::Figure figure{.title = "Times faster than the best of FAUST",
                      .caption = machine,
                      .panel_width = 800.0,
                      .legend_columns = 4};
  if (scenes.empty()) {
    return figure;
  }
  plot::Panel panel{.x = {.from = least, .to = most, .is_logarithmic = true},
                    .y = {.from = -0.5, .to = static_cast<double>(scenes.size()) - 0.5},
                    .height = 40.0 + 26.0 * static_cast<double>(scenes.size()),
                    .left_margin = 220.0};
  for (const double times : {0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0, 50.0, 100.0}) {
    panel.x.ticks.push_back({times, plot::number(times)});
  }
  panel.series.push_back({.style = "lines lw 1.6 lc rgb '#cc0000'",
                          .data = plot::row({1.0, panel.y.from}) + plot::row({1.0, panel.y.to})});
  for (const Kind& kind : kinds) {
    plot::Series marks{
        .style = "xerrorbars pt 7 ps 0.5 lw 1.6 lc rgb '" + std::string(kind.colour) + "'",
        .columns = "1:2:3:4"};
    for (std::size_t i = 0; i < scenes.size(); ++i) {
      const Row* const row = row_of(kind, scenes[i], rows);
      if (row != nullptr && row->than_best_faust) {
        const double times = *row->than_best_faust;
        marks.data += plot::row({times, static_cast<double>(scenes.size() - 1 - i) + kind.above,
                                 times * row->median_ns / row->upper_ns,
                                 times * row->median_ns / row->lower_ns});
      }
    }
    figure.legend.push_back(
        {.style = "points pt 7 ps 0.7 lc rgb '" + std::string(kind.colour) + "'",
         .data = {},
         .title = kind.name});
    panel.series.push_back(std::move(marks));
  }
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    panel.y.ticks.push_back({static_cast<double>(scenes.size() - 1 - i), scenes[i]});
  }
  figure.panels.push_back(std::move(panel));
  return figure;
}

}  // namespace ressort::bench
