// Modes computed from known shapes: exact for unchanged shapes, and consistent with central
// differences of full solutions for small changes.
#include <cmath>
#include <string>

#include "core/analysis/modes/nearby_modes.h"
#include "core/analysis/timbre/struck.h"
#include "core/model/topology.h"
#include "tests/support/harness.h"
#include "tests/support/networks/reference_network.h"

namespace ressort::nearby_modes_test {
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

std::vector<double> moved(const Network& network, double by) {
  std::vector<double> values = parameter_values(network);
  values[0] += by;
  return values;
}

LinearSystem system_of(const Network& network, std::span<const double> values) {
  return make_linear_system(evaluated(network, values), 1.0, true);
}

NearbyModes nearby(const Network& network) {
  auto modes = find_modes(network, parameter_values(network), {});
  REQUIRE(modes);
  REQUIRE(modes->basis.rows() == modes->system.size());
  return NearbyModes(*std::move(modes), {0}, {});
}

}  // namespace

TEST_CASE("unchanged shapes give the modes exactly", "[nearby_modes]") {
  // K, Z, M and a place of a rectangle and of a square, whose modes come in pairs.
  for (const char* const size : {"7 9", "8 8"}) {
    const Network network = expand_macros(support::network_of(
        "@m param 1\n@k param 0.1\n@z param 0.001\n@at param 0.3\n@s closedMesh " +
        std::string(size) +
        " m k z 0. 0.\n@in1 frcInput [@s at 0.3]\n@out1 posOutput [@s 0.7 0.6]\n"));
    const NearbyModes known = nearby(network);
    for (std::size_t parameter = 0; parameter < 4; ++parameter) {
      INFO(size << ", parameter " << parameter);
      const auto values = turned(network, parameter, 1.7);
      const auto kept = known.exactly(system_of(network, values));
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

TEST_CASE("different rows or shapes are detected", "[nearby_modes]") {
  const auto text = [](const char* masses) {
    return "@k param 0.1\n@c param 0.02\n@s string " + std::string(masses) +
           " 1. k 0.001 0. 0.\n@g ground 0.\n@foot spring @g [@s 0.4] c\n"
           "@in1 frcInput [@s 0.1818181818]\n@out1 posOutput [@s 0.7]\n";
  };
  const Network network = expand_macros(support::network_of(text("9")));
  const Network longer = expand_macros(support::network_of(text("10")));
  auto modes = find_modes(network, std::vector{0.1, 0.0}, {});
  REQUIRE(modes);
  NearbyModes known(*std::move(modes), {0}, {});
  CHECK(known.exactly(system_of(network, std::vector{0.2, 0.0})));
  CHECK_FALSE(known.exactly(system_of(network, std::vector{0.1, 0.02})));
  CHECK(known.nearly(system_of(network, std::vector{0.1, 0.02})));
  CHECK_FALSE(known.exactly(system_of(longer, std::vector{0.1, 0.0})));
  CHECK_FALSE(known.nearly(system_of(longer, std::vector{0.1, 0.0})));
}

// Derivatives of pole and residue by the first parameter: by perturbation, and by full solutions on
// either side, with a third-order error.
TEST_CASE("small changes of shape match central differences", "[nearby_modes]") {
  const std::string ends =
      "@in1 frcInput [@s 0.1818181818]\n@out1 posOutput [@s 0.6363636364]\n@out2 posOutput [@s "
      "0.8181818182]\n";
  const std::string cases[] = {
      // A spring to the ground on a string with air loss.
      "@c param 0.05\n@s string 12 1. 0.2 0. 0.002 0. 0.\n@g ground 0.\n"
      "@foot spring @g [@s 0.3636363636] c\n" +
          ends,
      // Its damper: the shapes become complex to first order.
      "@d param 0.\n@s string 12 1. 0.2 0. 0.002 0. 0.\n@g ground 0.\n"
      "@foot springDamper @g [@s 0.3636363636] 0.05 d\n" +
          ends,
      // A free chain: one motion does not oscillate.
      "@c param 0.05\n@s chain 12 1. 0.2 0. 0. 0.\n@foot spring [@s 0.09090909091] [@s "
      "0.7272727273] c\n" +
          ends,
      // The spring of a position input, and a force output.
      "@c param 0.05\n@s string 12 1. 0.2 0. 0.002 0. 0.\n@in1 posInput 0.\n"
      "@hand spring @in1 [@s 0.3636363636] c\n@g ground 0.\n@wall spring @g [@s 0.6363636364] "
      "c\n@out1 frcOutput @g\n",
  };
  for (const std::string& text : cases) {
    INFO(text);
    const Network network = expand_macros(support::network_of(text));
    NearbyModes known = nearby(network);
    constexpr double step = 1e-6;
    const auto near = [&](double by) {
      auto modes = known.nearly(system_of(network, moved(network, by)));
      REQUIRE(modes);
      return *std::move(modes);
    };
    const auto anew = [&](double by) {
      const auto modes = find_modes(network, moved(network, by), {});
      REQUIRE(modes);
      return heard_modes(*modes, std::vector<std::size_t>{0});
    };
    const auto near_up = near(step);
    const auto near_down = near(-step);
    const auto anew_up = anew(step);
    const auto anew_down = anew(-step);
    REQUIRE(near_up.size() == anew_up.size());
    double fastest = 0.0;
    double steepest = 0.0;
    double pole_off = 0.0;
    double residue_off = 0.0;
    for (std::size_t i = 0; i < near_up.size(); ++i) {
      const Complex pole = (anew_up[i].mu - anew_down[i].mu) / (2.0 * step);
      const Complex residue = (anew_up[i].residues[0] - anew_down[i].residues[0]) / (2.0 * step);
      fastest = std::max(fastest, std::abs(pole));
      steepest = std::max(steepest, std::abs(residue));
      pole_off =
          std::max(pole_off, std::abs((near_up[i].mu - near_down[i].mu) / (2.0 * step) - pole));
      residue_off = std::max(
          residue_off,
          std::abs((near_up[i].residues[0] - near_down[i].residues[0]) / (2.0 * step) - residue));
    }
    CHECK(fastest > 1e-8);
    CHECK(pole_off < 1e-6 * fastest);
    CHECK(residue_off < 1e-6 * steepest);
  }
}

TEST_CASE("degenerate modes that split are computed anew", "[nearby_modes]") {
  // A square, and a spring that breaks its symmetry.
  const Network network = expand_macros(
      support::network_of("@c param 0.\n@s closedMesh 8 8 1. 0.1 0.001 0. 0.\n@g ground 0.\n"
                          "@foot spring @g [@s 0.2 0.4] c\n@in1 frcInput [@s 0.3 0.6]\n@out1 "
                          "posOutput [@s 0.7 0.8]\n"));
  NearbyModes known = nearby(network);
  CHECK(known.nearly(system_of(network, std::vector{0.0})));
  CHECK_FALSE(known.nearly(system_of(network, std::vector{1e-6})));
  // Figures near that point equal those of a full solution.
  StruckModel near(network, {});
  StruckModel anew(network, {});
  const auto told = near.figures_near(std::vector{0.0}, std::vector{1e-6}, StruckAs::samples);
  const auto right = anew.figures(std::vector{1e-6}, StruckAs::samples);
  REQUIRE(told);
  REQUIRE(right);
  for (std::size_t figure = 0; figure < target_figure_count; ++figure) {
    INFO(target_figure_rows()[figure].name);
    CHECK((*told)[figure].value_or(0.0) == Approx((*right)[figure].value_or(0.0)).epsilon(1e-12));
  }
}

}  // namespace ressort::nearby_modes_test
