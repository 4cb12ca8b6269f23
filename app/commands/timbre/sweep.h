// app/commands: how figures of timbre go while parameters of a preset or a model are swept.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "app/commands/timbre/describe.h"
#include "core/result.h"

namespace ressort::commands {

// "NAME=LOW:HIGH", and ":STEPS", ":log" or ":linear" after it; by equal ratios where the range is
// wide, unless it says how.
Result<SweptParameter> parse_swept(const std::string& text);
// "FIGURE=FORMULA"; without looking at either.
Result<FigureLaw> parse_law(const std::string& text);

struct SweepRow {
  std::vector<double> at;                      // [swept]
  std::vector<std::optional<double>> figures;  // [figure]
};
struct SweepTable {
  std::string of;                  // for people
  std::vector<std::string> names;  // of figures
  std::vector<SweepRow> rows;      // the first of what is swept goes the slowest
};

// Names of what is swept and of figures in the first line; nothing between two commas where a sound
// has no such figure.
std::string to_csv(const SweepTable& table, const std::vector<SweptParameter>& swept);

// A panel for each figure over the parameter that was swept first, a line for each value of the
// others, the later the darker; laws dashed. The error: a figure or a law that is none.
Result<std::string> sweep_svg(const SweepTable& table, const DescribeOptions& options);

// As many sounds as there are values. What is told of one is left out if it has been told. Where
// one cannot be described, its figures are missing; where the first cannot, it ends there.
// `goes_on` answers false to stop: nothing is written then. The exit code comes back. [main]
int sweep(const DescribeOptions& options, const std::function<bool()>& goes_on);

}  // namespace ressort::commands
