#include "app/commands/chart/picture.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <set>

namespace ressort {
namespace {

constexpr double deepest_db = -320.0;
constexpr double least_cents = 1e-6;  // what is less is drawn here
const char* const precision_colours[] = {"#1f4e9c", "#e07b00", "#2a8f3c", "#8a3fa0"};
const char* const front_style = "lc rgb \"#b8b8b8\" lw 5";
const char* const failed_style = "pt 2 ps 1.3 lw 2.2 lc rgb \"#d00000\"";

std::string number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.5g", value);
  return text;
}

// Open where the network is played as it is written, filled where a budget asked for more.
int mark_of(const std::string& method, bool has_budget) {
  static const std::map<std::string, int> open = {{"direct", 6}, {"chains", 4}, {"dense", 8},
                                                  {"modal", 12}, {"grid", 10},  {"fourth", 14},
                                                  {"chorus", 1}, {"slow", 2}};
  const auto known = open.find(method);
  const int mark = known == open.end() ? 14 : known->second;
  return mark >= 4 && has_budget ? mark + 1 : mark;
}

std::string first_method(const ChartRow& row) {
  return row.methods.substr(0, row.methods.find('+'));
}

std::string colour_of(Precision precision) {
  return precision_colours[static_cast<std::size_t>(precision == Precision::float64   ? 0
                                                    : precision == Precision::float32 ? 1
                                                                                      : 2)];
}

struct Point {
  double ns = 0.0;
  double y = 0.0;
};

// What one panel draws, as plot elements with their data inline.
class Panel {
 public:
  enum class Shows { identical, physical, cents };

  Panel(const ChartSheet& sheet, Shows shows, std::string name, bool is_small)
      : sheet_(sheet), shows_(shows), name_(std::move(name)), is_small_(is_small) {
    find_ranges();
  }

  std::string script() {
    draw_front();
    draw_lines();
    draw_marks();
    draw_labels();
    draw_failed();
    return data_ + axes() + plot_ + "\n";
  }

 private:
  std::size_t truth() const { return shows_ == Shows::identical ? 0 : 1; }

  double y_of(const ChartRow& row) const {
    if (shows_ == Shows::cents) {
      const double cents = row.judged.physical.cents;
      return std::isnan(cents) ? cents : std::max(cents, least_cents);
    }
    return std::clamp(-sheet_.snr_db(row, truth()), deepest_db, 0.0);
  }
  bool is_drawn(const ChartRow& row) const {
    return row.failure.empty() && std::isfinite(y_of(row)) && row.ns > 0.0;
  }

  void find_ranges() {
    double low = HUGE_VAL;
    double high = -HUGE_VAL;
    for (const ChartRow& row : sheet_.rows) {
      if (row.ns > 0.0) {
        left_ = std::min(left_, row.ns);
        right_ = std::max(right_, row.ns);
      }
      if (is_drawn(row)) {
        low = std::min(low, y_of(row));
        high = std::max(high, y_of(row));
      }
    }
    if (shows_ == Shows::physical && !sheet_.is_linear) {
      low = std::min(low, -sheet_.floor_db[sheet_.window]);
    }
    left_ *= 0.6;
    right_ *= 2.2;
    if (shows_ == Shows::cents) {
      bottom_ = low < HUGE_VAL ? 0.3 * low : least_cents;
      top_ = std::max(10.0, 4.0 * high);
    } else {
      top_ = 8.0;
      bottom_ = low < HUGE_VAL ? 20.0 * std::floor((low - 8.0) / 20.0) : -100.0;
    }
  }

  void add(const std::string& points, const std::string& style) {
    const std::string block = "$" + name_ + std::to_string(count_++);
    data_ += block + " << EOD\n" + points + "EOD\n";
    plot_ += (plot_.empty() ? "plot " : ", \\\n  ") + block + " using 1:2" + style + " notitle";
  }
  static std::string line_of(double x, double y) { return number(x) + " " + number(y) + "\n"; }

