// tests: compares a network's modal form with the direct kernel.
#pragma once

#include <string>

#include "core/kernels/modal/modal_form.h"
#include "tests/support/comparison.h"
#include "tests/support/passive.h"

namespace ressort::support {

inline Program in_modes(const std::string& text, Passivity passive = Passivity::never,
                        const Budget& budget = {}, bool is_crossed = false) {
  Program program = program_of(text, passive);
  std::optional<Modes> modes = modal_form(program, budget, {}, is_crossed);
  INFO(text);
  REQUIRE(modes);
  REQUIRE(modes->is_crossed == is_crossed);
  program.form = std::move(*modes);
  return program;
}

template <class T>
void check_same(const Program& program, const ComparisonOptions& options, double tolerance) {
  for (const Comparison& output : compare_kernels<T>(program, options)) {
    INFO("peak " << show(output.peak) << ", off by " << show(output.relative()) << ", "
                 << isa_name(options.isa) << (options.turns ? ", turning" : "") << ", reach "
                 << options.reach << ", seed " << options.seed);
    CHECK(output.peak > 0.0);
    CHECK(output.relative() < tolerance);
  }
}

}  // namespace ressort::support
