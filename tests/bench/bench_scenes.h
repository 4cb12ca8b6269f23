// bench: what is measured. A scene is a model's text, what its hands do, and how many play it.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace ressort::bench {

inline constexpr std::size_t block_frames = 64;
inline constexpr std::size_t cycle_blocks = 192;  // after which every hand begins again
inline constexpr std::size_t cycle_frames = cycle_blocks * block_frames;

// A parameter that moves with every sample.
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
  std::string family = "";    // its curve in the picture; none where it is empty
  std::size_t elements = 0;   // masses and links, about: what it costs FAUST and the reference
  bool is_worst = false;      // all that can touch or sound does, all the time, as the plan reckons
};

// In the order in which they are printed.
std::vector<BenchScene> all_scenes();
// Each form over sizes, at its worst: what prices are fitted to, beside those of all_scenes() that
// are at theirs.
std::vector<BenchScene> fit_scenes();

// The model with the parameters that move taken from channels of their own, after its `inputs`
// others: FAUST's sliders move once a block.
std::string text_with_channels(const BenchScene& scene, std::size_t inputs);

}  // namespace ressort::bench
