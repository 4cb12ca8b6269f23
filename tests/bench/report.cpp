#include "tests/bench/report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>

namespace ressort::bench {
namespace {

constexpr double tolerated_error = 0.2;      // of a prediction
constexpr double budget_ns = 1e9 / 48000.0;  // of one core, per sample

const char* precision_of(const Row& row) {
  return row.is_double ? "double" : "float";
}

double ns_per_mass(const Row& row) {
  return row.median_ns / static_cast<double>(row.masses * row.voices);
}

std::string number(const char* format, double value) {
  char text[40];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

std::string ratio(const std::optional<double>& value) {
  return value ? number("%.3g", *value) : "";
}

std::string cpu_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.starts_with("model name")) {
      return line.substr(line.find(':') + 2);
    }
  }
  return "unknown CPU";
}

std::string shown_method(const Row& row) {
  return row.form.empty() ? row.method : row.method + ": " + row.form;
}

// A curve of the picture: one method in one precision, its points as gnuplot's data.
struct Curve {
  std::string method;
  bool is_double = true;
  std::string points;
};

// Of all that FAUST was made to try, only the fastest of each scene is drawn.
std::vector<Curve> curves_of(const std::string& family, const std::vector<Row>& rows) {
  std::vector<Curve> curves;
  const auto add = [&](const Row& row, const std::string& method, double times) {
    auto curve = std::find_if(curves.begin(), curves.end(), [&](const Curve& known) {
      return known.method == method && known.is_double == row.is_double;
    });
    if (curve == curves.end()) {
      curve = curves.insert(curve, {method, row.is_double, ""});
    }
    curve->points +=
        std::to_string(row.masses) + " " + number("%.6g", times * ns_per_mass(row)) + "\n";
  };
  for (const Row& row : rows) {
    if (row.family == family && !row.method.starts_with("faust")) {
      add(row, row.method, 1.0);
    }
    if (row.family == family && row.method == "ressort" && row.is_double && row.than_best_faust) {
      add(row, "best FAUST", *row.than_best_faust);
    }
  }
  return curves;
}

// The same in every panel.
std::string style_of(const Curve& curve) {
  static const std::map<std::string, std::string> colours{
      {"ressort", "black"}, {"direct", "red"},    {"chains", "blue"},      {"modal", "#008040"},
      {"grid", "purple"},   {"batch", "#c0a000"}, {"reference", "gray50"}, {"best FAUST", "brown"}};
  return " with linespoints linecolor rgb \"" + colours.at(curve.method) + "\" linewidth " +
         (curve.method == "ressort" ? "2.5" : "1.2") + " dashtype " + (curve.is_double ? "1" : "2");
}

std::string panel(const std::string& family, const std::vector<Row>& rows) {
  std::string data;
  std::string plot;
  for (const Curve& curve : curves_of(family, rows)) {
    const std::string block = "$" + family + std::to_string(plot.size());
    data += block + " << EOD\n" + curve.points + "EOD\n";
    plot += (plot.empty() ? "plot " : ", ") + block + style_of(curve) + " title \"" + curve.method +
            (curve.is_double ? "" : ", float") + "\"";
  }
  return plot.empty() ? "" : data + "set title \"" + family + "\"\n" + plot + "\n";
}

std::string picture(const std::filesystem::path& folder, const std::string& machine,
                    const std::vector<Row>& rows, const std::string& terminal,
                    const std::string& name) {
  return "reset\nset terminal " + terminal + "\nset output \"" + (folder / name).string() +
         "\"\nset logscale xy\nset grid\nset key outside below\nset xlabel \"masses\"\n"
         "set ylabel \"ns per mass and sample\"\nset format x \"10^%T\"\n"
         "set multiplot layout 1,2 title \"" +
         machine + "\" noenhanced\n" + panel("chains", rows) + panel("meshes", rows) +
         "unset multiplot\nset output\n";
}

}  // namespace

std::string machine_line(const std::string& isa) {
  return cpu_name() + ", " + isa + ", " +
#if defined(__clang__)
         "clang " __clang_version__;
#else
         "g++ " __VERSION__;
#endif
}

void print_head() {
  std::printf("%-26s %-6s %-20s %10s %10s %9s %7s %7s %10s %11s  %s\n", "", "", "", "median",
              "minimum", "ns/mass", "% core", "% of", "times", "predicted",
              "times faster than FAUST");
  std::printf("%-26s %-6s %-20s %10s %10s %9s %7s %7s %10s %11s  %s\n", "scene", "", "method",
              "ns/sample", "ns/sample", "/sample", "48 kHz", "limit", "reference", "/ measured",
              "best (default)");
}

