#include "tests/bench/report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>

namespace ressort::bench {
namespace {

constexpr double budget_ns = 1e9 / 48000.0;  // time per sample of one core

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
  std::printf("%-26s %-6s %-20s %10s %10s %9s %7s %7s %10s  %s\n", "", "", "", "median", "minimum",
              "ns/mass", "% core", "% of", "times", "times faster than FAUST");
  std::printf("%-26s %-6s %-20s %10s %10s %9s %7s %7s %10s  %s\n", "scene", "", "method",
              "ns/sample", "ns/sample", "/sample", "48 kHz", "limit", "reference",
              "best (default)");
}

void print(const std::vector<Row>& rows) {
  for (const Row& row : rows) {
    std::string faust = ratio(row.than_best_faust);
    if (row.than_default_faust) {
      faust += " (" + ratio(row.than_default_faust) + ")";
    }
    const std::string limit = row.of_limit ? number("%.0f", 100.0 * *row.of_limit) : "";
    std::printf("%-26s %-6s %-20s %10.4g %10.4g %9.3g %7.3g %7s %10s  %s\n", row.scene.c_str(),
                precision_of(row), shown_method(row).c_str(), row.median_ns, row.minimum_ns,
                ns_per_mass(row), 100.0 * row.median_ns / budget_ns, limit.c_str(),
                ratio(row.than_reference).c_str(), faust.c_str());
  }
  std::fflush(stdout);
}

void print_regrets(const std::vector<Row>& rows) {
  constexpr double tolerated = 1.1;
  std::printf("Scenes in which another kernel was faster than the chosen one:\n");
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
                  engine.is_worst ? "" : "; some contacts are open here");
    }
  }
  std::printf("  worst loss with all contacts closed: %.2f times\n", worst);
}

bool write_csv(const std::filesystem::path& path, const std::string& isa,
               const std::vector<Row>& rows) {
  std::ofstream file(path);
  file << "scene,precision,method,form,isa,masses,links,voices,median_ns,minimum_ns,lower_ns,upper_"
          "ns,ns_per_mass,"
          "core_share,share_of_limit,times_reference,times_best_faust,times_default_faust\n";
  for (const Row& row : rows) {
    file << row.scene << ',' << precision_of(row) << ',' << row.method << ',' << row.form << ','
         << isa << ',' << row.masses << ',' << row.links << ',' << row.voices << ','
         << number("%.6g", row.median_ns) << ',' << number("%.6g", row.minimum_ns) << ','
         << number("%.6g", row.lower_ns) << ',' << number("%.6g", row.upper_ns) << ','
         << number("%.6g", ns_per_mass(row)) << ',' << number("%.6g", row.median_ns / budget_ns)
         << ',' << ratio(row.of_limit) << ',' << ratio(row.than_reference) << ','
         << ratio(row.than_best_faust) << ',' << ratio(row.than_default_faust) << '\n';
  }
  file.close();
  return file.good();
}

}  // namespace ressort::bench
