#include "app/plot/plot.h"

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string_view>

#include "core/ranges.h"

namespace ressort::plot {
namespace {

constexpr double title_height = 34.0;  // pixels, as all below
constexpr double caption_line = 13.0;
constexpr double legend_line = 20.0;

// Edges of a panel's axes, counted from the panel's own edges.
struct Margins {
  double left = 66.0;
  double right = 18.0;
  double top = 32.0;
  double bottom = 42.0;
};

Margins margins_of(const Panel& panel) {
  if (!panel.has_axes) {
    return {6.0, 6.0, panel.title.empty() ? 6.0 : 26.0, 6.0};
  }
  Margins margins;
  margins.right = panel.scale_title.empty() && !panel.has_room_for_scale ? 18.0 : 74.0;
  margins.left = panel.left_margin > 0.0 ? panel.left_margin : panel.y.title.empty() ? 46.0 : 66.0;
  margins.bottom = panel.x.title.empty() ? 26.0 : 42.0;
  return margins;
}

// Quotes a text for gnuplot, which runs backquoted commands in double quotes but not in single
// ones.
std::string quoted(const std::string& text) {
  std::string safe = "'";
  for (const char c : text) {
    safe += c == '\'' ? "''" : c == '\n' ? " " : std::string(1, c);
  }
  return safe + "'";
}

const char* palette_of(ColourMap map) {
  return map == ColourMap::heat  // after matplotlib's "magma", reversed
             ? "set palette defined (0 '#fcf6ce', 1 '#fece91', 2 '#f88961', 3 '#d3436e', 4 "
               "'#822581', "
               "5 '#370f5c')\n"
             : "set palette defined (0 '#ffffff', 1 '#000000')\n";
}

// Ticks at 1, 2 and 5 of every decade in the range.
std::vector<double> logarithmic_ticks(double from, double to) {
  std::vector<double> ticks;
  for (double decade = std::pow(10.0, std::floor(std::log10(from))); decade <= to; decade *= 10.0) {
    for (const double digit : {1.0, 2.0, 5.0}) {
      const double at = decade * digit;
      if (at >= from * (1.0 - 1e-9) && at <= to * (1.0 + 1e-9)) {
        ticks.push_back(at);
      }
    }
  }
  return ticks;
}

std::string commands_of(const std::string& name, const Axis& axis, bool has_axes) {
  const bool has_range = axis.from != axis.to;
  std::string text =
      "set " + name + "label " + quoted(axis.title) + " noenhanced" +
      (name == "x" ? " offset 0,0.9\n" : " offset 0.8,0\n") +
      (axis.is_logarithmic ? "set" : "unset") + " logscale " + name + "\nset " + name + "range " +
      (has_range ? "[" + number(axis.from) + ":" + number(axis.to) + "]" : "[*:*]") + "\n";
  if (!has_axes) {
    return text + "unset " + name + "tics\n";
  }
  text += "set " + name + "tics nomirror out scale 0.5 font 'sans,9' " +
          (name == "x" ? "offset 0,0.4 " : "offset 0.5,0 ");
  std::vector<Tick> ticks = axis.ticks;
  if (ticks.empty() && axis.is_logarithmic && has_range && axis.to < 3e3 * axis.from) {
    for (const double at : logarithmic_ticks(axis.from, axis.to)) {
      ticks.push_back({at, number(at)});
    }
  }
  if (ticks.size() < 2) {
    return text + "autofreq\nset format " + name +
           (axis.is_logarithmic ? " '10^{%T}'\n" : " '%g'\n");
  }
  const auto print = [](const Tick& tick) { return quoted(tick.text) + " " + number(tick.at); };
  return text + "(" + joined(ticks, ", ", print) + ") noenhanced\n";
}

// Rectangle of a panel, in pixels from the figure's lower left corner.
struct Place {
  double left = 0.0;
  double bottom = 0.0;
  double width = 0.0;
  double height = 0.0;
};

// Widens one range, so that a unit is as long in both directions.
void make_true(Axis& x, Axis& y, double width, double height) {
  const double unit = std::max((x.to - x.from) / width, (y.to - y.from) / height);
  for (const auto& [axis, length] : {std::pair(&x, width), std::pair(&y, height)}) {
    const double middle = 0.5 * (axis->from + axis->to);
    axis->from = middle - 0.5 * unit * length;
    axis->to = middle + 0.5 * unit * length;
  }
}

class ScriptWriter {
 public:
  explicit ScriptWriter(const Figure& figure) : figure_(figure) {
    width_ = static_cast<double>(
                 std::min(figure.columns, std::max<std::size_t>(1, figure.panels.size()))) *
             figure.panel_width;
    for (std::size_t i = 0; i < figure.panels.size(); i += figure.columns) {
      panels_height_ += height_of_row(i);
    }
    if (!figure.legend.empty()) {
      const std::size_t lines =
          (figure.legend.size() + figure.legend_columns - 1) / figure.legend_columns;
      legend_height_ = legend_line * static_cast<double>(lines) + 12.0;
    }
    if (!figure.caption.empty()) {
      const auto lines = 1 + std::ranges::count(figure.caption, '\n');
      caption_height_ = caption_line * static_cast<double>(lines) + 12.0;
    }
    height_ = (figure.title.empty() ? 0.0 : title_height) + panels_height_ + legend_height_ +
              caption_height_;
  }