  void draw_front() {
    std::vector<Point> front;
    for (const ChartRow& row : sheet_.rows) {
      if (row.is_on_front[truth()] && is_drawn(row) && shows_ != Shows::cents) {
        front.push_back({row.ns, y_of(row)});
      }
    }
    if (!front.empty()) {
      std::sort(front.begin(), front.end(),
                [](const Point& a, const Point& b) { return a.ns < b.ns; });
      std::string points = line_of(front[0].ns, top_);
      for (const Point& point : front) {
        points += line_of(point.ns, point.y);
      }
      add(points + line_of(right_, front.back().y), std::string(" with steps ") + front_style);
    }
    const double floor = sheet_.floor_db[sheet_.window];
    if (shows_ == Shows::physical && !sheet_.is_linear && -floor > bottom_) {
      add(line_of(left_, -floor) + line_of(right_, -floor),
          " with lines dt 3 lw 1.2 lc rgb \"#606060\"");
    }
  }

  // Rows of one line and precision, in the order of the table.
  std::vector<std::vector<const ChartRow*>> lines() const {
    std::vector<std::vector<const ChartRow*>> all;
    std::map<std::pair<std::string, int>, std::size_t> known;
    for (const ChartRow& row : sheet_.rows) {
      if (is_drawn(row)) {
        const auto key = std::pair(row.way.line, static_cast<int>(row.way.precision));
        const auto [entry, is_new] = known.try_emplace(key, all.size());
        if (is_new) {
          all.emplace_back();
        }
        all[entry->second].push_back(&row);
      }
    }
    return all;
  }

  void draw_lines() {
    for (const auto& line : lines()) {
      if (line.size() < 2) {
        continue;
      }
      std::string points;
      for (const ChartRow* const row : line) {
        points += line_of(row->ns, y_of(*row));
      }
      add(points, " with lines lw 1 lc rgb \"" + colour_of(line[0]->way.precision) + "\"");
    }
  }

  void draw_marks() {
    std::map<std::pair<int, std::string>, std::string> marks;  // (mark, colour) -> points
    for (const ChartRow& row : sheet_.rows) {
      if (is_drawn(row)) {
        marks[{mark_of(first_method(row), !row.way.budget.empty()),
               colour_of(row.way.precision)}] += line_of(row.ns, y_of(row));
      }
    }
    for (const auto& [mark, points] : marks) {
      add(points, " with points pt " + std::to_string(mark.first) + " ps " +
                      (is_small_ ? "0.9" : "1.3") + " lw 1.6 lc rgb \"" + mark.second + "\"");
    }
  }

  void draw_labels() {
    std::string points;
    for (const ChartRow& row : sheet_.rows) {
      if (is_drawn(row) && !row.way.label.empty() && row.way.precision == Precision::float64) {
        points += number(row.ns) + " " + number(y_of(row)) + " \"" + row.way.label + "\"\n";
      }
    }
    if (!points.empty() && !is_small_) {
      add(points, ":3 with labels left offset 0.7,0.35 font \"sans,8\" tc rgb \"#505050\"");
    }
  }

  void draw_failed() {
    std::string points;
    for (const ChartRow& row : sheet_.rows) {
      if (!row.failure.empty() && row.ns > 0.0) {
        points += line_of(row.ns, top_);
      }
    }
    if (!points.empty()) {
      add(points, std::string(" with points ") + failed_style);
    }
  }

  std::string title() const {
    if (is_small_) {
      return sheet_.scene;
    }
    return shows_ == Shows::identical  ? "beside the published scheme (T1)"
           : shows_ == Shows::physical ? "beside the continuous network (T2)"
                                       : "pitch beside the continuous network";
  }

  std::string window() const {
    const double seconds = chart_windows_s[sheet_.window];
    return seconds < 1.0 ? number(1e3 * seconds) + " ms" : number(seconds) + " s";
  }

