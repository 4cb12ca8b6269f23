#include "app/commands/chart/picture/picture.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>

#include "app/commands/chart/picture/labels.h"
#include "app/text.h"

namespace ressort::commands {
namespace {

constexpr double deepest_db = -320.0;
constexpr double least_error = 1e-6;  // cents or percent; what is less is drawn here
constexpr double page_width = 960.0;  // pixels
constexpr double caption_height = 40.0;
constexpr double title_height = 46.0;
constexpr double legend_row_height = 21.0;
const char* const front_style = "lc rgb \"#c4c4c4\" lw 6";
const char* const floor_style = "dt 3 lw 1.4 lc rgb \"#606060\"";

// A glyph is a method, or this: a way that fails.
const char* const failed_style = "pt 2 ps 1.2 lw 2.4 lc rgb \"#b00000\"";

// Told apart by lightness and by their dashes where colours are not seen.
struct Look {
  const char* colour;
  const char* dashes;
};
const Look& look_of(Precision precision) {
  static const Look looks[] = {{"#000000", "1"}, {"#e69f00", "2"}, {"#0072b2", "4"}};
  return looks[precision == Precision::float64 ? 0 : precision == Precision::float32 ? 1 : 2];
}

std::string number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

// Open where the network is played as it is written, filled where a budget asked for more.
int glyph_of(const std::string& method, bool has_budget) {
  static const std::map<std::string, int> open = {
      {"direct", 6}, {"chains", 4}, {"modal", 12}, {"grid", 10}};
  const auto known = open.find(method);
  const int glyph = known == open.end() ? 3 : known->second;
  return glyph >= 4 && has_budget ? glyph + 1 : glyph;
}

std::string first_method(const ChartRow& row) {
  return row.methods.substr(0, row.methods.find('+'));
}

enum class Shows { cents, t60, physical, identical };

bool is_logarithmic(Shows shows) {
  return shows == Shows::cents || shows == Shows::t60;
}

// Where a panel's axes are in its picture, in pixels.
struct Frame {
  Box box;
  double width = page_width;  // of the whole picture
  double height = 0.0;
  bool has_left_title = true;
  bool has_bottom_title = true;
  bool has_labels = true;
  double glyph_size = 1.2;
};

// What one panel draws, as plot elements with their data inline.
class Panel {
 public:
  Panel(const ChartSheet& sheet, Shows shows, std::string name, std::string title, Frame frame)
      : sheet_(sheet),
        shows_(shows),
        name_(std::move(name)),
        title_(std::move(title)),
        frame_(std::move(frame)) {
    find_ranges();
  }

  std::string script() {
    draw_front();
    draw_lines();
    draw_spread();
    draw_glyphs();
    draw_failed();
    if (frame_.has_labels) {
      draw_labels();
    }
    return data_ + axes() + (plot_.empty() ? "plot NaN notitle" : plot_) + "\n";
  }

 private:
  std::size_t reference() const { return shows_ == Shows::identical ? 0 : 1; }

  double y_of(const ChartRow& row) const {
    if (is_logarithmic(shows_)) {
      const Against& physical = row.judged.physical;
      const double error = shows_ == Shows::cents ? physical.cents : physical.t60_percent;
      return std::isnan(error) ? error : std::max(error, least_error);
    }
    return std::clamp(-sheet_.snr_db(row, reference()), deepest_db, 0.0);
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
        right_ = std::max(right_, std::max(row.ns, row.upper_ns));
      }
      if (is_drawn(row)) {
        low = std::min(low, y_of(row));
        high = std::max(high, y_of(row));
      }
    }
    if (has_floor()) {
      low = std::min(low, -floor_db());
    }
    if (right_ <= 0.0) {  // nothing was timed
      left_ = 1.0;
      right_ = 1e3;
    }
    left_ *= 0.6;
    right_ *= 2.2;
    if (is_logarithmic(shows_)) {
      bottom_ = low < HUGE_VAL ? 0.3 * low : least_error;
      top_ = std::max(10.0, 4.0 * high);
    } else {
      top_ = 8.0;
      bottom_ = low < HUGE_VAL ? 20.0 * std::floor((low - 8.0) / 20.0) : -100.0;
    }
  }

