#include <algorithm>
#include <cmath>

#include "app/commands/svg.h"
#include "app/commands/timbre/describe_text.h"
#include "app/text.h"

namespace ressort::commands {
namespace {

constexpr double width = 900.0;
constexpr double height = 640.0;
constexpr double left = 62.0;
constexpr double right = 18.0;
constexpr double lowest_hz = 20.0;
constexpr double floor_db = -100.0;
const char* const spectrum_ink = "#888";
const char* const band_ink = "#ddd";

struct Panel {
  double top = 0.0;
  double height = 0.0;
  double bottom() const { return top + height; }
};
constexpr Panel spectrum_panel{44.0, 250.0};
constexpr Panel course_panel{356.0, 240.0};

// Where one figure goes over time, and how its line is drawn, so that grey is enough.
struct Course {
  const char* figure;
  const char* name;
  const char* dashes;  // of SVG; empty: a whole line
};
constexpr Course courses[] = {{"centroid_hz", "centroid", ""},
                              {"spread_hz", "spread", "2 3"},
                              {"rolloff95_hz", "rolloff 95 %", "9 4"}};

std::string dashed(const std::string& path, const char* dashes, double thick) {
  return "<path d=\"" + path + "\" fill=\"none\" stroke=\"" + ink + "\" stroke-width=\"" +
         px(thick) + "\"" +
         (*dashes != '\0' ? std::string(" stroke-dasharray=\"") + dashes + "\"" : std::string()) +
         "/>\n";
}

class Drawer {
 public:
  Drawer(const Description& description, const DescriptionOptions& options)
      : of_(description), options_(options), highest_hz_(0.5 * description.rate_hz) {}

  std::string draw() const {
    return svg_head(width, height, 11.0) +
           "<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n" + "<text x=\"" + px(left) +
           "\" y=\"18\" font-size=\"14\">" + escaped(of_.of) + "</text>\n" + spectrum() + course() +
           "</svg>\n";
  }

 private:
  double share_of(double hz) const {
    return std::log(std::clamp(hz, lowest_hz, highest_hz_) / lowest_hz) /
           std::log(highest_hz_ / lowest_hz);
  }
  double x_of(double hz) const { return left + (width - left - right) * share_of(hz); }
  double y_of(double hz) const {
    return course_panel.bottom() - course_panel.height * share_of(hz);
  }
  double x_of_time(double time_s) const {
    const double first_s = static_cast<double>(of_.frames.front().at) / of_.rate_hz;
    const double last_s = static_cast<double>(of_.frames.back().at) / of_.rate_hz;
    return left + (width - left - right) *
                      (last_s > first_s ? (time_s - first_s) / (last_s - first_s) : 0.5);
  }
  double db_of(double value) const {
    const double most = *std::max_element(of_.spectrum.begin(), of_.spectrum.end());
    const double factor = options_.kind == SpectrumKind::magnitude ? 20.0 : 10.0;
    return value > 0.0 ? std::clamp(factor * std::log10(value / most), floor_db, 0.0) : floor_db;
  }
  double y_of_db(double db) const {
    return spectrum_panel.top + spectrum_panel.height * db / floor_db;
  }

  std::string frame_box(const Panel& panel) const {
    return box(left, panel.top, width - left - right, panel.height);
  }

  std::string spectrum() const {
    const DescribedFrame& frame = of_.frames[of_.loudest];
    std::string svg =
        label(left, spectrum_panel.top - 7.0,
              "spectrum of the " + std::string(options_.at ? "" : "loudest ") + "frame, at " +
                  fixed(static_cast<double>(frame.at) / of_.rate_hz, 3) + " s",
              "start");
    const auto value = [&](const char* figure) { return frame.values[figure_number(figure)]; };
    const auto centroid = value("centroid_hz");
    const auto spread = value("spread_hz");
    const auto rolloff = value("rolloff95_hz");
    if (centroid && spread) {
      const double from = x_of(*centroid - *spread);
      svg += "<rect x=\"" + px(from) + "\" y=\"" + px(spectrum_panel.top) + "\" width=\"" +
             px(x_of(*centroid + *spread) - from) + "\" height=\"" + px(spectrum_panel.height) +
             "\" fill=\"" + band_ink + "\"/>\n";
    }
    for (const double hz : {50.0, 100.0, 200.0, 500.0, 1e3, 2e3, 5e3, 1e4, 2e4}) {
      if (hz < highest_hz_) {
        svg +=
            line(x_of(hz), spectrum_panel.top, x_of(hz), spectrum_panel.bottom(), grid_ink, "0.4") +
            label(x_of(hz), spectrum_panel.bottom() + 15.0, hertz(hz), "middle");
      }
    }
    svg += label(width - right, spectrum_panel.bottom() + 29.0, "Hz");
    for (double db = 0.0; db >= floor_db; db -= 20.0) {
      svg += line(left, y_of_db(db), width - right, y_of_db(db), grid_ink, "0.4") +
             label(left - 6.0, y_of_db(db) + 3.5, fixed(db, 0) + (db == 0.0 ? " dB" : ""));
    }
    svg += of_.channels == 0 ? lines() : curve();
    if (centroid) {
      const double x = x_of(*centroid);
      svg += line(x, spectrum_panel.top, x, spectrum_panel.bottom(), ink, "1.6");
    }
    if (rolloff) {
      const double x = x_of(*rolloff);
      svg += dashed("M" + px(x) + " " + px(spectrum_panel.top) + "V" + px(spectrum_panel.bottom()),
                    "9 4", 1.2);
    }
    if (centroid && spread && rolloff) {
      svg += label(width - right, spectrum_panel.top - 7.0,
                   "line: centroid " + with_commas(*centroid, 0) + " Hz; band: spread " +
                       with_commas(*spread, 0) + " Hz around it; dashes: rolloff 95 % " +
                       with_commas(*rolloff, 0) + " Hz");
    }
    return svg + frame_box(spectrum_panel);
  }

