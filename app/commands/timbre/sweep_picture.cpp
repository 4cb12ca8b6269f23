#include <algorithm>
#include <cmath>
#include <limits>

#include "app/commands/svg.h"
#include "app/commands/timbre/sweep.h"
#include "app/text.h"
#include "core/curve.h"
#include "core/model/language/expression.h"

namespace ressort::commands {
namespace {

constexpr double panel_width = 380.0;
constexpr double panel_height = 190.0;
constexpr double left_margin = 66.0;
constexpr double top = 58.0;
constexpr double between_x = 84.0;
constexpr double between_y = 62.0;
const char* const usual_figures[] = {"centroid_hz", "spread_hz", "skewness",
                                     "kurtosis",    "decrease",  "rolloff95_hz"};

// One side of a panel: numbers to 0..1, in straight lines or by ratios, and where its marks are.
class Axis {
 public:
  Axis(double low, double high, bool by_ratios) : low_(low), high_(high), by_ratios_(by_ratios) {
    if (!(high_ > low_)) {
      const double more = low_ != 0.0 ? 0.1 * std::fabs(low_) : 1.0;
      low_ -= by_ratios ? 0.0 : more;
      high_ += more;
    }
  }
  double share(double value) const {
    return by_ratios_ ? std::log(value / low_) / std::log(high_ / low_)
                      : (value - low_) / (high_ - low_);
  }
  std::vector<double> marks() const {
    std::vector<double> marks;
    if (by_ratios_) {
      for (double decade = std::pow(10.0, std::floor(std::log10(low_))); decade <= high_;
           decade *= 10.0) {
        for (const double digit : {1.0, 2.0, 5.0}) {
          if (decade * digit >= low_ * 0.999999 && decade * digit <= high_ * 1.000001) {
            marks.push_back(decade * digit);
          }
        }
      }
      return marks;
    }
    const double rough = (high_ - low_) / 5.0;
    const double decade = std::pow(10.0, std::floor(std::log10(rough)));
    const double step = decade * (rough / decade < 1.5 ? 1.0 : rough / decade < 3.5 ? 2.0 : 5.0);
    for (double mark = std::ceil(low_ / step - 1e-9) * step; mark <= high_ + 1e-9 * step;
         mark += step) {
      marks.push_back(std::fabs(mark) < 1e-9 * step ? 0.0 : mark);
    }
    return marks;
  }

 private:
  double low_;
  double high_;
  bool by_ratios_;
};

std::string mark_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

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

// What a panel shows: a figure with its laws, or how far one law is off it.
struct SweepPanel {
  std::size_t figure = 0;
  const LawCurve* law = nullptr;
};

class SweepDrawer {
 public:
  SweepDrawer(const SweepTable& table, const DescribeOptions& options,
              const std::vector<std::size_t>& figures, const std::vector<LawCurve>& laws)
      : table_(table), options_(options), laws_(laws) {
    for (const std::size_t figure : figures) {
      panels_.push_back({figure});
      for (const LawCurve& law : laws) {
        if (law.figure == figure) {
          panels_.push_back({figure, &law});
        }
      }
    }
    for (const SweepRow& row : table.rows) {
      const std::vector<double> others(row.at.begin() + 1, row.at.end());
      if (std::find(lines_.begin(), lines_.end(), others) == lines_.end()) {
        lines_.push_back(others);
      }
    }
  }

  std::string draw() const {
    const std::size_t columns = panels_.size() > 1 ? 2 : 1;
    const std::size_t rows = (panels_.size() + columns - 1) / columns;
    const double width =
        left_margin + static_cast<double>(columns) * (panel_width + between_x) - 60.0;
    const double height = top + static_cast<double>(rows) * (panel_height + between_y);
    std::string svg = svg_head(width, height, 11.0) +
                      "<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n<text x=\"" +
                      px(left_margin) + "\" y=\"20\" font-size=\"14\">" + escaped(title()) +
                      "</text>\n";
    for (std::size_t i = 0; i < panels_.size(); ++i) {
      const std::size_t row = i / columns;
      svg += panel(panels_[i],
                   left_margin + static_cast<double>(i % columns) * (panel_width + between_x),
                   top + static_cast<double>(row) * (panel_height + between_y));
    }
    return svg + "</svg>\n";
  }

 private:
  std::string title() const {
    std::string text = table_.of + " over " + options_.swept[0].name;
    for (std::size_t i = 1; i < options_.swept.size(); ++i) {
      text += (i == 1 ? "; the darker, the more " : ", ") + options_.swept[i].name;
    }
    return text + (laws_.empty() ? "" : "; dashed: as it is said to be");
  }

