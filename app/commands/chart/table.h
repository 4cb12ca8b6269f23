// app/commands: the results of the chart, as a table and as figures. Pure.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "app/commands/chart/ways.h"
#include "app/plot/plot.h"

namespace ressort::commands {

// Solutions that errors are measured against.
enum ChartReference : std::size_t {
  published,  // the published scheme at 44,100 Hz in long double
  physical    // the continuous network of the same M, K and Z
};

struct ChartRow {
  Way way;
  std::string methods;                // methods of its parts, "modal" or "grid+direct"
  std::vector<std::string> twins;     // methods with the same output
  double ns = 0.0;                    // per output sample, one voice; 0: not timed
  std::array<double, 2> snr_db{};     // [ChartReference] NaN if unknown
  std::string failure;                // why it is unstable; empty if it is stable
  std::array<bool, 2> is_on_front{};  // [ChartReference]
};

// One scene.
struct ChartSheet {
  std::string scene;
  std::string about;               // the excitation
  std::string reference;           // description of the physical reference
  std::optional<double> floor_db;  // accuracy of a physical reference that is not exact
  double window_s = 1.0;           // length of the compared sound
  std::vector<ChartRow> rows;
};

// Cost and accuracy of a method.
struct CostAndAccuracy {
  double ns = 0.0;
  double snr_db = 0.0;
};

// Finds the Pareto front: [point] whether no other point is both cheaper and better. Of equal
// points the first is on the front. A point that is not finite never is.
std::vector<bool> front_of(std::span<const CostAndAccuracy> points);

// Sets `is_on_front` of the stable rows.
void find_fronts(ChartSheet& sheet);

// Writes all sheets as CSV: comments that explain the columns, their names, a line per row.
std::string chart_csv(const std::vector<ChartSheet>& sheets, const std::string& made_by);

// One scene against both references.
plot::Figure sheet_figure(const ChartSheet& sheet, const std::string& made_by);

// All scenes against the continuous network.
plot::Figure overview_figure(const std::vector<ChartSheet>& sheets, const std::string& made_by);

}  // namespace ressort::commands