  std::string write(Format format) {
    const std::string terminal = format == Format::svg ? "svg" : "pngcairo";
    script_ = "set encoding utf8\nset terminal " + terminal + " size " + number(width_) + "," +
              number(height_) +
              " font 'sans,11' background 'white'\nset multiplot\nset errorbars 0\n";
    if (!figure_.title.empty()) {
      script_ += "set label 1 " + quoted(figure_.title) + " at screen 0.5, screen " +
                 number(1.0 - 18.0 / height_) + " center font 'sans,14' noenhanced\n";
    }
    std::size_t start = 0;
    std::size_t line = 0;
    std::string rest = figure_.caption;
    while (!figure_.caption.empty() && start <= rest.size()) {
      const std::size_t end = std::min(rest.size(), rest.find('\n', start));
      script_ +=
          "set label " + std::to_string(line + 2) + " " + quoted(rest.substr(start, end - start)) +
          " at screen 0.01, screen " +
          number((caption_height_ - 12.0 - caption_line * static_cast<double>(line)) / height_) +
          " left font 'sans,9' noenhanced tc rgb '#404040'\n";
      start = end + 1;
      ++line;
    }
    Place place{.bottom = legend_height_ + caption_height_ + panels_height_,
                .width = figure_.panel_width};
    for (std::size_t i = 0; i < figure_.panels.size(); ++i) {
      if (i % figure_.columns == 0) {
        place.height = height_of_row(i);
        place.bottom -= place.height;
      }
      place.left = static_cast<double>(i % figure_.columns) * figure_.panel_width;
      write(figure_.panels[i], place);
    }
    if (!figure_.legend.empty()) {
      write_legend();
    }
    return script_ + "unset multiplot\n";
  }

 private:
  double height_of_row(std::size_t first) const {
    const double own = figure_.panels[first].height;
    return own > 0.0 ? own : figure_.panel_height;
  }

  void write_edges(double left, double right, double bottom, double top) {
    script_ += "set lmargin at screen " + number(left / width_) + "\nset rmargin at screen " +
               number(right / width_) + "\nset bmargin at screen " + number(bottom / height_) +
               "\nset tmargin at screen " + number(top / height_) + "\n";
  }

  void write(const Panel& panel, const Place& place) {
    const Margins margins = margins_of(panel);
    const double width = place.width - margins.left - margins.right;
    const double height = place.height - margins.top - margins.bottom;
    Axis x = panel.x;
    Axis y = panel.y;
    if (panel.is_true) {
      make_true(x, y, width, height);
    }
    if (panel.is_solid) {
      // An orthographic view from above and the side.
      script_ += "set origin " + number(place.left / width_) + "," +
                 number(place.bottom / height_) + "\nset size " + number(place.width / width_) +
                 "," + number(place.height / height_) +
                 "\nset lmargin 0\nset rmargin 0\nset bmargin 0\nset tmargin 0\n"
                 "set view 60,35,2.6\nset view equal xyz\nset xyplane at " +
                 number(panel.x.from) +
                 "\n"
                 "set pm3d depthorder corners2color mean\nset zrange [" +
                 number(panel.x.from) + ":" + number(panel.x.to) + "]\nunset ztics\n";
    } else {
      write_edges(place.left + margins.left, place.left + place.width - margins.right,
                  place.bottom + margins.bottom, place.bottom + place.height - margins.top);
    }
    const bool has_key = std::ranges::any_of(
        panel.series, [](const Series& series) { return !series.title.empty(); });
    script_ +=
        "set title " + quoted(panel.title) + " font 'sans,11' noenhanced offset 0,-0.6\n" +
        commands_of("x", x, panel.has_axes) + commands_of("y", y, panel.has_axes) +
        (panel.has_axes ? "set border 3 lc rgb '#404040'\nset grid lt 1 lc rgb '#e4e4e4'\n"
                        : "unset border\nunset grid\n") +
        (has_key ? "set key top right opaque reverse Left noenhanced font 'sans,9' samplen 3\n"
                 : "unset key\n");
    if (panel.colours != ColourMap::none) {
      script_ += palette_of(panel.colours) + ("set cbrange [" + number(panel.lightest)) + ":" +
                 number(panel.darkest) + "]\n";
    }
    script_ += panel.scale_title.empty() ? std::string("unset colorbox\n")
                                         : "set colorbox\nset cbtics font 'sans,9'\nset cblabel " +
                                               quoted(panel.scale_title) + "\n";
    if (!panel.note.empty()) {
      script_ +=
          "set label 99 " + quoted(panel.note) + " at graph 0.5, graph 0.5 center noenhanced\n";
    }
    const std::string data = write_data(panel.series);
    script_ += data.empty() ? (panel.is_solid ? "splot" : "plot") + std::string(" NaN notitle\n")
                            : (panel.is_solid ? "splot " : "plot ") + data + "\n";
    // The title and the caption belong to the figure, not to each of its panels.
    script_ += "unset label\n";
  }

