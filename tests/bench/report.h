// bench: what was measured, for people, for programs and as a picture.
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
  std::string form;  // that an engine plays; else empty
  bool is_double = true;
  std::size_t masses = 0;  // that move, of one voice
  std::size_t links = 0;
  std::size_t voices = 1;
  bool is_worst = false;   // the scene
  double median_ns = 0.0;  // per sample
  double minimum_ns = 0.0;
  double lower_ns = 0.0;  // the quartiles of the rounds
  double upper_ns = 0.0;
  // How many times faster it is than others of the same run, by the medians.
  std::optional<double> than_reference;
  std::optional<double> than_best_faust;  // in the same precision
  std::optional<double> than_default_faust;
  std::optional<double> predicted_ns;  // by the plan's prices, where the scene is at its worst
  // Of what the multiply-adds alone would take if the core did nothing else.
  std::optional<double> of_limit;
};

// CPU, instruction set, compiler.
std::string machine_line(const std::string& isa);

void print_head();
void print(const std::vector<Row>& rows);
// How many of the predictions are within a fifth.
void print_predictions(const std::vector<Row>& rows);
// Where another kernel is more than a tenth faster in the scene than the one that the plan chose
// for its worst case, and what was lost by that at most.
void print_regrets(const std::vector<Row>& rows);
bool write_csv(const std::filesystem::path& path, const std::string& isa,
               const std::vector<Row>& rows);

}  // namespace ressort::bench