  std::string axes() const {
    std::string tics;
    for (double voices = 1e7; voices >= 0.1; voices /= 10.0) {
      const double ns = 1e9 / 48000.0 / voices;
      if (ns > left_ && ns < right_) {
        tics += (tics.empty() ? "" : ", ") + ("\"" + number(voices) + "\" " + number(ns));
      }
    }
    const std::string y_label = shows_ == Shows::cents
                                    ? "largest error of a partial, cents"
                                    : "error below signal, first " + window() + ", dB";
    return "set title \"" + title() + "\" noenhanced offset 0," + (is_small_ ? "-0.4" : "0.6") +
           "\nset logscale x\nset logscale x2\nunset logscale y\nset xrange [" + number(left_) +
           ":" + number(right_) + "]\nset x2range [" + number(left_) + ":" + number(right_) +
           "]\nset yrange [" + number(bottom_) + ":" + number(top_) + "]\nset format y " +
           (shows_ == Shows::cents ? "\"10^{%T}\"\nset logscale y\n" : "\"%g\"\n") +
           "set x2tics (" + tics + ")\n" +
           (is_small_ ? "unset x2tics\nset xlabel\nset ylabel\nset x2label\n"
                      : "set xlabel \"ns of one core per output sample\"\n"
                        "set x2label \"voices that one core holds at 48 kHz\" offset 0,-0.4\n"
                        "set ylabel \"" +
                            y_label + "\"\n");
  }

  const ChartSheet& sheet_;
  Shows shows_;
  std::string name_;
  bool is_small_;
  double left_ = HUGE_VAL;
  double right_ = 0.0;
  double bottom_ = 0.0;
  double top_ = 0.0;
  int count_ = 0;
  std::string data_;
  std::string plot_;
};

// The marks and colours that occur, in place of a panel.
std::string legend(const std::vector<const ChartSheet*>& sheets) {
  std::set<std::string> methods;
  std::set<int, std::greater<>> precisions;
  bool has_budget = false;
  bool has_failed = false;
  bool has_floor = false;
  for (const ChartSheet* const sheet : sheets) {
    has_floor |= !sheet->is_linear;
    for (const ChartRow& row : sheet->rows) {
      methods.insert(first_method(row));
      precisions.insert(static_cast<int>(row.way.precision));
      has_budget |= !row.way.budget.empty();
      has_failed |= !row.failure.empty();
    }
  }
  std::string plot;
  const auto add = [&](const std::string& style, const std::string& title) {
    plot +=
        (plot.empty() ? "plot " : ", \\\n  ") + ("NaN with " + style + " title \"") + title + "\"";
  };
  for (const std::string& method : methods) {
    add("points ps 1.3 lw 1.6 lc rgb \"black\" pt " + std::to_string(mark_of(method, false)),
        method);
  }
  if (has_budget) {
    add("points ps 1.3 lw 1.6 lc rgb \"black\" pt 7", "filled: by a budget");
  }
  for (const int precision : precisions) {
    const auto kind = static_cast<Precision>(precision);
    add("lines lw 4 lc rgb \"" + colour_of(kind) + "\"", precision_name(kind));
  }
  add(std::string("lines ") + front_style, "Pareto front");
  if (has_floor) {
    add("lines dt 3 lw 1.2 lc rgb \"#606060\"", "truth agrees with itself");
  }
  if (has_failed) {
    add(std::string("points ") + failed_style, "unstable or not passive");
  }
  return "unset border\nunset tics\nset title\nset xlabel\nset ylabel\nset x2label\n"
         "unset logscale\nset xrange [0:1]\nset yrange [0:1]\nunset grid\n"
         "set key at screen LEGEND_X, screen LEGEND_Y left top reverse Left samplen 1.6 "
         "spacing 1.25 noenhanced\n" +
         plot + "\n";
}

const char* const begin_panel =
    "set border 31 lc rgb \"#404040\"\nset tics nomirror\nset grid xtics ytics lt 1 lc rgb "
    "\"#e4e4e4\"\n"
    "unset key\n";

std::string margins(double left, double right, double bottom, double top) {
  return "set lmargin at screen " + number(left) + "\nset rmargin at screen " + number(right) +
         "\nset bmargin at screen " + number(bottom) + "\nset tmargin at screen " + number(top) +
         "\n";
}

std::string with_place(std::string text, double x, double y) {
  for (const auto& [word, value] : {std::pair(std::string("LEGEND_X"), x), {"LEGEND_Y", y}}) {
    text.replace(text.find(word), word.size(), number(value));
  }
  return text;
}

// Both kinds of file of one picture.
std::string twice(const std::string& name, int width, int height, const std::string& body) {
  const std::string size = std::to_string(width) + "," + std::to_string(height);
  return "reset\nset terminal svg size " + size + " font \"sans,12\" background \"white\"\n" +
         "set output \"" + name + ".svg\"\n" + body + "unset multiplot\nset output\n" +
         "reset\nset terminal pngcairo size " + size + " font \"sans,11\" background \"white\"\n" +
         "set output \"" + name + ".png\"\n" + body + "unset multiplot\nset output\n\n";
}

std::string picture_of(const ChartSheet& sheet, const std::string& machine) {
  using Shows = Panel::Shows;
  std::vector<Shows> panels = {Shows::physical, Shows::identical};
  if (sheet.is_linear) {
    panels.insert(panels.begin() + 1, Shows::cents);
  }
  const double width = 440.0;
  const double legend_width = 250.0;
  const double count = static_cast<double>(panels.size());
  const double whole = count * width + legend_width;
  std::string body = "set multiplot title \"" + sheet.scene + ": " + sheet.about + " (" + machine +
                     ")\" noenhanced\n";
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const double left = static_cast<double>(i) * width;
    body += begin_panel +
            margins((left + 72.0) / whole, (left + width - 14.0) / whole, 0.12, 0.78) +
            Panel(sheet, panels[i], "p" + std::to_string(i) + "_", false).script();
  }
  body += with_place(legend({&sheet}), (count * width + 10.0) / whole, 0.8);
  return twice(sheet.scene, static_cast<int>(whole), 520, body);
}

