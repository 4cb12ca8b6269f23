// bench: prints the measurements as a table, a CSV file and a picture.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tests/bench/bench_scenes.h"

namespace ressort::bench {

struct Row {
  std::string scene;
  std::string family;
  std::string method;
  std::string form;  // the kernel that an engine plays; else empty
  bool is_double = true;
  std::size_t masses = 0;  // moving masses of one voice
  std::size_t links = 0;
  std::size_t voices = 1;
  bool is_worst = false;   // whether the scene is a worst case
  double median_ns = 0.0;  // per sample
  double minimum_ns = 0.0;
  double lower_ns = 0.0;  // quartiles of the rounds
  double upper_ns = 0.0;
  // Ratios of medians: how many times faster this row is than others in the same run.
  std::optional<double> than_reference;
  std::optional<double> than_best_faust;  // the same for the best of FAUST in the same precision
  std::optional<double> than_default_faust;
  // Ratio of the time that the multiply-adds alone would take at the core's peak rate to the
  // measured time.
  std::optional<double> of_limit;
};

// Returns the CPU, the instruction set and the compiler.
std::string machine_line(const std::string& isa);

void print_head();
void print(const std::vector<Row>& rows);
// Prints the scenes in which another kernel is more than a tenth faster than the kernel that the
// plan chose for its worst case, and the largest loss.
void print_regrets(const std::vector<Row>& rows);
bool write_csv(const std::filesystem::path& path, const std::string& isa,
               const std::vector<Row>& rows);

}  // namespace ressort::bench