  // How far the reference of a scene that is not linear is known.
  bool has_floor() const { return shows_ == Shows::physical && !sheet_.is_linear; }
  double floor_db() const { return sheet_.floor_db[sheet_.window]; }

  // --- data to pixels and back ---
  double x_share(double ns) const { return std::log(ns / left_) / std::log(right_ / left_); }
  double y_share(double y) const {
    return is_logarithmic(shows_) ? std::log(y / bottom_) / std::log(top_ / bottom_)
                                  : (y - bottom_) / (top_ - bottom_);
  }
  LabelRequest pixel_of(const ChartRow& row) const {
    const Box& box = frame_.box;
    return {box.left + x_share(row.ns) * (box.right - box.left),
            box.bottom + y_share(y_of(row)) * (box.top - box.bottom), row.way.label};
  }
  std::string data_at(double x, double y) const {
    const Box& box = frame_.box;
    const double across = (x - box.left) / (box.right - box.left);
    const double up = (y - box.bottom) / (box.top - box.bottom);
    return number(left_ * std::pow(right_ / left_, across)) + " " +
           number(is_logarithmic(shows_) ? bottom_ * std::pow(top_ / bottom_, up)
                                         : bottom_ + up * (top_ - bottom_));
  }

  void add(const std::string& points, const std::string& columns, const std::string& style) {
    const std::string block = "$" + name_ + std::to_string(count_++);
    data_ += block + " << EOD\n" + points + "EOD\n";
    plot_ += (plot_.empty() ? "plot " : ", \\\n  ") + block + " using " + columns + " with " +
             style + " notitle";
  }
  static std::string line_of(double x, double y) { return number(x) + " " + number(y) + "\n"; }

  void draw_front() {
    std::vector<std::pair<double, double>> front;
    for (const ChartRow& row : sheet_.rows) {
      if (row.is_on_front[reference()] && is_drawn(row) && !is_logarithmic(shows_)) {
        front.emplace_back(row.ns, y_of(row));
      }
    }
    if (!front.empty()) {
      std::sort(front.begin(), front.end());
      std::string points = line_of(front[0].first, top_);
      for (const auto& [ns, y] : front) {
        points += line_of(ns, y);
      }
      add(points + line_of(right_, front.back().second), "1:2",
          std::string("steps ") + front_style);
    }
    if (has_floor() && -floor_db() > bottom_) {
      add(line_of(left_, -floor_db()) + line_of(right_, -floor_db()), "1:2",
          std::string("lines ") + floor_style);
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
      const Look& look = look_of(line[0]->way.precision);
      add(points, "1:2",
          std::string("lines lw 1 dt ") + look.dashes + " lc rgb \"" + look.colour + "\"");
    }
  }

  // From the fastest to the upper quartile of the rounds.
  void draw_spread() {
    std::string points;
    for (const ChartRow& row : sheet_.rows) {
      if (is_drawn(row) && row.upper_ns > row.ns) {
        points += line_of(row.ns, y_of(row)) + line_of(row.upper_ns, y_of(row)) + "\n";
      }
    }
    if (!points.empty()) {
      add(points, "1:2", "lines lw 2.2 lc rgb \"#808080\"");
    }
  }

  void draw_glyphs() {
    std::map<std::pair<int, std::string>, std::string> glyphs;  // (glyph, colour) -> points
    for (const ChartRow& row : sheet_.rows) {
      if (is_drawn(row)) {
        glyphs[{glyph_of(first_method(row), !row.way.budget.empty()),
                look_of(row.way.precision).colour}] += line_of(row.ns, y_of(row));
      }
    }
    for (const auto& [glyph, points] : glyphs) {
      add(points, "1:2",
          "points pt " + std::to_string(glyph.first) + " ps " + number(frame_.glyph_size) +
              " lw 1.5 lc rgb \"" + glyph.second + "\"");
    }
  }