  // The largest bin of each half pixel.
  std::string curve() const {
    std::string path;
    double x_now = -1.0;
    double most = floor_db;
    const auto put = [&] {
      path += (path.empty() ? "M" : "L") + px(x_now) + " " + px(y_of_db(most));
    };
    for (std::size_t k = 1; k < of_.spectrum.size(); ++k) {
      if (of_.frequencies_hz[k] < lowest_hz) {
        continue;
      }
      const double x = std::round(2.0 * x_of(of_.frequencies_hz[k])) / 2.0;
      if (x != x_now && x_now >= 0.0) {
        put();
        most = floor_db;
      }
      x_now = x;
      most = std::max(most, db_of(of_.spectrum[k]));
    }
    if (x_now >= 0.0) {
      put();
    }
    return "<path d=\"" + path + "\" fill=\"none\" stroke=\"" + spectrum_ink +
           "\" stroke-width=\"1.2\"/>\n";
  }

  std::string lines() const {
    std::string svg;
    for (std::size_t k = 0; k < of_.spectrum.size(); ++k) {
      const double x = x_of(of_.frequencies_hz[k]);
      svg +=
          line(x, spectrum_panel.bottom(), x, y_of_db(db_of(of_.spectrum[k])), spectrum_ink, "1.6");
    }
    return svg;
  }

  std::string course() const {
    std::string svg = label(left, course_panel.top - 22.0, "their course, in Hz over s", "start");
    double legend_x = left;
    for (const Course& course : courses) {
      svg += dashed("M" + px(legend_x) + " " + px(course_panel.top - 9.0) + "h34", course.dashes,
                    1.5) +
             label(legend_x + 40.0, course_panel.top - 5.5, course.name, "start");
      legend_x += 150.0;
    }
    for (const double hz : {50.0, 100.0, 200.0, 500.0, 1e3, 2e3, 5e3, 1e4, 2e4}) {
      if (hz < highest_hz_) {
        svg += line(left, y_of(hz), width - right, y_of(hz), grid_ink, "0.4") +
               label(left - 6.0, y_of(hz) + 3.5, hertz(hz));
      }
    }
    const double first_s = static_cast<double>(of_.frames.front().at) / of_.rate_hz;
    const double last_s = static_cast<double>(of_.frames.back().at) / of_.rate_hz;
    for (int step = 0; step <= 4; ++step) {
      const double time_s = first_s + (last_s - first_s) * step / 4.0;
      if (step == 0 || last_s > first_s) {
        svg += label(x_of_time(time_s), course_panel.bottom() + 15.0, fixed(time_s, 2),
                     step == 0   ? "start"
                     : step == 4 ? "end"
                                 : "middle");
      }
    }
    svg += label(width - right, course_panel.bottom() + 29.0, "s");
    for (const Course& course : courses) {
      svg += dashed(path_of(figure_number(course.figure)), course.dashes, 1.5);
    }
    return svg + frame_box(course_panel);
  }

  // Of long sounds a part of the frames, 2000 at most; a gap where there is nothing.
  std::string path_of(std::size_t figure) const {
    const std::size_t every = 1 + of_.frames.size() / 2000;
    std::string path;
    bool is_on = false;
    for (std::size_t i = 0; i < of_.frames.size(); i += every) {
      const DescribedFrame& frame = of_.frames[i];
      if (frame.values[figure]) {
        const double x = x_of_time(static_cast<double>(frame.at) / of_.rate_hz);
        path += (is_on ? "L" : "M") + px(x) + " " + px(y_of(*frame.values[figure]));
        path += of_.frames.size() == 1 ? "h4" : "";
      }
      is_on = frame.values[figure].has_value();
    }
    return path.empty() ? "M0 0" : path;
  }

  const Description& of_;
  const DescriptionOptions& options_;
  double highest_hz_;
};

}  // namespace

std::string description_svg(const Description& description, const DescriptionOptions& options) {
  return Drawer(description, options).draw();
}

}  // namespace ressort::commands
