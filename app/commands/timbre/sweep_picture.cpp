#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "app/commands/timbre/sweep.h"
#include "app/text.h"
#include "core/curve.h"
#include "core/model/language/expression.h"

namespace ressort::commands {
namespace {

const char* const usual_figures[] = {"centroid_hz", "spread_hz", "skewness",
                                     "kurtosis",    "decrease",  "rolloff95_hz"};

// Returns a grey level, 0..1: later lines are darker.
std::string grey(double share) {
  char text[16];
  const int level = static_cast<int>(std::lround(170.0 - 140.0 * share));
  std::snprintf(text, sizeof text, "#%02x%02x%02x", level, level, level);
  return text;
}

struct LawCurve {
  std::size_t figure = 0;
  Formula formula;
};

// Values of the parameters of one row, or nothing for a gap in the line.
using RowValue = std::function<std::optional<double>(const SweepRow&)>;

class SweepDrawer {
 public:
  SweepDrawer(const SweepTable& table, const DescribeOptions& options,
              const std::vector<LawCurve>& laws)
      : table_(table), options_(options), laws_(laws) {
    for (const SweepRow& row : table.rows) {
      const std::vector<double> others(row.at.begin() + 1, row.at.end());
      if (std::ranges::find(lines_, others) == lines_.end()) {
        lines_.push_back(others);
      }
    }
  }

  plot::Figure draw(const std::vector<std::size_t>& figures) const {
    plot::Figure drawn{.title = title(), .panel_width = 450.0, .columns = 2};
    for (const std::size_t figure : figures) {
      drawn.panels.push_back(figure_panel(figure));
      for (const LawCurve& law : laws_) {
        if (law.figure == figure) {
          drawn.panels.push_back(deviation_panel(law));
        }
      }
    }
    drawn.columns = std::min(drawn.columns, drawn.panels.size());
    return drawn;
  }

 private:
  std::string title() const {
    std::string text = table_.of + " over " + options_.swept[0].name;
    for (std::size_t i = 1; i < options_.swept.size(); ++i) {
      text += (i == 1 ? "; darker lines: more " : ", ") + options_.swept[i].name;
    }
    return text + (laws_.empty() ? "" : "; dashed: --law");
  }

  std::string words_of(std::size_t figure) const {
    const std::string& name = table_.names[figure];
    return name.ends_with("_hz") || name.ends_with("_s") ? name.substr(0, name.rfind('_')) : name;
  }
  std::string unit_of(std::size_t figure) const {
    const std::string& name = table_.names[figure];
    return name.ends_with("_hz") ? " in Hz" : name.ends_with("_s") ? " in s" : "";
  }

  plot::Panel figure_panel(std::size_t figure) const {
    std::vector<std::pair<RowValue, std::string>> curves = {
        {[=](const SweepRow& row) { return row.figures[figure]; }, ""}};
    for (const LawCurve& law : laws_) {
      if (law.figure == figure) {
        curves.emplace_back(
            [&](const SweepRow& row) { return std::optional(evaluate(law.formula, row.at)); },
            " dt 2");
      }
    }
    return panel(words_of(figure) + unit_of(figure), curves);
  }

  // Returns the panel of the percentage by which a law exceeds the measured values.
  plot::Panel deviation_panel(const LawCurve& law) const {
    const RowValue deviation = [&](const SweepRow& row) {
      const std::optional<double> found = row.figures[law.figure];
      return found ? std::optional(100.0 * (evaluate(law.formula, row.at) / *found - 1.0))
                   : std::nullopt;
    };
    return panel(words_of(law.figure) + ": deviation of --law in %", {{deviation, ""}});
  }

  plot::Panel panel(const std::string& heading,
                    const std::vector<std::pair<RowValue, std::string>>& curves) const {
    const SweptParameter& swept = options_.swept[0];
    plot::Panel panel{.title = heading,
                      .x = {.title = swept.name,
                            .from = std::min(swept.first, swept.last),
                            .to = std::max(swept.first, swept.last),
                            .is_logarithmic = swept.by_ratios}};
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (std::size_t l = 0; l < lines_.size(); ++l) {
      const double share =
          lines_.size() > 1 ? static_cast<double>(l) / static_cast<double>(lines_.size() - 1) : 1.0;
      for (const auto& [value_of, dashes] : curves) {
        plot::Series series{.style = "lines lw 1.5" + dashes + " lc rgb '" + grey(share) + "'"};
        for (const SweepRow& row : table_.rows) {
          if (!std::equal(row.at.begin() + 1, row.at.end(), lines_[l].begin(), lines_[l].end())) {
            continue;
          }
          const std::optional<double> value = value_of(row);
          const bool is_there = value && std::isfinite(*value);
          low = is_there ? std::min(low, *value) : low;
          high = is_there ? std::max(high, *value) : high;
          series.data += is_there ? plot::row({row.at[0], *value}) : "\n";
        }
        panel.series.push_back(std::move(series));
      }
    }
    if (!(high >= low)) {
      panel.series.clear();
      panel.note = "no values";
      return panel;
    }
    panel.y.is_logarithmic = is_wide(low, high);
    const double room = high > low ? 0.05 * (high - low) : low != 0.0 ? 0.1 * std::fabs(low) : 1.0;
    panel.y.from = panel.y.is_logarithmic ? low / 1.2 : low - room;
    panel.y.to = panel.y.is_logarithmic ? high * 1.2 : high + room;
    return panel;
  }

  const SweepTable& table_;
  const DescribeOptions& options_;
  const std::vector<LawCurve>& laws_;
  std::vector<std::vector<double>> lines_;  // values of all swept parameters but the first
};

}  // namespace

Result<plot::Figure> sweep_figure(const SweepTable& table, const DescribeOptions& options) {
  const auto number_of = [&](const std::string& name) -> Result<std::size_t> {
    const auto found = std::ranges::find(table.names, name);
    return found != table.names.end()
               ? Result<std::size_t>(static_cast<std::size_t>(found - table.names.begin()))
               : Error{"there is no figure '" + name + "'; there are " + joined(table.names, ", ")};
  };
  std::vector<std::string> wanted = options.figures;
  std::vector<std::string> parameters;
  std::vector<LawCurve> laws;
  for (const SweptParameter& swept : options.swept) {
    parameters.push_back(swept.name);
  }
  for (const FigureLaw& law : options.laws) {
    const auto figure = number_of(law.figure);
    if (!figure) {
      return Error{"--law: " + figure.error().message};
    }
    auto formula = parse_expression(law.formula, parameters);
    if (!formula) {
      return Error{"--law: '" + law.formula + "': " + formula.error().message};
    }
    laws.push_back({*figure, *std::move(formula)});
    if (options.figures.empty() && std::ranges::find(wanted, law.figure) == wanted.end()) {
      wanted.push_back(law.figure);
    }
  }
  if (wanted.empty()) {
    wanted.assign(std::begin(usual_figures), std::end(usual_figures));
  }
  std::vector<std::size_t> figures;
  for (const std::string& name : wanted) {
    const auto figure = number_of(name);
    if (!figure) {
      return Error{"--figures: " + figure.error().message};
    }
    figures.push_back(*figure);
  }
  return SweepDrawer(table, options, laws).draw(figures);
}

}  // namespace ressort::commands