  void draw_labels() {
    std::vector<LabelRequest> marks;
    std::vector<LabelRequest> wanted;
    for (const ChartRow& row : sheet_.rows) {
      if (is_drawn(row)) {
        marks.push_back(pixel_of(row));
        if (!row.way.label.empty() && row.way.precision == Precision::float64) {
          wanted.push_back(marks.back());
        }
      }
    }
    std::string words;
    std::string leads;
    for (const PlacedLabel& label : place_labels(wanted, marks, frame_.box)) {
      const double x = 0.5 * (label.box.left + label.box.right);
      const double y = 0.5 * (label.box.bottom + label.box.top);
      words += data_at(x, y) + " \"" + label.text + "\"\n";
      if (label.is_apart) {
        const double near_x = std::clamp(label.from_x, label.box.left, label.box.right);
        const double near_y = std::clamp(label.from_y, label.box.bottom, label.box.top);
        leads += data_at(label.from_x, label.from_y) + "\n" + data_at(near_x, near_y) + "\n\n";
      }
    }
    if (!leads.empty()) {
      add(leads, "1:2", "lines lw 0.6 lc rgb \"#909090\"");
    }
    if (!words.empty()) {
      add(words, "1:2:3", "labels center font \"sans,8\" tc rgb \"#303030\"");
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
      add(points, "1:2", std::string("points ") + failed_style);
    }
  }

  std::string window() const {
    const double seconds = chart_windows_s[sheet_.window];
    return seconds < 1.0 ? number(1e3 * seconds) + " ms" : number(seconds) + " s";
  }

  std::string left_title() const {
    switch (shows_) {
      case Shows::cents:
        return "largest error of a partial (cents)";
      case Shows::t60:
        return "largest error of a decay T60 (%)";
      case Shows::physical:
      case Shows::identical:
        return "error below signal, first " + window() + " (dB)";
    }
    return "";
  }

  std::string axes() const {
    const Box& box = frame_.box;
    const auto title = [](const char* axis, const std::string& text) {
      return std::string("set ") + axis +
             (text.empty() ? "" : " \"" + text + "\" font \"sans,10\" noenhanced") + "\n";
    };
    return "set lmargin at screen " + number(box.left / frame_.width) + "\nset rmargin at screen " +
           number(box.right / frame_.width) + "\nset bmargin at screen " +
           number(box.bottom / frame_.height) + "\nset tmargin at screen " +
           number(box.top / frame_.height) + "\nset title \"" + title_ +
           "\" font \"sans,11\" noenhanced offset 0,-0.5\n" +
           "set logscale x\nunset logscale y\nset xrange [" + number(left_) + ":" + number(right_) +
           "]\nset yrange [" + number(bottom_) + ":" + number(top_) +
           "]\nset format x \"10^{%T}\"\nset format y " +
           (is_logarithmic(shows_) ? "\"10^{%T}\"\nset logscale y\n" : "\"%g\"\n") +
           title("xlabel", frame_.has_bottom_title ? "time per sample, one core (ns)" : "") +
           title("ylabel", frame_.has_left_title ? left_title() : "");
  }

  const ChartSheet& sheet_;
  Shows shows_;
  std::string name_;
  std::string title_;
  Frame frame_;
  double left_ = HUGE_VAL;
  double right_ = 0.0;
  double bottom_ = 0.0;
  double top_ = 0.0;
  int count_ = 0;
  std::string data_;
  std::string plot_;
};

struct LegendEntry {
  std::string style;
  std::string text;
};

