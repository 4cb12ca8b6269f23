// bench: exported models, compiled by FAUST and C++ compilers with several options, and loaded.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/model/network.h"
#include "tests/bench/bench_scenes.h"
#include "tests/support/rooms.h"

namespace ressort::bench {

// A compiled FAUST program, loaded until this process ends. `is_double` is its precision.
struct FaustLibrary {
  std::string variant;  // name for tables: "-vec clang++"
  bool is_double = true;
  bool is_default = false;  // without an option, by g++
  void* (*make)(int rate_hz) = nullptr;
  void (*destroy)(void* instance) = nullptr;
  int (*outputs)(void* instance) = nullptr;
  void (*set)(void* instance, const char* slider, double value) = nullptr;
  // T* const inputs[channel], outputs[channel]
  void (*compute)(void* instance, int frames, void* inputs, void* outputs) = nullptr;
};

// Compiles ressort's export and the same network written with mi.lib, with no option, -vec and
// -mcd 0, in both precisions, with every C++ compiler found, and returns the variants that compile.
// Several compilers run in parallel, each for at most two minutes of CPU time. `folder` caches the
// results, failures included.
std::vector<FaustLibrary> faust_libraries(const BenchScene& scene, const Network& network,
                                          const std::filesystem::path& folder);

}  // namespace ressort::bench