  // What the panel shows of a row: the figure, or how many percent its law is more.
  static std::optional<double> value_of(const SweepPanel& panel, const SweepRow& row) {
    const std::optional<double> found = row.figures[panel.figure];
    return found && panel.law != nullptr
               ? std::optional(100.0 * (evaluate(panel.law->formula, row.at) / *found - 1.0))
               : found;
  }

  std::string panel(const SweepPanel& shown, double x, double y) const {
    const std::size_t figure = shown.figure;
    const bool has_laws = shown.law == nullptr;
    const SweptParameter& swept = options_.swept[0];
    const Axis across(std::min(swept.first, swept.last), std::max(swept.first, swept.last),
                      swept.by_ratios);
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    const auto reach = [&](double value) {
      low = std::isfinite(value) ? std::min(low, value) : low;
      high = std::isfinite(value) ? std::max(high, value) : high;
    };
    for (const SweepRow& row : table_.rows) {
      if (const auto value = value_of(shown, row)) {
        reach(*value);
      }
      for (const LawCurve& law : laws_) {
        if (has_laws && law.figure == figure) {
          reach(evaluate(law.formula, row.at));
        }
      }
    }
    const std::string& name = table_.names[figure];
    const std::string unit = name.ends_with("_hz") ? " in Hz" : name.ends_with("_s") ? " in s" : "";
    const std::string words = unit.empty() ? name : name.substr(0, name.rfind('_'));
    const std::string heading =
        has_laws ? words + unit : words + ": how far what is said is off, in %";
    std::string svg = label(x, y - 8.0, heading, "start") + box(x, y, panel_width, panel_height);
    if (!(high >= low)) {
      return svg + label(x + panel_width / 2, y + panel_height / 2, "it has none", "middle");
    }
    const bool is_wide_figure = is_wide(low, high);
    const double room = is_wide_figure ? 0.0 : 0.04 * (high - low);
    const Axis up(low - room, high + room, is_wide_figure);
    const auto px_of = [&](double at) { return x + panel_width * across.share(at); };
    const auto py_of = [&](double value) { return y + panel_height * (1.0 - up.share(value)); };
    for (const double mark : across.marks()) {
      svg += line(px_of(mark), y, px_of(mark), y + panel_height, grid_ink, "0.4") +
             label(px_of(mark), y + panel_height + 15.0, mark_text(mark), "middle");
    }
    for (const double mark : up.marks()) {
      svg += line(x, py_of(mark), x + panel_width, py_of(mark), grid_ink, "0.4") +
             label(x - 6.0, py_of(mark) + 3.5, mark_text(mark));
    }
    svg += label(x + panel_width, y + panel_height + 29.0, swept.name);
    for (std::size_t l = 0; l < lines_.size(); ++l) {
      const double share =
          lines_.size() > 1 ? static_cast<double>(l) / static_cast<double>(lines_.size() - 1) : 1.0;
      const auto path = [&](auto&& of_row) {
        std::string path;
        bool is_on = false;
        for (const SweepRow& row : table_.rows) {
          if (!std::equal(row.at.begin() + 1, row.at.end(), lines_[l].begin(), lines_[l].end())) {
            continue;
          }
          const std::optional<double> value = of_row(row);
          const bool is_there = value && std::isfinite(*value) && (!is_wide_figure || *value > 0.0);
          if (is_there) {
            path += (is_on ? "L" : "M") + px(px_of(row.at[0])) + " " + px(py_of(*value));
          }
          is_on = is_there;
        }
        return path.empty() ? std::string("M0 0") : path;
      };
      const auto drawn = [&](const std::string& points, const char* dashes) {
        return "<path d=\"" + points + "\" fill=\"none\" stroke=\"" + grey(share) +
               "\" stroke-width=\"1.5\"" + dashes + "/>\n";
      };
      svg += drawn(path([&](const SweepRow& row) { return value_of(shown, row); }), "");
      for (const LawCurve& law : laws_) {
        if (has_laws && law.figure == figure) {
          svg += drawn(path([&](const SweepRow& row) {
                         return std::optional(evaluate(law.formula, row.at));
                       }),
                       " stroke-dasharray=\"7 4\"");
        }
      }
    }
    return svg;
  }

  const SweepTable& table_;
  const DescribeOptions& options_;
  const std::vector<LawCurve>& laws_;
  std::vector<SweepPanel> panels_;
  std::vector<std::vector<double>> lines_;  // the values of all but the first that is swept
};

}  // namespace

Result<std::string> sweep_svg(const SweepTable& table, const DescribeOptions& options) {
  const auto number_of = [&](const std::string& name) -> Result<std::size_t> {
    const auto found = std::find(table.names.begin(), table.names.end(), name);
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
    if (options.figures.empty() &&
        std::find(wanted.begin(), wanted.end(), law.figure) == wanted.end()) {
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
  return SweepDrawer(table, options, figures, laws).draw();
}

}  // namespace ressort::commands
