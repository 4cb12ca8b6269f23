// app/commands: timbre figures over the parameters of a preset or a model.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "app/commands/timbre/describe.h"
#include "app/plot/plot.h"
#include "core/result.h"

namespace ressort::commands {

// Parses "NAME=LOW:HIGH", followed by ":STEPS", ":log" or ":linear". Wide ranges are logarithmic by
// default.
Result<SweptParameter> parse_swept(const std::string& text);
// Splits "FIGURE=FORMULA" without parsing either.
Result<FigureLaw> parse_law(const std::string& text);

struct SweepRow {
  std::vector<double> at;                      // [swept]
  std::vector<std::optional<double>> figures;  // [figure]
};
struct SweepTable {
  std::string of;                  // name, for people
  std::vector<std::string> names;  // names of the figures
  std::vector<SweepRow> rows;      // the first parameter varies slowest
};

// Returns CSV with the names of parameters and figures in the first line. Missing figures are
// empty.
std::string to_csv(const SweepTable& table, const std::vector<SweptParameter>& swept);

// Draws a panel for each figure over the first swept parameter, with one line for each value of the
// others and dashed lines for laws. Fails on an unknown figure and on a law that is not a formula.
Result<plot::Figure> sweep_figure(const SweepTable& table, const DescribeOptions& options);

// Analyses a sound for each combination of values. Prints equal warnings once. Sounds that cannot
// be analysed have no figures; if the first fails, the sweep fails. `should_continue` returns false
// to stop without writing. Returns the exit code. [main]
int sweep(const DescribeOptions& options, const std::function<bool()>& should_continue);

}  // namespace ressort::commands
