// Stability: the proof against closed forms and against spectra of random networks. bound_test.cpp
// tests the edge bound.
#include "core/analysis/stability.h"

#include "core/model/language/expression.h"
#include "core/model/topology.h"
#include "tests/support/dense.h"
#include "tests/support/growth.h"

namespace ressort::stability_test {

// --- the exact proof ----------------------------------------------------------------------------

namespace {

using namespace support;

// Prints all digits.
std::string digits(double value) {
  return print_number(value);
}

// A network known to the test independently: its masses and springs.
struct Wiring {
  struct Spring {
    int a = 0;  // -1: a ground
    int b = 0;
    double k = 0.0;
    double z = 0.0;
  };
  std::vector<double> masses;
  std::vector<Spring> springs;

  std::string text() const {
    std::string text = "@g ground 0.\n";
    for (std::size_t i = 0; i < masses.size(); ++i) {
      text += scenes::at("m", static_cast<int>(i)) + " mass " + digits(masses[i]) + " 0. 0.\n";
    }
    for (std::size_t i = 0; i < springs.size(); ++i) {
      const auto end = [](int m) { return m < 0 ? std::string("@g") : scenes::at("m", m); };
      text += scenes::at("s", static_cast<int>(i)) + " spring " + end(springs[i].a) + " " +
              end(springs[i].b) + " " + digits(springs[i].k) + " " + digits(springs[i].z) + "\n";
    }
    return text;
  }
  Eigen::MatrixXd mass() const {
    return Eigen::Map<const Eigen::VectorXd>(masses.data(), size()).asDiagonal();
  }
  Eigen::MatrixXd sum(double Spring::*weight) const {
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(size(), size());
    for (const Spring& spring : springs) {
      Eigen::VectorXd ends = Eigen::VectorXd::Zero(size());
      if (spring.a >= 0) {
        ends[spring.a] += 1.0;
      }
      ends[spring.b] -= 1.0;
      matrix += spring.*weight * ends * ends.transpose();
    }
    return matrix;
  }
  Eigen::Index size() const { return static_cast<Eigen::Index>(masses.size()); }
};

// Masses on a tree attached to a ground, with additional springs and individual dampers.
Wiring random_wiring(support::Random& random) {
  Wiring wiring;
  const int count = 2 + static_cast<int>(random.below(9));
  const auto strength = [&] { return std::pow(10.0, random.uniform(-2.0, 0.0)); };
  const auto damping = [&] { return random.below(2) == 0 ? 0.0 : 0.3 * strength(); };
  for (int i = 0; i < count; ++i) {
    wiring.masses.push_back(random.uniform(0.2, 2.0));
    const int to = i == 0 ? -1 : static_cast<int>(random.below(static_cast<std::size_t>(i)));
    wiring.springs.push_back({to, i, strength(), damping()});
    const int across = static_cast<int>(random.below(static_cast<std::size_t>(i + 1)));
    if (across < i) {
      wiring.springs.push_back({across, i, strength(), damping()});
    }
  }
  return wiring;
}

// The roots of det((z-1)^2 M + z K + (z-1) Z) outside the unit circle, by the companion matrix.
int unstable_roots(const Eigen::MatrixXd& m, const Eigen::MatrixXd& k, const Eigen::MatrixXd& z) {
  const Eigen::Index n = m.rows();
  const Eigen::MatrixXd inverse = support::inverse_of(m);
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  companion.topLeftCorner(n, n) = 2.0 * Eigen::MatrixXd::Identity(n, n) - inverse * (k + z);
  companion.topRightCorner(n, n) = inverse * z - Eigen::MatrixXd::Identity(n, n);
  companion.bottomLeftCorner(n, n).setIdentity();
  const Eigen::VectorXcd roots = support::eigenvalues_of(companion);
  return static_cast<int>((roots.array().abs() > 1.0 + 1e-6).count());
}

Eigen::VectorXd spectrum(const Eigen::MatrixXd& symmetric) {
  return support::eigenbasis_of(symmetric).values;
}

ParameterBox as_written(const Network& network) {
  const auto values = parameter_values(network);
  return {values, values};
}

SafeRange range_of(const std::string& text, const std::string& name) {
  const Network network = network_of(text);
  for (std::size_t i = 0; i < network.parameters.size(); ++i) {
    if (network.parameters[i].name == name) {
      const auto range =
          Stability(network, 1.0).safe_range(as_written(network), i, network.parameters[i].value);
      REQUIRE(range);
      return *range;
    }
  }
  FAIL("there is no parameter " + name);
  return {};
}

double highest(const std::string& text, const std::string& name) {
  const SafeRange range = range_of(text, name);
  CHECK(range.lowest == 0.0);
  return range.highest;
}

double lowest(const std::string& text, const std::string& name) {
  const SafeRange range = range_of(text, name);
  CHECK(std::isinf(range.highest));
  return range.lowest;
}

// Returns "line: message", or an empty text for a stable network.
std::string complaint_of(const std::string& text) {
  const Network network = network_of(text);
  const Certificate certificate = Stability(network, 1.0).certify(as_written(network));
  CHECK((certificate.verdict == Verdict::stable) == !certificate.culprit);
  const Error error = complaint(certificate);
  return certificate.culprit ? std::to_string(error.line) + ": " + error.message : "";
}

Approx exactly(double value) {
  return Approx(value).epsilon(1e-12);
}

// The square of the highest mode's shape: 4 cos^2 of half the lowest angle.
double top(double angle) {
  return 4.0 * std::cos(angle) * std::cos(angle);
}

}  // namespace

TEST_CASE("a parameter that starts at 0 may go to both sides", "[stability]") {
  // k = 0.5 + w between 0 and 4 - 2z, with z = 0.1.
  const std::string text = "@w param 0.\n@o osc 1. [0.5+w] 0.1 0. 0.\n";
  const SafeRange both = range_of(text, "w");
  CHECK(both.lowest == Approx(-0.5).epsilon(1e-9));
  CHECK(both.highest == Approx(3.3).epsilon(1e-9));
  // A negative damper is unstable in any network.
  CHECK(range_of("@w param 0.\n@o osc 1. 0.5 w 0. 0.\n", "w").lowest == 0.0);
}

TEST_CASE("every unstable root is a negative eigenvalue of 4M - K - 2Z, and the proof finds it",
          "[stability]") {
  support::Random random(11);
  int unstable = 0;
  for (int i = 0; i < 10000; ++i) {
    Wiring wiring = random_wiring(random);
    const Eigen::MatrixXd load =
        wiring.sum(&Wiring::Spring::k) + 2.0 * wiring.sum(&Wiring::Spring::z);
    // Near the limit, and well above it, where several roots are outside.
    const double off = i % 2 == 0 ? random.uniform(0.99, 1.01) : random.uniform(0.5, 3.0);
    const double scale = off * 4.0 / support::pencil_values(load, wiring.mass()).maxCoeff();
    for (Wiring::Spring& spring : wiring.springs) {
      spring.k *= scale;
      spring.z *= scale;
    }
    const Eigen::MatrixXd k = wiring.sum(&Wiring::Spring::k);
    const Eigen::MatrixXd z = wiring.sum(&Wiring::Spring::z);
    const auto negative =
        static_cast<int>((spectrum(4.0 * wiring.mass() - k - 2.0 * z).array() < 0.0).count());
    const Network network = network_of(wiring.text());
    Stability stability(network, 1.0);
    INFO(wiring.text());
    REQUIRE(unstable_roots(wiring.mass(), k, z) == negative);
    const Verdict verdict = stability.prove(as_written(network));
    REQUIRE((verdict == Verdict::stable) == (negative == 0));
    REQUIRE(stability.certify(as_written(network)).verdict == verdict);
    unstable += negative > 0 ? 1 : 0;
  }
  CHECK(unstable > 3300);
  CHECK(unstable < 8000);
}

TEST_CASE("the exact factor on every stiffness is where the lowest eigenvalue is 0",
          "[stability]") {
  support::Random random(12);
  int found = 0;
  for (int i = 0; i < 200; ++i) {
    const Wiring wiring = random_wiring(random);
    const Network network = network_of(wiring.text());
    const double factor = Stability(network, 1.0).stiffness_factor(as_written(network));
    const Eigen::MatrixXd rest = 4.0 * wiring.mass() - 2.0 * wiring.sum(&Wiring::Spring::z);
    INFO(wiring.text());
    if (spectrum(rest)[0] <= 0.0) {
      REQUIRE(factor == 0.0);
      continue;
    }
    const Eigen::VectorXd pencil = support::pencil_values(wiring.sum(&Wiring::Spring::k), rest);
    REQUIRE(factor == exactly(1.0 / pencil.maxCoeff()));
    REQUIRE(factor >= factor_of(wiring.text()));  // The exact factor is at least the bound.
    ++found;
  }
  CHECK(found > 150);
}

TEST_CASE("the range of one parameter matches theory", "[stability]") {
  // The triangle, by the dense eigenvalues of its three masses.
  CHECK(highest(scenes::poly_triangle(), "m_K") == exactly(1.31568650461023));
  CHECK(highest(scenes::poly_triangle(), "m_Z") == exactly(0.608843252305113));
  // A string of N: the highest of 2 - 2 cos is 4 cos^2(pi/(2N + 2)), for K + 2Z.
  const double top50 = top(std::numbers::pi / 102.0);
  const std::string string50 = scenes::string("s", 50, "0.1", "0.001");
  CHECK(highest(string50, "s_K") == exactly(4.0 / top50 - 0.002));
  CHECK(highest(string50, "s_Z") == exactly((4.0 / top50 - 0.1) / 2.0));
  CHECK(lowest(string50, "s_M") == exactly(0.102 * top50 / 4.0));
  CHECK(4.0 * lowest(string50, "s_M") == Approx(0.407613079).epsilon(2e-9));
  const std::string bowed = scenes::string("s", 150, "0.3", "0.001");
  CHECK(highest(bowed, "s_K") == exactly(0.998108222407659));
  CHECK(highest(bowed, "s_Z") == exactly(0.350054111203829));
  CHECK(4.0 * lowest(bowed, "s_M") == Approx(1.207869281).epsilon(1e-9));
  CHECK(4.0 * lowest(scenes::string("s", 150, "0.5", "0.01"), "s_M") ==
        Approx(2.079774922).epsilon(1e-9));
  // A free mesh: one such sum along each side.
  const double mesh = top(std::numbers::pi / 40.0) + top(std::numbers::pi / 60.0);
  CHECK(highest("@K param 0.1\n@d mesh 20 30 1. K 0.01 0. 0.\n", "K") ==
        exactly(4.0 / mesh - 0.02));
  CHECK(lowest("@M param 1.\n@d mesh 20 30 M 0.1 0.01 0. 0.\n", "M") == exactly(0.12 * mesh / 4.0));
  // A light mass on a heavy one: k = 4 (4 - .01) / (4 - .01 + 4000) exactly.
  CHECK(highest("@k param 0.001\n@g ground 0.\n@a mass 1. 0. 0.\n@b mass 0.001 0. 0.\n"
                "@r spring @g @a 0.01\n@l spring @a @b k\n",
                "k") == exactly(0.01596 / 3.994));
}

TEST_CASE("around the exact limit a simulation decays or grows", "[stability]") {
  const auto at = [](double k) {
    return network_of(scenes::triangle(digits(k), "0.001") + scenes::output(1, "m_m2"));
  };
  const double edge = highest(scenes::poly_triangle(), "m_K");
  CHECK(growth(at(edge * (1 - 1e-4)), 1.0) < 1e3);
  CHECK(growth(at(edge * (1 + 1e-3)), 1.0) > 1e10);
  const auto verdict = [&](double k) {
    const Network network = at(k);
    return Stability(network, 1.0).prove(as_written(network));
  };
  CHECK(verdict(edge * (1 - 1e-8)) == Verdict::stable);
  CHECK(verdict(edge * (1 + 1e-8)) == Verdict::unstable);
}

TEST_CASE("every law counts in the proof with its steepest slope", "[stability]") {
  const auto limit = [](const std::string& link) {
    return highest("@p param 0.01\n@m mass 1. 0. 0.\n@g ground 0.\n@l " + link + "\n", "p");
  };
  CHECK(limit("spring @m @g p") == exactly(4.0));
  CHECK(limit("spring @m @g p 0.1") == exactly(3.8));
  CHECK(limit("damper @m @g p") == exactly(2.0));
  CHECK(limit("nlSpring2 @m @g p 0.1 0.1") == exactly(3.8));
  CHECK(limit("nlSpring3 @m @g p 0.1 0.1") == exactly(3.8));
  // s d + c d^3 clipped at k has the slope 3 k - 2 s just before the clip.
  CHECK(limit("nlSpringDamper @m @g 0.01 0.5 p 0.1") == exactly(3.82 / 3.0));
  CHECK(limit("nlPluck @m @g p 0.1 0.1") == exactly(38.0));
  CHECK(limit("nlBow @m @g p 0.1") == exactly(3.0));
  CHECK(limit("nlBow @m @g p 0.1 1") == exactly(2.0 / 1.0387));
  CHECK(limit("nlBow @m @g p 0.1 -p") == exactly(2.0 / 1.0387));
  CHECK(limit("contact @m @g p 0.1 0.") == exactly(3.8));
  CHECK(limit("nlContact @m @g 0.01 0.5 p 0.1 0.") == exactly(3.82 / 3.0));
  CHECK(highest("@p param 0.01\n@o osc 2. p 0.1 0. 0.\n", "p") == exactly(7.8));
  CHECK(highest("@p param 0.01\n@o osc 2. 0.1 p 0. 0.\n", "p") == exactly(3.95));
  // Bows scale with the square root of the factor: 4 - t - 2 (2/3) sqrt(t) = 0.
  const Network bowed =
      network_of("@m mass 1. 0. 0.\n@g ground 0.\n@s spring @m @g 1\n@b nlBow @m @g 1 0.1\n");
  const double root = -2.0 / 3.0 + std::sqrt(4.0 / 9.0 + 4.0);
  CHECK(Stability(bowed, 1.0).stiffness_factor(as_written(bowed)) == exactly(root * root));
  // At half the step K counts a quarter and Z a half: 4 = K/4 + Z.
  const Network half = network_of("@p param 1.\n@o osc 1. p 0.1 0. 0.\n");
  CHECK(Stability(half, 0.5).safe_range(as_written(half), 0, 1.0)->highest == exactly(15.6));
}

TEST_CASE("a parameter's limit is found through formulas", "[stability]") {
  const auto osc = [](const std::string& mass, const std::string& stiffness) {
    return "@p param 0.3\n@o osc " + mass + " " + stiffness + " 0. 0. 0.\n";
  };
  CHECK(highest(osc("2.", "p*p"), "p") == exactly(std::sqrt(8.0)));
  CHECK(highest(osc("2.", "exp(p)"), "p") == exactly(std::log(8.0)));
  CHECK(highest(osc("2/p", "0.1"), "p") == exactly(80.0));
  CHECK(lowest(osc("2.", "0.1/p"), "p") == exactly(0.1 / 8.0));
  CHECK(lowest(osc("2*p", "0.1"), "p") == exactly(0.0125));
  CHECK(std::isinf(highest(osc("2.", "1+sin(p)"), "p")));
  // One argument grows while the other falls. Both are affine, so the result is exact here too.
  CHECK(highest("@p param 0.3\n@g ground 0.\n@a mass 1. 0. 0.\n@b mass 1. 0. 0.\n"
                "@l spring @g @a 8*p\n@n spring @g @b 3-p\n",
                "p") == exactly(0.5));
  // No value is stable, neither around the start nor on the other side of 0.
  const Network lost = network_of(
      "@p param 0.3\n@g ground 0.\n@a mass 1. 0. 0.\n"
      "@l spring @g @a p\n@n spring @g @a 5\n");
  CHECK_FALSE(Stability(lost, 1.0).safe_range(as_written(lost), 0, 0.3));
  CHECK(highest("@p param 9.\n@o osc 1. p 0. 0. 0.\n", "p") == exactly(4.0));
  const SafeRange below = range_of("@p param -1.\n@o osc 1. 0-p 0. 0. 0.\n", "p");
  CHECK(below.lowest == exactly(-4.0));
  CHECK(below.highest == 0.0);
  const SafeRange unused = range_of("@p param 1.\n@o osc 1. 0.1 0. 0. 0.\n", "p");
  CHECK((std::isinf(unused.lowest) && std::isinf(unused.highest)));
}

TEST_CASE("a proof holds for all values of the other parameters", "[stability]") {
  const Network network = network_of(scenes::string("s", 50, "0.1", "0.001"));
  const ParameterBox box{{0.5, 0.01, 0.0}, {4.0, 0.2, 0.01}};  // M, K, Z
  Stability stability(network, 1.0);
  const double top50 = top(std::numbers::pi / 102.0);
  CHECK(stability.prove(box) == Verdict::stable);
  CHECK(stability.safe_range(box, 0, 1.0)->lowest == exactly(0.22 * top50 / 4.0));
  CHECK(stability.safe_range(box, 1, 0.1)->highest == exactly(2.0 / top50 - 0.02));
  CHECK(stability.stiffness_factor(box) == exactly((2.0 / top50 - 0.02) / 0.2));
  const double edge = 2.0 / top50 - 0.02;
  CHECK(stability.prove({{0.5, 0.01, 0.0}, {4.0, edge - 1e-6, 0.01}}) == Verdict::stable);
  CHECK(stability.prove({{0.5, 0.01, 0.0}, {4.0, edge + 1e-6, 0.01}}) == Verdict::unstable);
}

TEST_CASE("a place on a string counts with the masses around it", "[stability]") {
  // A spring from 0 to a place between the first two of three masses, at a quarter of the way: 1/k
  // = g^T (4M - K)^-1 g with g = (3/4, 1/4, 0).
  const std::string model =
      "@k param 0.1\n@u param 0.3125\n@d string 5 1. 0.5 0. 0. 0.\n@g ground 0.\n";
  Eigen::MatrixXd rest(3, 3);
  rest << 3.0, 0.5, 0.0, 0.5, 3.0, 0.5, 0.0, 0.5, 3.0;
  const Eigen::Vector3d g(0.75, 0.25, 0.0);
  const double fixed = 1.0 / g.dot(support::inverse_of(rest) * g);
  CHECK(highest(model + "@l spring @g [@d 0.3125] k\n", "k") == exactly(fixed));
  // The bound: 1.6 and 1.2 at the ends of the worst link; live, the place's 0.8 at every mass.
  CHECK(factor_of(model + "@l spring @g [@d 0.3125] 0.8\n") ==
        Approx(bound_limit / 2.8).epsilon(1e-14));
  CHECK(factor_of(model + "@l spring @g [@d u] 0.8\n") == Approx(bound_limit / 3.6).epsilon(1e-14));
  // A moving place may be at any mass: the limit is at most what every single mass allows.
  const double live = highest(model + "@l spring @g [@d u] k\n", "k");
  for (int i = 0; i < 3; ++i) {
    CHECK(live <= 1.0 / support::inverse_of(rest)(i, i));
  }
  // The middle mass is the stiffest: exact, because no other moving link holds it.
  CHECK(live == Approx(1.0 / support::inverse_of(rest)(1, 1)).epsilon(2e-6));
}

TEST_CASE("links at places that move count at the worst of them", "[stability]") {
  // Two strings joined at moving places: x_a^2 and x_b^2 count twice each, and at most at one mass.
  Eigen::MatrixXd a(3, 3);
  a << 3.0, 0.5, 0.0, 0.5, 3.0, 0.5, 0.0, 0.5, 3.0;
  Eigen::MatrixXd b(2, 2);
  b << 3.4, 0.3, 0.3, 3.4;
  const double most = std::max(support::inverse_of(a)(1, 1), support::inverse_of(b)(0, 0));
  CHECK(highest("@k param 0.1\n@u param 0.3\n@v param 0.6\n@a string 5 1. 0.5 0. 0. 0.\n"
                "@b string 4 1. 0.3 0. 0. 0.\n@l spring [@a u] [@b v] k\n",
                "k") == Approx(0.5 / most).epsilon(2e-6));

  // Chains in a row, held at both ends and joined at places moved by audio. A sum over all nodes
  // would allow springs of 0.83 of this. The limit is never exceeded:
  const auto joined = [](const std::string& k, auto&& place) {
    std::string text = "@g ground 0.\n";
    for (int i = 1; i <= 4; ++i) {
      text += "@s" + show(i) + " chain 20 1. 0.6 0.001 0. 0.\n";
    }
    for (int i = 1; i <= 3; ++i) {
      text += "@j" + show(i) + " springDamper [@s" + show(i) + " " + place(2 * i - 1) + "] [@s" +
              show(i + 1) + " " + place(2 * i) + "] " + k + " 0.001\n";
    }
    return text + "@e springDamper @g [@s1 0.] 0.6 0.001\n@f springDamper [@s4 1] @g 0.6 0.001\n";
  };
  std::string sound = "@k param 0.6\n";
  for (int i = 1; i <= 6; ++i) {
    sound += "@p" + show(i) + " audioParam @in" + show(i) + "\n";
  }
  sound += joined("k", [](int i) { return "p" + show(i); });
  const Network network = network_of(sound);
  CHECK(Stability(network, 1.0).prove(as_written(network)) == Verdict::stable);
  const double k = highest(sound, "k");
  CHECK(k > 0.6);
  support::Random random(11);
  for (int i = 0; i < 200; ++i) {
    const bool is_one = i % 4 == 0;  // All at the same mass.
    const std::string same = show(random.uniform(0.0, 1.0));
    const Network fixed = network_of(
        joined(show(k), [&](int) { return is_one ? same : show(random.uniform(0.0, 1.0)); }));
    CHECK(Stability(fixed, 1.0).prove(as_written(fixed)) == Verdict::stable);
  }
  // A link that may be unstable at some places is not reported; one that is unstable everywhere is.
  const auto verdict = [&](const std::string& stiff) {
    const Network other =
        network_of(sound.substr(sound.find('\n') + 1).insert(0, "@k param " + stiff + "\n"));
    return Stability(other, 1.0).prove(as_written(other));
  };
  CHECK(verdict(show(1.05 * k)) == Verdict::unproved);
  CHECK(verdict("2.6") == Verdict::unstable);
}

TEST_CASE("the culprit is named with its line and its limit", "[stability]") {
  const std::string pair = "@m0 mass 1. 0. 0.\n@m1 mass 1. 0. 0.\n@g ground 0.\n";
  CHECK(complaint_of(pair + "@r spring @m0 @m1 1.9") == "");
  CHECK(complaint_of(pair + "@r spring @m0 @m1 2.5") ==
        "4: unstable: the stiffness 2.5 of 'r' must stay below 2");
  CHECK(complaint_of(pair + "@r springDamper @m0 @m1 0.5 1.2") ==
        "4: unstable: the damping 1.2 of 'r' must stay below 0.75");
  // One stiff link in a soft string, which is stable without it.
  CHECK(complaint_of(scenes::string("s", 10, "0.1", "0.") + "@x spring @s_m3 @s_m4 5\n")
            .find("27: unstable: the stiffness 5 of 'x' must stay below 1.8") == 0);
  // A light mass between soft springs: 4m > k + k.
  CHECK(complaint_of("@g ground 0.\n@m mass 0.01 0. 0.\n@a spring @g @m 0.1\n"
                     "@b spring @g @m 0.1\n@c spring @g @m 0.1\n") ==
        "2: unstable: the mass 0.01 of 'm' must stay above 0.075");
  // If reducing one spring is enough, that spring is named.
  CHECK(complaint_of("@g ground 0.\n@m mass 0.1 0. 0.\n@a spring @g @m 0.1\n"
                     "@b spring @g @m 0.15\n@c spring @g @m 0.2\n") ==
        "5: unstable: the stiffness 0.2 of 'c' must stay below 0.15");
  // An argument used several times is named once.
  CHECK(complaint_of("@K param 1.5\n" + pair + "@a spring @m0 @m1 2*K\n@b spring @g @m0 2*K\n") ==
        "5: unstable: the stiffness 2*K = 3 of 'a' and 1 more must stay below 1.52786");
  CHECK(complaint_of("@d string 50 1. 1.2 0.01 0. 0.\n@out1 posOutput [@d 0.5]\n") ==
        "1: unstable: the stiffness 1.2 of 'd' must stay below 0.981028");
  CHECK(complaint_of(pair + "@a spring @g @m0 5\n@b spring @g @m1 6\n") ==
        "5: unstable: the stiffness 6 of 'b' is too large, but no value of it alone is enough: "
        "reduce all stiffness and damping to 0.666666 of their values");
  CHECK(complaint_of("@o osc 1. 5. 0. 0. 0.\n") ==
        "1: unstable: the stiffness 5 of 'o' must stay below 4");
  CHECK(complaint_of("@M param 0.\n" + pair + "@m2 mass M 0. 0.\n") ==
        "5: unstable: the mass M = 0 of 'm2' must be above 0");
  CHECK(complaint_of("@p param 0.\n" + pair + "@r spring @m0 @m1 1/p\n").find("is not finite") !=
        std::string::npos);
}

TEST_CASE("negative springs are stable if others compensate them", "[stability]") {
  const std::string pair = "@m0 mass 1. 0. 0.\n@m1 mass 1. 0. 0.\n";
  CHECK(complaint_of(pair + "@a spring @m0 @m1 0.3\n@b spring @m0 @m1 -0.2\n") == "");
  CHECK(
      complaint_of(pair + "@a spring @m0 @m1 0.2\n@b spring @m0 @m1 -0.3\n") ==
      "4: may be unstable: the stiffness -0.3 of 'b' is negative, so motion can grow without end");
  CHECK(complaint_of(pair + "@a springDamper @m0 @m1 0.2 -0.1\n") ==
        "3: may be unstable: the damping -0.1 of 'a' is negative, so motion can grow without end");
}

TEST_CASE("a link on a waveguide is stable unless it is negative", "[stability]") {
  const std::string held =
      "@K param 0.1\n@w waveguide 1. 220. 3. 0.4 0.\n@m mass 1. 0. 0.\n@g ground 0.\n";
  CHECK(complaint_of(held + "@a spring @m [@w 0.3] 1e6 1e6\n@b contact @g [@w 0.6] 1e6 1.\n") ==
        "");
  CHECK(complaint_of(held + "@a spring @m [@w 0.3] -K 0.1\n") ==
        "5: may be unstable: the stiffness -K = -0.1 of 'a' is negative, so motion can "
        "grow without end");
  CHECK(complaint_of(held + "@a damper @g [@w 0.3] -1.5\n") ==
        "5: may be unstable: the damping -1.5 of 'a' is negative, so motion can grow without end");
  // A spring elsewhere does not compensate a negative one.
  CHECK(
      complaint_of(held + "@a spring @m [@w 0.3] -0.1\n@b spring @m @g 0.5\n") ==
      "5: may be unstable: the stiffness -0.1 of 'a' is negative, so motion can grow without end");
  const SafeRange range = range_of(held + "@a spring @m [@w 0.3] K\n", "K");
  CHECK(range.lowest == 0.0);
  CHECK(std::isinf(range.highest));
}

TEST_CASE("networks too large to factor are proved by the bound or not at all", "[stability]") {
  const auto verdict = [](const std::string& stiffness) {
    const Network network = network_of("@d mesh 201 200 1. " + stiffness + " 0. 0. 0.\n");
    return Stability(network, 1.0).certify(as_written(network)).verdict;
  };
  CHECK(verdict("0.49") == Verdict::stable);  // 8 K < 4
  CHECK(verdict("0.51") == Verdict::unproved);
  const SafeRange bound = range_of("@K param 0.1\n@d mesh 201 200 1. K 0. 0. 0.\n", "K");
  CHECK(bound.highest <= 0.5);
  CHECK(bound.highest > 0.499);
}

TEST_CASE("limits are rounded to the safe side", "[stability]") {
  CHECK(print_limit(1.31568650461023, true) == "1.31568");
  CHECK(print_limit(0.0889851164104615, false) == "0.0889852");
  CHECK(print_limit(4.0 - 1e-13, true) == "4");
  CHECK(print_limit(123456789.0, true) == "123456000");
  CHECK(print_limit(-1.31568650461023, false) == "-1.31568");
}

TEST_CASE("a formula's range holds all its values", "[stability]") {
  const std::vector<std::string> names{"p", "q"};
  const auto range = [&](const std::string& text, double from, double to) {
    const auto formula = parse_expression(text, names);
    REQUIRE(formula);
    return formula_range(*formula, {{from, 2.0}, {to, 3.0}});
  };
  // Exact if each parameter occurs once.
  CHECK(range("q-p", 1.0, 1.5).lowest == 0.5);
  CHECK(range("q-p", 1.0, 1.5).highest == 2.0);
  CHECK(range("q/p", 0.5, 1.0).highest == 6.0);
  CHECK(range("pow(p,2)", -1.0, 2.0).lowest == 0.0);
  CHECK(range("pow(p,2)", -1.0, 2.0).highest == 4.0);
  CHECK(range("sin(p)", 1.0, 2.0).highest == 1.0);
  CHECK(range("cos(p)", 3.0, 4.0).lowest == -1.0);
  CHECK(range("abs(p)", -1.0, 0.5).lowest == 0.0);
  CHECK(range("clamp(p,0.4,0.5)", 0.0, 1.0).highest == 0.5);
  CHECK(std::isinf(range("1/p", -1.0, 1.0).highest));
  CHECK(std::isinf(range("sqrt(p)", -1.0, 1.0).highest));
  // Otherwise slightly wide, and never too narrow.
  for (const std::string text : {"p*p-p", "p/(1+p)", "p*exp(0-p)", "max(p,q)*sqrt(p)*p",
                                 "sin(3*p)*cos(2*p)", "min(p,1)/(p+q)"}) {
    const Range found = range(text, 0.0, 2.0);
    const auto formula = parse_expression(text, names);
    double least = 1e9;
    double most = -1e9;
    for (int i = 0; i <= 1000; ++i) {
      for (const double q : {2.0, 2.4, 3.0}) {
        const double value = evaluate(*formula, std::array{i / 500.0, q});
        least = std::min(least, value);
        most = std::max(most, value);
      }
    }
    INFO(text << ": " << show(found.lowest) << " to " << show(found.highest));
    CHECK(found.lowest <= least);
    CHECK(found.highest >= most);
    CHECK(found.highest - found.lowest < (most - least) * 1.2);
  }
}

}  // namespace ressort::stability_test
