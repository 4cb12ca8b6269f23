// Modes computed from known shapes, which other parameters may keep.
#include <cmath>
#include <string>

#include "core/analysis/modes/known_shapes.h"
#include "core/model/topology.h"
#include "tests/support/harness.h"
#include "tests/support/networks/reference_network.h"

namespace ressort::known_shapes_test {
namespace {

using Complex = std::complex<double>;

// The sum of all modes as heard after this many samples.
Complex sum_after(const std::vector<HeardMode>& modes, double samples) {
  Complex sum;
  for (const HeardMode& mode : modes) {
    sum += mode.residues[0] * std::exp(samples * pole_of(mode.mu, ModeScheme::published));
  }
  return sum;
}

std::vector<double> turned(const Network& network, std::size_t parameter, double factor) {
  std::vector<double> values = parameter_values(network);
  values[parameter] *= factor;
  return values;
}

LinearSystem system_of(const Network& network, std::span<const double> values) {
  return make_linear_system(evaluated(network, values), 1.0, true);
}

KnownShapes known_of(const Network& network) {
  auto modes = find_modes(network, parameter_values(network), {});
  REQUIRE(modes);
  REQUIRE(modes->basis.rows() == modes->system.size());
  return KnownShapes(*std::move(modes), {0}, {});
}

}  // namespace

TEST_CASE("unchanged shapes give the modes exactly", "[known_shapes]") {
  // K, Z, M and a place of a rectangle and of a square, whose modes come in pairs.
  for (const char* const size : {"7 9", "8 8"}) {
    const Network network = expand_macros(support::network_of(
        "@m param 1\n@k param 0.1\n@z param 0.001\n@at param 0.3\n@s closedMesh " +
        std::string(size) +
        " m k z 0. 0.\n@in1 frcInput [@s at 0.3]\n@out1 posOutput [@s 0.7 0.6]\n"));
    const KnownShapes known = known_of(network);
    for (std::size_t parameter = 0; parameter < 4; ++parameter) {
      INFO(size << ", parameter " << parameter);
      const auto values = turned(network, parameter, 1.7);
      const auto kept = known.modes_of(system_of(network, values));
      const auto anew = find_modes(network, values, {});
      REQUIRE(kept);
      REQUIRE(anew);
      const auto heard = heard_modes(*anew, std::vector<std::size_t>{0});
      REQUIRE(kept->size() == heard.size());
      for (std::size_t i = 0; i < heard.size(); ++i) {
        CHECK((*kept)[i].tone.frequency_hz == Approx(heard[i].tone.frequency_hz).epsilon(1e-12));
        CHECK((*kept)[i].tone.t60_s == Approx(heard[i].tone.t60_s).epsilon(1e-9));
      }
      // Modes of a pair may be mixed, but the sound of both together is unique.
      for (const double samples : {1.0, 57.0, 1000.0}) {
        CHECK(std::abs(sum_after(*kept, samples) - sum_after(heard, samples)) < 1e-10);
      }
    }
  }
}

TEST_CASE("different rows or shapes are detected", "[known_shapes]") {
  const auto text = [](const char* masses) {
    return "@k param 0.1\n@c param 0.02\n@s string " + std::string(masses) +
           " 1. k 0.001 0. 0.\n@g ground 0.\n@foot spring @g [@s 0.4] c\n"
           "@in1 frcInput [@s 0.1818181818]\n@out1 posOutput [@s 0.7]\n";
  };
  const Network network = expand_macros(support::network_of(text("9")));
  const Network longer = expand_macros(support::network_of(text("10")));
  auto modes = find_modes(network, std::vector{0.1, 0.0}, {});
  REQUIRE(modes);
  KnownShapes known(*std::move(modes), {0}, {});
  CHECK(known.modes_of(system_of(network, std::vector{0.2, 0.0})));
  CHECK_FALSE(known.modes_of(system_of(network, std::vector{0.1, 0.02})));
  CHECK_FALSE(known.modes_of(system_of(longer, std::vector{0.1, 0.0})));
}

}  // namespace ressort::known_shapes_test
