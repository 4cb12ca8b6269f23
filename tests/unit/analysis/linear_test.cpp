// The lowest mode against closed forms: strings, chains, the triangle, one oscillator.
#include "core/analysis/linear.h"
#include "core/model/topology.h"

#include "tests/support/harness.h"

namespace ressort::linear_test {
namespace {

using support::network_of;
using support::show;

std::optional<Mode> lowest_mode(const Network& network, std::span<const double> parameters) {
  const auto shapes = lowest_shapes(network, parameters);
  return shapes ? std::optional(shapes->mode) : std::nullopt;
}

std::optional<Mode> mode_of(const std::string& text) {
  const Network network = network_of(text);
  return lowest_mode(network, parameter_values(network));
}

// The frequency of k/m = kappa and z/m = zeta in the explicit scheme: the angle of the roots of
// z^2 - (2 - kappa - zeta) z + (1 - zeta).
double scheme_hz(double kappa, double zeta) {
  const double theta = std::acos((2.0 - kappa - zeta) / (2.0 * std::sqrt(1.0 - zeta)));
  return 44100.0 / (2.0 * std::numbers::pi) * theta;
}

double sin_squared(double x) {
  return std::sin(x) * std::sin(x);
}

void check_mode(const std::string& what, const std::optional<Mode>& mode, double stiffness,
                double damping, double tolerance) {
  REQUIRE(mode);
  INFO(what << ": k off by " << show(mode->stiffness / stiffness - 1.0) << ", z by "
            << show(mode->damping / damping - 1.0));
  CHECK(std::fabs(mode->stiffness / stiffness - 1.0) < tolerance);
  CHECK(std::fabs(mode->damping / damping - 1.0) < tolerance);
  CHECK(std::fabs(mode->frequency_hz / scheme_hz(stiffness, damping) - 1.0) < tolerance);
}

std::string chain(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) {
    text += scenes::at("m", i) + " mass 2. 0. 0.\n";
  }
  for (int i = 0; i + 1 < count; ++i) {
    text += scenes::at("r", i) + " springDamper " + scenes::at("m", i) + " " +
            scenes::at("m", i + 1) + " 0.1 0.001\n";
  }
  return text;
}

}  // namespace

TEST_CASE("a string's lowest mode is 4 sin^2(pi / 2(N+1)) of K and of Z", "[linear]") {
  // 64 and 65 masses lie on either side of the switch to the sparse solver.
  for (const int count : {1, 2, 10, 50, 64, 65, 150, 1000}) {
    const double share = 4.0 * sin_squared(std::numbers::pi / (2.0 * (count + 1)));
    check_mode(std::to_string(count) + " masses",
               mode_of(scenes::string("s", count, "0.1", "0.001")), 0.1 * share, 0.001 * share,
               1e-9);
  }
  // Values from closed forms and an independent eigenvalue solver.
  CHECK(mode_of(scenes::string("s", 50, "0.1", "0.001"))->frequency_hz ==
        Approx(136.70267890413).epsilon(1e-9));
  CHECK(mode_of(scenes::bowed_string())->frequency_hz == Approx(79.9810014580398).epsilon(1e-9));
  // A position input holds its end like a ground.
  const double share = 4.0 * sin_squared(std::numbers::pi / (2.0 * 31));
  check_mode("resonator", mode_of(scenes::resonator()), 0.3 * share, 0.01 * share, 1e-9);
}

TEST_CASE("a single oscillator is its own mode", "[linear]") {
  const auto mode = mode_of("@o osc 1. 0.1 0.001 0. 0.");
  check_mode("oscillator", mode, 0.1, 0.001, 1e-12);
  CHECK(mode->frequency_hz == Approx(2229.431351291107).epsilon(1e-12));
  check_mode("heavy", mode_of("@o osc 4. 0.1 0.001 0. 0."), 0.025, 0.00025, 1e-12);
  check_mode("two springs",
             mode_of("@a mass 2. 0. 0.\n@g ground 0.\n@l spring @a @g .1 .01\n"
                     "@r spring @g @a .3 .01"),
             0.2, 0.01, 1e-12);
}

