// app/commands: how a scheme has to start to be on the continuous network's course.
#pragma once

#include <array>
#include <cstddef>

#include "app/commands/chart/scenes.h"

namespace ressort::commands {

// A scheme knows of a mass's speed only by where it comes in its first step. So the one scene is as
// many as there are lengths of a step: in each, masses start towards where the continuous network
// is after one. Scenes that are not linear, or too large to be solved, are what they are.
class Starts {
 public:
  explicit Starts(const ChartScene& scene);             // [control] seconds for a thousand masses
  const ChartScene& at(unsigned steps_a_sample) const;  // 1, 2, 4 or 8

 private:
  std::array<ChartScene, 4> scenes_;
};

}  // namespace ressort::commands
