// Random structures tuned to a random note and decay, judged by the sound: rendered by the
// published scheme and analysed by ESPRIT, independent of the model.
#include <cmath>
#include <numbers>

#include "core/analysis/modes/tune.h"
#include "core/identification/identify.h"
#include "core/model/language/expression.h"
#include "core/model/topology.h"
#include "tests/support/harness.h"
#include "tests/support/thorough.h"

namespace ressort::notes_heard_test {

using namespace support;

namespace {

constexpr double rate_hz = 44100.0;

// One of six structures with random size, material and decay, struck and heard where few modes have
// a node.
std::string random_structure(Random& random, std::size_t kind) {
  const auto number = [&](double low, double high) {
    return " " + show(std::exp(random.uniform(std::log(low), std::log(high))));
  };
  const std::string length = " " + std::to_string(8 + random.below(40));
  const std::string size =
      " " + std::to_string(5 + random.below(6)) + " " + std::to_string(4 + random.below(5));
  const std::string material = number(0.3, 3.0) + number(0.005, 0.05);
  const std::string end = number(1e-5, 1e-3) + number(1e-6, 1e-5) + " 0. 0.\n";
  const std::string structures[] = {
      "@s string" + length + material + end,
      "@s chain" + length + material + end,
      "@s stiffString" + length + material + number(0.001, 0.02) + end,
      "@s mesh" + size + material + end,
      "@s closedMesh" + size + material + end,
      "@s cornerMesh" + size + material + end};
  const std::string across = kind < 3 ? "" : " 0.37";
  // Free chains and meshes would drift away.
  const bool is_free = kind == 1 || kind == 3;
  return structures[kind] +
         (is_free ? "@g ground 0.\n@h spring @g [@s 0." + across + "] 0.02 0.00001\n" : "") +
         "@in1 frcInput [@s 0.31" + across + "]\n@out1 posOutput [@s 0.43" + across + "]\n";
}

std::vector<double> struck(const Network& network, double seconds) {
  Bare<double> bare(make_program(expand_macros(network), rate_hz, true));
  std::vector<double> sound;
  for (int n = 0; n < static_cast<int>(seconds * rate_hz); ++n) {
    sound.push_back(bare.step({n == 0 ? 1.0 : 0.0})[0]);
  }
  return sound;
}

}  // namespace

TEST_CASE("a structure tuned to a note and a decay sounds with both", "[notes_heard]") {
  const auto seeds = of_all<std::uint64_t>(6, 24);
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    Random random(seed + 1);
    const std::string text = random_structure(random, seed % 6);
    INFO("seed " << seed << "\n" << text);
    const Network network = network_of(text);
    const auto values = parameter_values(network);
    const auto modes = find_modes(network, values, {.count = 8});
    REQUIRE(modes);
    std::size_t mode = 0;
    while (modes->modes[mode].frequency_hz < 10.0) {  // A rigid-body motion.
      ++mode;
    }
    const double near_hz = modes->modes[mode].frequency_hz * random.uniform(0.75, 1.33);
    const double key = std::round(69.0 + 12.0 * std::log2(near_hz / 440.0));
    const double wanted_hz = 440.0 * std::exp2((key - 69.0) / 12.0);
    const double wanted_s = random.uniform(0.3, 3.0);
    const auto tuned = tune_mode(network, values,
                                 {.mode = mode, .frequency_hz = wanted_hz, .t60_s = wanted_s}, {});
    INFO((tuned ? "" : tuned.error().message));
    REQUIRE(tuned);
    const auto heard = identify({rate_hz, {struck(tuned->network, 2.0)}}, {}, {});
    INFO((heard ? "" : heard.error().message));
    REQUIRE(heard);
    double off_cents = HUGE_VAL;
    double off_t60 = HUGE_VAL;
    for (const IdentifiedMode& found : heard->modes) {
      const double cents = std::fabs(1200.0 * std::log2(found.frequency_hz.value / wanted_hz));
      if (cents < off_cents) {
        off_cents = cents;
        off_t60 = std::fabs(found.t60_s.value / wanted_s - 1.0);
      }
    }
    std::string others;
    for (const IdentifiedMode& found : heard->modes) {
      others += show(found.frequency_hz.value) + " Hz " + show(found.t60_s.value) + " s, ";
    }
    INFO(wanted_hz << " Hz, " << wanted_s << " s; heard: " << others);
    CHECK(off_cents < 0.005);
    CHECK(off_t60 < 0.0005);
  }
}

}  // namespace ressort::notes_heard_test