std::string overview_of(const std::vector<ChartSheet>& sheets, const std::string& machine) {
  constexpr std::size_t columns = 4;
  const std::size_t rows = sheets.size() / columns + 1;  // one place for the legend
  const double width = 370.0;
  const double height = 280.0;
  const double whole_width = width * static_cast<double>(std::min(columns, sheets.size() + 1));
  const double head = 60.0;
  const double whole_height = height * static_cast<double>(rows) + head;
  std::string body =
      "set multiplot title \"Error below signal beside the continuous network, dB, "
      "over ns of one core per output sample (" +
      machine + ")\" noenhanced\n";
  std::vector<const ChartSheet*> all;
  const auto corner = [&](std::size_t i) {
    const std::size_t row = i / columns;
    return std::pair(static_cast<double>(i % columns) * width,
                     whole_height - head - static_cast<double>(row) * height);
  };
  for (std::size_t i = 0; i < sheets.size(); ++i) {
    const auto [left, top] = corner(i);
    all.push_back(&sheets[i]);
    body += begin_panel +
            margins((left + 48.0) / whole_width, (left + width - 14.0) / whole_width,
                    (top - height + 34.0) / whole_height, (top - 26.0) / whole_height) +
            Panel(sheets[i], Panel::Shows::physical, "o" + std::to_string(i) + "_", true).script();
  }
  const auto [left, top] = corner(sheets.size());
  body += with_place(legend(all), (left + 40.0) / whole_width, (top - 20.0) / whole_height);
  return twice("overview", static_cast<int>(whole_width), static_cast<int>(whole_height), body);
}

}  // namespace

std::string chart_script(const std::vector<ChartSheet>& sheets, const std::string& machine) {
  std::string script =
      "# Draws the pictures beside it: gnuplot chart.gp. The data are those of chart.csv.\n";
  for (const ChartSheet& sheet : sheets) {
    script += picture_of(sheet, machine);
  }
  return script + overview_of(sheets, machine);
}

}  // namespace ressort
