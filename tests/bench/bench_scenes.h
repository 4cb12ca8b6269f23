// bench: the scenes. A scene is a model's text, the motion of its inputs, and the number of voices.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace ressort::bench {

inline constexpr std::size_t block_frames = 64;
inline constexpr std::size_t cycle_blocks = 192;  // period of the inputs
inline constexpr std::size_t cycle_frames = cycle_blocks * block_frames;

// A parameter that changes at every sample.
struct Turn {
  std::string parameter;
  double middle = 0.0;
  double reach = 0.0;
  double at(std::size_t frame) const;
};

struct BenchScene {
  std::string name;
  std::string text;
  std::function<double(std::size_t input, std::size_t frame)> hand;  // position or force
  std::vector<Turn> turns;
  std::size_t voices = 1;     // each at its own pitch
  std::string tuned_by = "";  // the parameter that sets a voice's pitch in FAUST
  std::string family = "";    // its curve in the picture; empty: none
  std::size_t elements = 0;   // approximate number of masses and links
  bool is_noisy = false;      // the outputs multiply white noise
  bool is_worst = false;  // all contacts are closed all the time, the case that the planner assumes
};

// Returns all scenes in the order in which they are printed.
std::vector<BenchScene> all_scenes();

// Returns the model with its moving parameters read from audio channels after the `inputs` others,
// because FAUST's sliders change only once a block.
std::string text_with_channels(const BenchScene& scene, std::size_t inputs);

}  // namespace ressort::bench
