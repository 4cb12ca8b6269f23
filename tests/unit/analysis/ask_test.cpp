// Timbre that is asked for: hidden parameters are found again, as the textbook simulator renders
// them; and what cannot be had says so.
#include <cmath>
#include <limits>

#include "core/analysis/timbre/ask.h"
#include "core/analysis/timbre/frame_analysis.h"
#include "tests/support/harness.h"
#include "tests/support/random.h"
#include "tests/support/reference_network.h"

namespace ressort {
namespace {

constexpr double rate_hz = 44100.0;
constexpr std::size_t frame = 2048;

struct Ranged {
  double minimum;
  double maximum;
};

// A linear model, and where its parameters may be.
struct Played {
  const char* text;
  std::vector<Ranged> ranges;
};

const Played models[] = {
    {"@k param 0.2\n@z param 0.001\n@at param 0.3\n@s string 40 1. k z 0. 0.\n"
     "@in1 frcInput [@s at]\n@out1 posOutput [@s 0.71]\n",
     {{0.02, 0.9}, {1e-4, 0.02}, {0.05, 0.45}}},
    {"@k param 0.2\n@bend param 0.02\n@z param 0.001\n@s stiffString 30 1. k bend z 0. 0.\n"
     "@in1 frcInput [@s 0.21]\n@out1 posOutput [@s 0.66]\n",
     {{0.05, 0.5}, {1e-3, 0.1}, {1e-4, 0.01}}},
    {"@m param 1\n@k param 0.1\n@z param 0.001\n@at param 0.3\n@s closedMesh 7 9 m k z 0. 0.\n"
     "@in1 frcInput [@s at 0.3]\n@out1 posOutput [@s 0.7 0.6]\n",
     {{1.0, 8.0}, {0.02, 0.2}, {1e-4, 0.01}, {0.2, 0.5}}},
    {"@k param 0.05\n@z param 0.001\n@air param 0.0005\n@a mass 1. 0. 0.\n@b mass 1.5 0. 0.\n"
     "@c mass 0.8 0. 0.\n@g ground 0.\n@l0 springDamper @g @a k air\n@l1 springDamper @a @b 0.05 z\n"
     "@l2 springDamper @b @c k z\n@in1 frcInput @a\n@out1 posOutput @c\n",
     {{0.005, 0.3}, {1e-5, 0.01}, {1e-5, 0.01}}},
};

Network read(const Played& model) { return support::network_of(model.text); }

std::vector<FreeParameter> free_of(const Played& model) {
  std::vector<FreeParameter> free;
  for (std::size_t i = 0; i < model.ranges.size(); ++i) {
    free.push_back({i, model.ranges[i].minimum, model.ranges[i].maximum});
  }
  return free;
}

double drawn(support::Random& random, const Ranged& range) {
  return is_wide(range.minimum, range.maximum)
             ? range.minimum * std::pow(range.maximum / range.minimum, random.uniform(0.0, 1.0))
             : random.uniform(range.minimum, range.maximum);
}

// The first frame after a blow, as the textbook simulator has it.
std::vector<double> rendered(const Network& network, std::span<const double> parameters) {
  auto simulation = reference::Builder(network, parameters).build();
  std::vector<double> samples;
  for (std::size_t n = 0; n <= frame; ++n) {
    samples.push_back(simulation.simulator.tick({n == 0 ? 1.0 : 0.0})[0]);
  }
  samples.erase(samples.begin());
  return samples;
}

}  // namespace
}  // namespace ressort