// The glyphs, colours and lines that occur.
std::vector<LegendEntry> legend_of(const std::vector<const ChartSheet*>& sheets) {
  std::set<std::string> methods;
  std::set<Precision> precisions;
  bool has_budget = false;
  bool has_failed = false;
  bool has_floor = false;
  for (const ChartSheet* const sheet : sheets) {
    has_floor |= !sheet->is_linear;
    for (const ChartRow& row : sheet->rows) {
      methods.insert(first_method(row));
      precisions.insert(row.way.precision);
      has_budget |= !row.way.budget.empty();
      has_failed |= !row.failure.empty();
    }
  }
  const auto glyph = [](int number_of_it) {
    return "points ps 1.2 lw 1.5 lc rgb \"black\" pt " + std::to_string(number_of_it);
  };
  std::vector<LegendEntry> entries;
  for (const std::string& method : methods) {
    entries.push_back({glyph(glyph_of(method, false)), method});
  }
  if (has_budget) {
    entries.push_back({glyph(7), "filled: with a budget"});
  }
  for (const Precision precision : precisions) {
    const Look& look = look_of(precision);
    entries.push_back(
        {std::string("lines lw 3 dt ") + look.dashes + " lc rgb \"" + look.colour + "\"",
         precision_name(precision)});
  }
  entries.push_back({std::string("lines ") + front_style, "Pareto front"});
  entries.push_back({"lines lw 2.2 lc rgb \"#808080\"", "spread of the times"});
  if (has_floor) {
    entries.push_back({std::string("lines ") + floor_style, "reference known to here"});
  }
  if (has_failed) {
    entries.push_back({std::string("points ") + failed_style, "gains energy under stress"});
  }
  return entries;
}

constexpr std::size_t legend_columns = 3;  // as many as the longest entry leaves room for

double height_of(const std::vector<LegendEntry>& legend) {
  return legend_row_height * std::ceil(static_cast<double>(legend.size()) / legend_columns) + 16.0;
}

// In a band above the caption: a plot without axes.
std::string draw(const std::vector<LegendEntry>& legend, double whole_height) {
  std::string plot;
  for (const LegendEntry& entry : legend) {
    plot += (plot.empty() ? "plot " : ", \\\n  ") +
            ("NaN with " + entry.style + " title \"" + entry.text + "\"");
  }
  return "unset border\nunset tics\nset title\nset xlabel\nset ylabel\nunset logscale\n"
         "set xrange [0:1]\nset yrange [0:1]\nunset grid\nset lmargin at screen 0\n"
         "set rmargin at screen 1\nset bmargin at screen 0\nset tmargin at screen 1\n"
         "set key at screen 0.5, screen " +
         number((caption_height + height_of(legend) - 12.0) / whole_height) +
         " center top horizontal reverse Left samplen 2.2 width 1 maxcols " +
         std::to_string(legend_columns) + " spacing 1.1 font \"sans,10\" noenhanced\n" + plot +
         "\n";
}

const char* const begin_panel =
    "set border 3 lc rgb \"#404040\"\nset tics nomirror font \"sans,9\"\n"
    "set grid xtics ytics lt 1 lc rgb \"#e8e8e8\"\nunset key\n";

// Both kinds of file of one picture.
std::string twice(const std::string& name, double height, const std::string& body) {
  const std::string size = number(page_width) + "," + number(height);
  std::string script;
  for (const auto& [terminal, ending] :
       {std::pair("svg size " + size + " font \"sans,11\" background \"white\"", ".svg"),
        std::pair("pngcairo size " + size + " font \"sans,10\" background \"white\"", ".png")}) {
    script += "reset\nset terminal " + terminal + "\nset output \"" + name + ending + "\"\n" +
              body + "unset multiplot\nset output\n";
  }
  return script + "\n";
}

std::string begin_picture(const std::string& title, const std::string& caption,
                          double whole_height) {
  return "set multiplot title \"" + title + "\" font \"sans,12\" noenhanced\nset label 1 \"" +
         caption + "\" at screen 0.01, screen " + number((caption_height - 12.0) / whole_height) +
         " left font \"sans,8\" noenhanced tc rgb " + "\"#404040\"\n";
}

