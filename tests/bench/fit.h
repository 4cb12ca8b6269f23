// bench: the prices of things (core/kernels/prices), from what forms took.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/kernels/registry.h"
#include "tests/support/rooms.h"

namespace ressort::bench {

// What a form did in a sample of a scene, and what that took.
struct Sample {
  std::string scene;
  Method method = Method::direct;
  bool is_double = true;
  Work work;
  double ns = 0.0;
};

// The prices, none below 0, for which the sum of squares of the relative errors is the least, form
// by form. What no sample does keeps its price.
Prices fitted(Prices prices, const std::vector<Sample>& samples);

// How far the predictions are off, form by form, and each sample for which it is more than a fifth.
void print_errors(const Prices& prices, const std::vector<Sample>& samples);

// As the C++ table that the plan reads; where, relative to the source's folder, `path_of` says.
std::filesystem::path path_of(Isa isa);
bool write(const Prices& prices, Isa isa, const std::string& machine);

}  // namespace ressort::bench
