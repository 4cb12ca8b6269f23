// app/commands: the ways of computing a scene that the chart compares. A new method, precision or
// budget comes in by a row of the tables in chart_ways.cpp.
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
  std::string line;              // ways of one line are joined, in the order of the table
  std::string label;             // beside its mark; empty for most
  std::optional<Method> method;  // without one, the plan's choice
  std::string budget;            // as --budget
  unsigned oversampling = 1;
  Precision precision = Precision::float64;
  bool is_bare = true;  // the network as it is written, unless the budget says otherwise
};

std::vector<Way> all_ways();
const char* precision_name(Precision precision);

// A scene in one way, ready to be played.
struct MadeWay {
  Way way;
  std::unique_ptr<Engine> engine;  // keeps the machine
  Plan plan;
  std::string methods;             // of its parts, "modal" or "grid+direct"
  std::vector<std::string> twins;  // ways that turned out to be the same
  std::unique_ptr<ChartPlayer> player;

  const Machine& machine() const { return engine->machine(); }
  double predicted_ns() const;  // per output sample, by the plan's model
};

// Fails where the network cannot be computed in this way, or is refused.
Result<MadeWay> make_way(const ChartScene& scene, const Way& way, double seconds, Isa isa);

// Are all parts in forms and schemes of the same kinds?
bool same_kind(const Machine& a, const Machine& b);

}  // namespace ressort::commands
