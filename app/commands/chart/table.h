// app/commands: what the chart knows of a scene, and how it is written down.
#pragma once

#include <string>
#include <vector>

#include "app/commands/chart/clock.h"
#include "app/commands/chart/front.h"
#include "app/commands/chart/judge.h"
#include "app/commands/chart/ways.h"

namespace ressort::commands {

struct ChartRow {
  Way way;
  std::string methods;
  std::vector<std::string> twins;
  double ns = 0.0;            // per output sample, one voice
  double upper_ns = 0.0;      // the upper quartile of all rounds
  double predicted_ns = 0.0;  // by the plan's model
  Judged judged;
  std::string failure;                   // unstable or not passive, and when; empty if neither
  bool is_on_front[2] = {false, false};  // [reference]
};

// One scene's rows beside both references. The fronts and areas are those of ways that do not fail.
struct ChartSheet {
  std::string scene;
  std::string about;
  bool is_linear = false;
  std::string reference[2];          // how each was found
  std::array<double, 3> floor_db{};  // how far T2 agrees with itself
  std::size_t window = 0;            // of the chart
  double timed_s = 0.0;
  int rounds = 0;  // each way was timed so often
  std::vector<ChartRow> rows;
  double area[2] = {0.0, 0.0};            // dominated hypervolume, by measured times
  double predicted_area[2] = {0.0, 0.0};  // by predicted ones: the same on every machine

  double snr_db(const ChartRow& row, std::size_t reference) const;  // in the chart's window
};

// Sets the fronts and areas.
void find_fronts(ChartSheet& sheet);

// The columns, for who reads them by a program.
const std::vector<std::string>& chart_columns();

// Where and by what the sheets were made, in a sentence for a picture's caption.
struct Provenance {
  std::string processor;
  std::string compiler;
  std::string date;     // ISO 8601
  std::string program;  // its name, version and commit
};
std::string to_string(const Provenance& provenance);

// All sheets as one table: what it means, in lines with '#'; names of columns; rows.
std::string chart_csv(const std::vector<ChartSheet>& sheets, const Provenance& provenance);

}  // namespace ressort::commands