// The caption belongs to the picture, not to each of its panels.
const char* const end_caption = "unset label 1\n";

std::string caption_of(const Provenance& provenance, int rounds) {
  return to_string(provenance) + ".\\nTimes: of each stretch of sound the fastest of " +
         std::to_string(rounds) + " rounds; the grey bar ends at the rounds' upper quartile.";
}

std::string picture_of(const ChartSheet& sheet, const Provenance& provenance) {
  std::vector<std::pair<Shows, std::string>> panels = {
      {Shows::physical, "against the continuous network"},
      {Shows::identical, "against the published scheme"}};
  if (sheet.is_linear) {
    panels.insert(panels.begin(), {{Shows::cents, "pitch, against the continuous network"},
                                   {Shows::t60, "decay, against the continuous network"}});
  }
  constexpr double height = 330.0;
  constexpr double width = page_width / 2.0;
  const std::vector<LegendEntry> legend = legend_of({&sheet});
  const double foot = caption_height + height_of(legend);
  const std::size_t rows = (panels.size() + 1) / 2;
  const double whole = title_height + static_cast<double>(rows) * height + foot;
  std::string body =
      begin_picture(sheet.scene + ": " + sheet.about, caption_of(provenance, sheet.rounds), whole);
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const std::size_t row = i / 2;
    const double left = static_cast<double>(i % 2) * width;
    const double top = whole - title_height - static_cast<double>(row) * height;
    const Frame frame{.box = {left + 66.0, left + width - 16.0, top - height + 52.0, top - 26.0},
                      .height = whole};
    body += begin_panel +
            Panel(sheet, panels[i].first, "p" + std::to_string(i) + "_", panels[i].second, frame)
                .script() +
            (i == 0 ? end_caption : "");
  }
  return twice(sheet.scene, whole, body + draw(legend, whole));
}

std::string overview_of(const std::vector<ChartSheet>& sheets, const Provenance& provenance) {
  constexpr std::size_t columns = 3;
  constexpr double width = page_width / columns;
  constexpr double height = 250.0;
  std::vector<const ChartSheet*> all;
  int rounds = 0;
  for (const ChartSheet& sheet : sheets) {
    all.push_back(&sheet);
    rounds = all.size() == 1 ? sheet.rounds : std::min(rounds, sheet.rounds);
  }
  const std::vector<LegendEntry> legend = legend_of(all);
  const std::size_t rows = (sheets.size() + columns - 1) / columns;
  const double whole =
      title_height + static_cast<double>(rows) * height + caption_height + height_of(legend);
  std::string body = begin_picture("Error against the continuous network, and what it costs",
                                   caption_of(provenance, rounds), whole);
  for (std::size_t i = 0; i < sheets.size(); ++i) {
    const std::size_t row = i / columns;
    const double left = static_cast<double>(i % columns) * width;
    const double top = whole - title_height - static_cast<double>(row) * height;
    const Frame frame{.box = {left + 64.0, left + width - 6.0, top - height + 46.0, top - 24.0},
                      .height = whole,
                      .has_left_title = i % columns == 0,
                      .has_bottom_title = i + columns >= sheets.size(),
                      .has_labels = false,
                      .glyph_size = 0.8};
    body += begin_panel +
            Panel(sheets[i], Shows::physical, "o" + std::to_string(i) + "_", sheets[i].scene, frame)
                .script() +
            (i == 0 ? end_caption : "");
  }
  return twice("overview", whole, body + draw(legend, whole));
}

}  // namespace

std::string chart_script(const std::vector<ChartSheet>& sheets, const Provenance& provenance) {
  std::string script =
      "# Draws the pictures beside it: gnuplot chart.gp. The data are those of chart.csv.\n";
  for (const ChartSheet& sheet : sheets) {
    script += picture_of(sheet, provenance);
  }
  return script + overview_of(sheets, provenance);
}

}  // namespace ressort::commands
