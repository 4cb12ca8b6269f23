// The stability bound: by hand on small networks, and against simulation on random ones.
#include "core/analysis/stability.h"

#include "tests/rig.h"

namespace ressort {
namespace {

using rig::network_of;
using rig::show;

constexpr double limit = 3.92;  // 4, and two percent to spare

double factor_of(const std::string& text, double rate_ratio = 1.0) {
  const Network network = network_of(text);
  const auto values = parameter_values(network);
  return highest_stiffness_factor(network, {values, values}, rate_ratio);
}

const std::string mass_and_ground = "@m mass 2. 0. 0.\n@g ground 0.\n";

// The largest eigenvalue of M^-1 K, by power iteration through the network's springs.
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

// How large a network that was kicked gets when every stiffness is multiplied.
double growth(const Network& network, double factor) {
  Program program = make_program(network, 44100.0, true);
  for (std::size_t i = 0; i < program.moving; ++i) {
    program.velocity[i] = std::cos(3.0 * static_cast<double>(i));
  }
  rig::Bare<double> bare(program);
  bare.set_coefficients(0, program.parameters, factor, false);
  double largest = 0.0;
  for (int n = 0; n < 20000 && largest < 1e12; ++n) {
    for (const double y : bare.step({})) {
      largest = std::max(largest, std::fabs(y));
    }
  }
  return largest;
}

}  // namespace

TEST_CASE("the edge bound by hand", "[stability]") {
  // Triangle: d0 = .05 + .2 and 2 (.01 + .002), d1 = .2 and 2 (.002); together .45 + .028 = .478.
  CHECK(factor_of(scenes::poly_triangle()) == Approx((limit - .028) / .45).epsilon(1e-14));
  // String: two inner neighbours, 4 K and 8 Z.
  CHECK(factor_of(scenes::string("s", 50, "0.1", "0.001")) ==
        Approx((limit - .008) / .4).epsilon(1e-14));
  CHECK(factor_of(scenes::bowed_string()) < factor_of(scenes::string("s", 150, "0.3", "0.001")));
  // An oscillator: K/M and 2 Z/M.
  CHECK(factor_of("@o osc 2. 0.5 0.1 0. 0.") == Approx((limit - .1) / .25).epsilon(1e-14));
  // At half the step K counts a quarter, Z a half.
  CHECK(factor_of("@o osc 2. 0.5 0.1 0. 0.", 0.5) == Approx((limit - .05) / .0625).epsilon(1e-14));
}

TEST_CASE("every law counts with its steepest slope", "[stability]") {
  CHECK(factor_of(mass_and_ground + "@l spring @m @g 1") == Approx(limit / .5).epsilon(1e-14));
  CHECK(factor_of(mass_and_ground + "@l spring @g @m 1 .1") ==
        Approx((limit - .1) / .5).epsilon(1e-14));
  CHECK(factor_of(mass_and_ground + "@l contact @m @g 1 .1 0") ==
        Approx((limit - .1) / .5).epsilon(1e-14));
  // A pluck attracts with K/10 outside its inner zone.
  CHECK(factor_of(mass_and_ground + "@l nlPluck @m @g 1 1 .1") ==
        Approx((limit - .1) / .05).epsilon(1e-14));
  CHECK(factor_of(mass_and_ground + "@l nlBow @m @g 1 1") ==
        Approx(limit / (2.0 / 3.0)).epsilon(1e-14));
  CHECK(factor_of(mass_and_ground + "@l nlBow @m @g 1 1 1") ==
        Approx(limit / 1.0387).epsilon(1e-14));
}

TEST_CASE("where nothing bounds, and where dampers alone are too strong", "[stability]") {
  CHECK(factor_of("@m mass 1. 0. 0.") == 1e9);
  CHECK(factor_of("@g ground 0.") == 1e9);
  CHECK(factor_of(mass_and_ground + "@d damper @m @g 3.9") == 1e9);
  CHECK(factor_of(mass_and_ground + "@d damper @m @g 4") <= 0.0);
  CHECK(factor_of("@o osc 1. 0.5 2. 0. 0.") <= 0.0);
  // And they are: x is multiplied by 1 - Z/M < -1 a step.
  CHECK(growth(network_of(mass_and_ground + "@d damper @m @g 4.1\n@out1 posOutput @m"), 1.0) >
        1e10);
  CHECK(growth(network_of(mass_and_ground + "@d damper @m @g 3.9\n@out1 posOutput @m"), 1.0) < 10);
}

TEST_CASE("the worst corner of the parameters' box counts", "[stability]") {
  const Network network = network_of(scenes::string("s", 50, "0.1", "0.001"));
  const ParameterBox box{{0.5, 0.01, 0.0}, {4.0, 0.2, 0.01}};  // M, K, Z
  CHECK(highest_stiffness_factor(network, box, 1.0) ==
        Approx((limit - .08 / .5) / (.8 / .5)).epsilon(1e-14));
}

TEST_CASE("the triangle's true limit is where theory has it", "[stability]") {
  // numerics.md 1.4: m_K < 1.31568650461023, everything else as written.
  const double edge = 1.31568650461023;
  const auto at = [](double k) {
    return network_of(scenes::triangle(rig::show(k), "0.001") + scenes::output(1, "m_m2"));
  };
  CHECK(growth(at(edge * (1 - 1e-4)), 1.0) < 1e3);
  CHECK(growth(at(edge * (1 + 1e-3)), 1.0) > 1e10);
}

TEST_CASE("on random networks the bound is safe, and within a factor of two of the truth",
          "[stability]") {
  rig::Random random(6);
  double loosest = 10.0;
  for (int i = 0; i < 100; ++i) {
    // Masses hang on a tree with some more springs across, one of them on a ground.
    const int count = 2 + static_cast<int>(random.below(12));
    std::string text = "@g ground 0.\n@l spring @g @m0 0.1\n";
    int links = 0;
    const auto link = [&](int a, int b, double z) {
      text += scenes::at("s", links++) + " spring " + scenes::at("m", a) + " " +
              scenes::at("m", b) + " " + rig::show(random.uniform(0.01, 1.0)) + " " + rig::show(z) +
              "\n";
    };
    for (int m = 0; m < count; ++m) {
      text += scenes::at("m", m) + " mass " + rig::show(random.uniform(0.5, 4.0)) + " 0. 0.\n" +
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
    const double truth = 4.0 / stiffest(network);
    INFO(text << "factor " << show(factor) << ", truth " << show(truth));
    REQUIRE(factor <= truth * 0.98 * (1 + 1e-9));
    REQUIRE(factor >= truth * 0.98 / 2.0);
    REQUIRE(growth(network, factor) < 1e4);
    REQUIRE(growth(network, truth * 1.02) > 1e10);
    loosest = std::min(loosest, factor / truth);
  }
  CHECK(loosest < 0.97);  // it is a bound and not the truth
}

}  // namespace ressort
