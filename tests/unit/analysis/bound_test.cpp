// The edge bound: hand-computed on small networks, and against simulation on random ones.
#include "tests/support/growth.h"
#include "tests/support/random.h"

namespace ressort::bound_test {
namespace {

using namespace support;

// Returns the largest eigenvalue of M^-1 K, by power iteration over the network's springs.
double stiffest(const Network& network) {
  const auto values = parameter_values(network);
  std::vector<double> x(network.masses.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    x[i] = network.masses[i].kind == MassKind::ground ? 0.0 : std::sin(1.0 + 7.0 * double(i));
  }
  double rho = 0.0;
  for (int step = 0; step < 5000; ++step) {
    std::vector<double> force(x.size(), 0.0);
    for (const Link& link : network.links) {
      const double f = argument_value(network, link.arguments[0], values) * (x[link.a] - x[link.b]);
      force[link.a] += f;
      force[link.b] -= f;
    }
    double largest = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      const bool is_ground = network.masses[i].kind == MassKind::ground;
      x[i] = is_ground ? 0.0 : force[i] / argument_value(network, network.masses[i].mass, values);
      largest = std::max(largest, std::fabs(x[i]));
    }
    rho = largest;
    for (double& value : x) {
      value /= largest;
    }
  }
  return rho;
}

TEST_CASE("the edge bound equals hand-computed values", "[bound]") {
  // Triangle: d0 = .05 + .2 and 2 (.01 + .002), d1 = .2 and 2 (.002); together .45 + .028 = .478.
  CHECK(factor_of(scenes::poly_triangle()) == Approx((bound_limit - .028) / .45).epsilon(1e-14));
  // String: two inner neighbours, 4 K and 8 Z.
  CHECK(factor_of(scenes::string("s", 50, "0.1", "0.001")) ==
        Approx((bound_limit - .008) / .4).epsilon(1e-14));
  CHECK(factor_of(scenes::bowed_string()) < factor_of(scenes::string("s", 150, "0.3", "0.001")));
  // An oscillator: K/M and 2 Z/M.
  CHECK(factor_of("@o osc 2. 0.5 0.1 0. 0.") == Approx((bound_limit - .1) / .25).epsilon(1e-14));
  // At half the step K counts a quarter and Z a half.
  CHECK(factor_of("@o osc 2. 0.5 0.1 0. 0.", 0.5) ==
        Approx((bound_limit - .05) / .0625).epsilon(1e-14));
}

TEST_CASE("every law counts with its steepest slope", "[bound]") {
  CHECK(factor_of(mass_and_ground + "@l spring @m @g 1") ==
        Approx(bound_limit / .5).epsilon(1e-14));
  CHECK(factor_of(mass_and_ground + "@l spring @g @m 1 .1") ==
        Approx((bound_limit - .1) / .5).epsilon(1e-14));
  CHECK(factor_of(mass_and_ground + "@l contact @m @g 1 .1 0") ==
        Approx((bound_limit - .1) / .5).epsilon(1e-14));
  // A pluck attracts with K/10 outside its inner zone.
  CHECK(factor_of(mass_and_ground + "@l nlPluck @m @g 1 1 .1") ==
        Approx((bound_limit - .1) / .05).epsilon(1e-14));
  CHECK(factor_of(mass_and_ground + "@l nlBow @m @g 1 1") ==
        Approx(bound_limit / (2.0 / 3.0)).epsilon(1e-14));
  // The profile may be a parameter.
  for (const char* const profile : {"1", "p"}) {
    CHECK(factor_of("@p param 0\n" + mass_and_ground + "@l nlBow @m @g 1 1 " + profile) ==
          Approx(bound_limit / 1.0387).epsilon(1e-14));
  }
}

TEST_CASE("the edge bound handles unlimited networks and excessive dampers", "[bound]") {
  CHECK(factor_of("@m mass 1. 0. 0.") == 1e9);
  CHECK(factor_of("@g ground 0.") == 1e9);
  CHECK(factor_of(mass_and_ground + "@d damper @m @g 3.9") == 1e9);
  CHECK(factor_of(mass_and_ground + "@d damper @m @g 4") <= 0.0);
  CHECK(factor_of("@o osc 1. 0.5 2. 0. 0.") <= 0.0);
  // The dampers are too strong: each step multiplies x by 1 - Z/M < -1.
  CHECK(growth(network_of(mass_and_ground + "@d damper @m @g 4.1\n@out1 posOutput @m"), 1.0) >
        1e10);
  CHECK(growth(network_of(mass_and_ground + "@d damper @m @g 3.9\n@out1 posOutput @m"), 1.0) < 10);
}

TEST_CASE("the worst corner of the parameters' box counts", "[bound]") {
  const Network network = network_of(scenes::string("s", 50, "0.1", "0.001"));
  const ParameterBox box{{0.5, 0.01, 0.0}, {4.0, 0.2, 0.01}};  // M, K, Z
  CHECK(Stability(network, 1.0).bounded_stiffness_factor(box) ==
        Approx((bound_limit - .08 / .5) / (.8 / .5)).epsilon(1e-14));
}

TEST_CASE("on random networks the bound is safe, and within a factor of two of the reference",
          "[bound]") {
  support::Random random(6);
  double loosest = 10.0;
  for (int i = 0; i < 100; ++i) {
    // Masses on a tree with some additional springs, one of them to a ground.
    const int count = 2 + static_cast<int>(random.below(12));
    std::string text = "@g ground 0.\n@l spring @g @m0 0.1\n";
    int links = 0;
    const auto link = [&](int a, int b, double z) {
      text += scenes::at("s", links++) + " spring " + scenes::at("m", a) + " " +
              scenes::at("m", b) + " " + support::show(random.uniform(0.01, 1.0)) + " " +
              support::show(z) + "\n";
    };
    for (int m = 0; m < count; ++m) {
      text += scenes::at("m", m) + " mass " + support::show(random.uniform(0.5, 4.0)) + " 0. 0.\n" +
              scenes::output(m + 1, "m" + std::to_string(m));
      if (m > 0) {
        link(m, static_cast<int>(random.below(static_cast<std::size_t>(m))), 0.0);
      }
    }
    for (int k = 0; k < count; ++k) {
      const int a = static_cast<int>(random.below(static_cast<std::size_t>(count)));
      const int b = static_cast<int>(random.below(static_cast<std::size_t>(count)));
      if (a != b) {
        link(a, b, 0.0);
      }
    }
    const Network network = network_of(text);
    const double factor = factor_of(text);
    const double reference = 4.0 / stiffest(network);
    INFO(text << "factor " << show(factor) << ", reference " << show(reference));
    REQUIRE(factor <= reference * 0.98 * (1 + 1e-9));
    REQUIRE(factor >= reference * 0.98 / 2.0);
    REQUIRE(growth(network, factor) < 1e4);
    REQUIRE(growth(network, reference * 1.02) > 1e10);
    loosest = std::min(loosest, factor / reference);
  }
  CHECK(loosest < 0.97);  // It is a bound, not the exact limit.
}

}  // namespace
}  // namespace ressort::bound_test
