// app/commands: the methods, precisions and budgets that the chart compares. Tables in ways.cpp
// list them.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/commands/chart/player.h"
#include "core/compile/compile.h"

namespace ressort::commands {

struct Way {
  std::string name;              // "direct 4x", "modal silence=-60"
  std::string line;              // the curve that joins it to others, in the order of the table
  std::string label;             // text beside its mark; empty for most
  std::optional<Method> method;  // empty: the plan's choice
  std::string budget;            // budget, in the notation of --budget
  unsigned oversampling = 1;
  Precision precision = Precision::float64;
  bool is_bare = true;  // ignores the preset's budget
};

std::vector<Way> all_ways();

// A scene compiled for one way, ready to play.
struct MadeWay {
  Way way;
  std::unique_ptr<Engine> engine;  // owns the machine
  std::string methods;             // methods of its parts, "modal" or "grid+direct"
  std::vector<std::string> twins;  // ways with the same output
  std::unique_ptr<ChartPlayer> player;

  const Machine& machine() const { return engine->machine(); }
};

// Compiles a scene. Fails if this way cannot play the network.
Result<MadeWay> make_way(const ChartScene& scene, const Way& way, double seconds, Isa isa);

}  // namespace ressort::commands
