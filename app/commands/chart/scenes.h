// app/commands: the scenes of the chart. A scene is a network and the motions of its inputs as
// functions of seconds, so that it is the same at every rate.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "app/session/loader.h"
#include "core/model/network.h"
#include "core/result.h"

namespace ressort::commands {

// The rate of the scenes' coefficients.
inline constexpr double scene_rate_hz = Network::reference_rate_hz;

// Position of an input at a time in seconds.
using InputMotion = std::function<double(double)>;

struct ChartScene {
  std::string name;
  std::string about;                 // the excitation, for people
  Network network;                   // without macros, with the preset's parameters
  std::vector<InputMotion> motions;  // [input] null for inputs at rest and for forces
  bool is_linear = false;            // the continuous network has an exact solution
  bool has_contacts = false;

  bool is_driven() const;  // an input moves
};

// Names of the reference scenes.
const std::vector<std::string>& reference_scenes();

// Returns a reference scene, or a model or preset by file or name. A linear network at rest starts
// with x[-1] = x[0] - 0.01 at its first input's mass. Other scenes play the gesture of a note of
// velocity 0.8 at the pitch of the model.
Result<ChartScene> chart_scene(const std::string& name);

// Adds an impulse at the mass of every input, or else at the first mass that moves.
ChartScene struck(const ChartScene& scene);

// Makes the start and the motions ten times harder.
ChartScene struck_harder(const ChartScene& scene);

// A scheme knows the velocity of a mass only by its position after the first step. Each step length
// therefore has its own scene, in which the masses start towards the position of the continuous
// network after one step. Scenes that are nonlinear or too large are not changed.
class Starts {
 public:
  explicit Starts(const ChartScene& scene);             // [control] seconds for a thousand masses
  const ChartScene& at(unsigned steps_a_sample) const;  // 1, 2, 4 or 8

 private:
  std::array<ChartScene, 4> scenes_;
};

}  // namespace ressort::commands
