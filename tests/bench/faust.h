// bench: exported models, compiled by FAUST and a C++ compiler in several ways, and loaded.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/model/network.h"
#include "tests/bench/bench_scenes.h"
#include "tests/support/rooms.h"

namespace ressort::bench {

// A compiled program of FAUST's, loaded into this process until it ends. Samples are double or
// float, as is_double says.
struct FaustLibrary {
  std::string variant;  // for people: "-vec clang++"
  bool is_double = true;
  bool is_default = false;  // without an option, by g++
  void* (*make)(int rate_hz) = nullptr;
  void (*destroy)(void* instance) = nullptr;
  int (*outputs)(void* instance) = nullptr;
  void (*set)(void* instance, const char* slider, double value) = nullptr;
  // T* const inputs[channel], outputs[channel]
  void (*compute)(void* instance, int frames, void* inputs, void* outputs) = nullptr;
};

// Every variant that compiles, of ressort's export and of the same network in the words of mi.lib:
// options none, -vec and -mcd 0, in both precisions, by every compiler that is there; several at
// once, each step for at most two minutes of CPU time. What was made once
// lies in `folder` and is taken from there, and so is the knowledge that something does not
// compile.
std::vector<FaustLibrary> faust_libraries(const BenchScene& scene, const Network& network,
                                          const std::filesystem::path& folder);

}  // namespace ressort::bench
