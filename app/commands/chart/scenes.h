// app/commands: what the chart is drawn of. A scene is a network and what drives its inputs, told
// in seconds, so that it is the same at every rate.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "app/session/loader.h"
#include "core/model/network.h"
#include "core/result.h"

namespace ressort::commands {

// The rate that scenes' numbers are written for.
inline constexpr double scene_rate_hz = Network::reference_rate_hz;

// Where an input is at a time in seconds.
using InputMotion = std::function<double(double)>;

struct ChartScene {
  std::string name;
  std::string about;                 // how it is excited, for people
  Network network;                   // without macros; its parameters as the preset has them
  std::vector<InputMotion> motions;  // [input] null where it stays, as forces do
  bool is_linear = false;            // the continuous network is known exactly
  bool has_contacts = false;         // what is chaotic: waveforms count for some milliseconds only
  std::vector<double> worst;  // [parameter] at the ends of their ranges: stiff, damped, light

  bool is_driven() const;  // energy comes in by an input
};

// The reference scenes' names.
const std::vector<std::string>& reference_scenes();

// A reference scene, or else a model or a preset by file or name. Linear networks that rest get
// x[-1] = x[0] - 0.01 on their first input's mass, all others the gesture that a note of velocity
// 0.8 is to their preset, at the pitch that is written.
Result<ChartScene> chart_scene(const std::string& name);

// The same with an impulse besides, at the mass of every input or else at the first one that moves:
// for networks in which nothing sounds as they are.
ChartScene struck(const ChartScene& scene);

// The same, hit ten times harder: start and motions.
ChartScene struck_harder(const ChartScene& scene);

}  // namespace ressort::commands