void print(const std::vector<Row>& rows) {
  for (const Row& row : rows) {
    std::string faust = ratio(row.than_best_faust);
    if (row.than_default_faust) {
      faust += " (" + ratio(row.than_default_faust) + ")";
    }
    const std::string limit = row.of_limit ? number("%.0f", 100.0 * *row.of_limit) : "";
    std::string predicted;
    if (row.predicted_ns) {
      const double times = *row.predicted_ns / row.median_ns;
      predicted = (std::abs(times - 1.0) > tolerated_error ? "! " : "") + number("%.2f", times);
    }
    std::printf("%-26s %-6s %-20s %10.4g %10.4g %9.3g %7.3g %7s %10s %11s  %s\n", row.scene.c_str(),
                precision_of(row), shown_method(row).c_str(), row.median_ns, row.minimum_ns,
                ns_per_mass(row), 100.0 * row.median_ns / budget_ns, limit.c_str(),
                ratio(row.than_reference).c_str(), predicted.c_str(), faust.c_str());
  }
  std::fflush(stdout);
}

void print_predictions(const std::vector<Row>& rows) {
  std::size_t all = 0;
  std::size_t within = 0;
  for (const Row& row : rows) {
    if (row.predicted_ns) {
      ++all;
      within += std::abs(*row.predicted_ns / row.median_ns - 1.0) <= tolerated_error ? 1 : 0;
    }
  }
  std::printf("Predictions within a fifth of what was measured: %zu of %zu; ! marks the others\n",
              within, all);
}

void print_regrets(const std::vector<Row>& rows) {
  constexpr double tolerated = 1.1;
  std::printf("Kernels that were faster than the one that the plan chose:\n");
  double worst = 1.0;
  for (const Row& engine : rows) {
    if (engine.form.empty()) {
      continue;
    }
    const Row* chosen = nullptr;
    const Row* fastest = nullptr;
    for (const Row& row : rows) {
      if (row.scene != engine.scene || row.is_double != engine.is_double || !row.form.empty() ||
          row.method == "reference" || row.method.starts_with("faust")) {
        continue;
      }
      chosen = row.method == engine.form ? &row : chosen;
      fastest = fastest == nullptr || row.median_ns < fastest->median_ns ? &row : fastest;
    }
    if (chosen == nullptr) {
      continue;
    }
    const double times = chosen->median_ns / fastest->median_ns;
    worst = engine.is_worst ? std::max(worst, times) : worst;
    if (times > tolerated) {
      std::printf("  %-26s %-6s %s, not %s: %.2f times%s\n", engine.scene.c_str(),
                  precision_of(engine), fastest->method.c_str(), chosen->method.c_str(), times,
                  engine.is_worst ? "" : "; not at its worst here");
    }
  }
  std::printf("  where all touches all the time, at most %.2f times is lost\n", worst);
}

bool write_csv(const std::filesystem::path& path, const std::string& isa,
               const std::vector<Row>& rows) {
  std::ofstream file(path);
  file << "scene,precision,method,form,isa,masses,links,voices,median_ns,minimum_ns,lower_ns,upper_"
          "ns,ns_per_mass,"
          "core_share,share_of_limit,times_reference,times_best_faust,times_default_faust,"
          "predicted_ns\n";
  for (const Row& row : rows) {
    file << row.scene << ',' << precision_of(row) << ',' << row.method << ',' << row.form << ','
         << isa << ',' << row.masses << ',' << row.links << ',' << row.voices << ','
         << number("%.6g", row.median_ns) << ',' << number("%.6g", row.minimum_ns) << ','
         << number("%.6g", row.lower_ns) << ',' << number("%.6g", row.upper_ns) << ','
         << number("%.6g", ns_per_mass(row)) << ',' << number("%.6g", row.median_ns / budget_ns)
         << ',' << ratio(row.of_limit) << ',' << ratio(row.than_reference) << ','
         << ratio(row.than_best_faust) << ',' << ratio(row.than_default_faust) << ','
         << ratio(row.predicted_ns) << '\n';
  }
  file.close();
  return file.good();
}

bool draw(const std::filesystem::path& folder, const std::string& machine,
          const std::vector<Row>& rows) {
  FILE* const gnuplot = popen("gnuplot 2>/dev/null", "w");
  if (gnuplot == nullptr) {
    return false;
  }
  const std::string script =
      picture(folder, machine, rows, "pngcairo size 1600,800", "cost.png") +
      picture(folder, machine, rows, "svg size 1600,800 background \"white\"", "cost.svg");
  std::fputs(script.c_str(), gnuplot);
  return pclose(gnuplot) == 0;
}

}  // namespace ressort::bench