  std::string write_data(const std::vector<Series>& all) {
    std::string plot;
    for (const Series& series : all) {
      const std::string block = "$d" + std::to_string(blocks_++);
      script_ += block + " << EOD\n" + series.data + "EOD\n";
      plot += (plot.empty() ? "" : ", ") + block + (series.is_matrix ? " matrix" : "") + " using " +
              series.columns + " with " + series.style +
              (series.title.empty() ? " notitle" : " title " + quoted(series.title));
    }
    return plot;
  }

  // Draws a plot without axes, of which only the key is visible.
  void write_legend() {
    write_edges(0.0, width_, 0.0, height_);
    script_ +=
        "set title\nset xlabel\nset ylabel\nunset logscale\nset xrange [0:1]\nset yrange [0:1]\n"
        "unset border\nunset tics\nunset grid\nunset colorbox\nset key at screen 0.5, screen " +
        number((caption_height_ + legend_height_ - 2.0) / height_) +
        " center top horizontal reverse Left samplen 2.2 width 1 maxcols " +
        std::to_string(figure_.legend_columns) + " spacing 1.1 font 'sans,10' noenhanced\n";
    std::string plot;
    for (const Series& entry : figure_.legend) {
      plot += (plot.empty() ? "plot " : ", ") + ("NaN with " + entry.style) + " title " +
              quoted(entry.title);
    }
    script_ += plot + "\n";
  }

  const Figure& figure_;
  double width_ = 0.0;  // pixels, as all heights
  double height_ = 0.0;
  double panels_height_ = 0.0;
  double legend_height_ = 0.0;
  double caption_height_ = 0.0;
  std::size_t blocks_ = 0;
  std::string script_;
};

// A file for gnuplot's commands; gone with this object.
class ScriptFile {
 public:
  explicit ScriptFile(const std::string& script) {
    std::error_code error;
    path_ = (std::filesystem::temp_directory_path(error) / "ressort-plot-XXXXXX").string();
    const int descriptor = error ? -1 : mkstemp(path_.data());
    FILE* const file = descriptor < 0 ? nullptr : fdopen(descriptor, "w");
    is_written_ =
        file != nullptr && std::fwrite(script.data(), 1, script.size(), file) == script.size();
    is_written_ = file != nullptr && std::fclose(file) == 0 && is_written_;
  }
  ScriptFile(const ScriptFile&) = delete;
  ScriptFile& operator=(const ScriptFile&) = delete;
  ~ScriptFile() { unlink(path_.c_str()); }
  bool is_written() const { return is_written_; }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  bool is_written_ = false;
};

}  // namespace

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return std::isfinite(value) ? text : "NaN";
}

std::string row(std::initializer_list<double> values) {
  return joined(values, " ", number) + "\n";
}

std::string row(std::initializer_list<double> values, const std::string& text) {
  std::string line = row(values);
  line.back() = ' ';
  std::string plain = text;
  std::replace(plain.begin(), plain.end(), '"', '\'');
  std::replace(plain.begin(), plain.end(), '\n', ' ');
  return line + "\"" + plain + "\"\n";
}

Axis frequency_axis(double from_hz, double to_hz) {
  Axis axis{.title = "Hz", .from = from_hz, .to = to_hz, .is_logarithmic = true};
  for (const double hz : logarithmic_ticks(from_hz, to_hz)) {
    axis.ticks.push_back({hz, hz < 1000.0 ? number(hz) : number(hz / 1000.0) + "k"});
  }
  return axis;
}

std::string to_script(const Figure& figure, Format format) {
  return ScriptWriter(figure).write(format);
}

Result<Done> check_gnuplot() {
  return std::system("command -v gnuplot >/dev/null 2>&1") == 0
             ? Result<Done>(Done{})
             : Error{
                   "gnuplot, which draws the figures, is not installed; install the package "
                   "gnuplot-nox"};
}

Result<std::string> draw(const Figure& figure, Format format) {
  if (auto found = check_gnuplot(); !found) {
    return found.error();
  }
  const ScriptFile script(to_script(figure, format));
  FILE* const gnuplot =
      script.is_written() ? popen(("gnuplot '" + script.path() + "'").c_str(), "r") : nullptr;
  if (gnuplot == nullptr) {
    return Error{"gnuplot cannot be started: '" + script.path() + "' cannot be written"};
  }
  std::string picture;
  std::array<char, 65536> buffer{};
  while (const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), gnuplot)) {
    picture.append(buffer.data(), count);
  }
  const std::string_view end = format == Format::svg ? "</svg>\n\n" : "IEND\xae\x42\x60\x82";
  if (pclose(gnuplot) != 0 || !picture.ends_with(end)) {
    return Error{"gnuplot failed to draw the figure"};
  }
  return picture;
}

std::string escaped(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    safe += c == '&'   ? "&amp;"
            : c == '<' ? "&lt;"
            : c == '>' ? "&gt;"
            : c == '"' ? "&quot;"
                       : std::string(1, c);
  }
  return safe;
}

}  // namespace ressort::plot