TEST_CASE("the triangle's lowest mode equals that of its 2x2 matrix", "[linear]") {
  // Symmetric in m1 and m2: with s = (m1 + m2)/sqrt 2 the stiffness is [[.25, -.1 sqrt 2],
  // [-.1 sqrt 2, .1]] over (m0, s). Its lower eigenvalue is (.35 - sqrt(.1025))/2.
  const double kappa = (0.35 - std::sqrt(0.1025)) / 2.0;
  const double slope = (0.25 - kappa) / (0.1 * std::sqrt(2.0));  // s for m0 = 1
  // Z has the same form: [[.012, -.001 sqrt 2], [-.001 sqrt 2, .001]].
  const double zeta = (0.012 - 2.0 * 0.001 * std::sqrt(2.0) * slope + 0.001 * slope * slope) /
                      (1.0 + slope * slope);
  const auto mode = mode_of(scenes::poly_triangle());
  check_mode("triangle", mode, kappa, zeta, 1e-12);
  // The true pole, with non-proportional damping, is at 858.455895 Hz.
  INFO(show(mode->frequency_hz));
  CHECK(std::fabs(mode->frequency_hz / 858.455895090791 - 1.0) < 1e-4);
}

TEST_CASE("rigid motions are not modes", "[linear]") {
  for (const int count : {2, 3, 60, 200}) {
    // A free chain has 4 sin^2(j pi / 2N); j = 0 is rigid.
    const double share = 4.0 * sin_squared(std::numbers::pi / (2.0 * count)) / 2.0;
    check_mode("chain of " + std::to_string(count), mode_of(chain(count)), 0.1 * share,
               0.001 * share, 1e-8);
  }
  CHECK_FALSE(mode_of("@m mass 1. 0. 0."));
  CHECK_FALSE(mode_of("@g ground 0."));
  CHECK_FALSE(mode_of("@m mass 1. 0. 0.\n@g ground 0.\n@d damper @m @g 0.1"));
}

TEST_CASE("links that are not springs are open, and the slowest part counts", "[linear]") {
  CHECK_FALSE(
      mode_of("@m mass 1. 0. 0.\n@g ground 0.\n@d nlPluck @m @g 0.1 1\n@c contact @m @g 1 1"
              "\n@b nlBow @m @g 1 1"));
  const double share = 4.0 * sin_squared(std::numbers::pi / (2.0 * 151));
  check_mode("plucked string", mode_of(scenes::plucked_harmonics()), 0.5 * share, 0.01 * share,
             1e-9);
  check_mode(
      "two strings",
      mode_of(scenes::string("a", 5, "0.1", "0.001") + scenes::string("b", 4, "0.1", "0.001")),
      0.1 * 4.0 * sin_squared(std::numbers::pi / 12.0),
      0.001 * 4.0 * sin_squared(std::numbers::pi / 12.0), 1e-12);
}

TEST_CASE("the current parameters count, not the written ones", "[linear]") {
  const Network network = network_of(scenes::string("s", 10, "0.1", "0.001"));
  const double values[] = {2.0, 0.4, 0.002};  // M, K, Z
  const double share = 4.0 * sin_squared(std::numbers::pi / 22.0) / 2.0;
  check_mode("set", lowest_mode(network, values), 0.4 * share, 0.002 * share, 1e-12);
}

TEST_CASE("a matrix that cannot be factored has no lowest mode", "[linear]") {
  // A chain of 98 with a mass that a parameter makes negative: every stiffness is below 0.
  const Network network = support::network_of(
      "@m param -2\n@s chain 98 m 0.001 0.1 0\n@c cornerMesh 5 41 0.08 0.002 0 0\n"
      "@out1 posOutput [@s 0]\n");
  CHECK_FALSE(lowest_mode(expand_macros(network), parameter_values(network)));
}

}  // namespace ressort::linear_test
