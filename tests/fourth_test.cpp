// The fourth-order form against the continuous network, which is known in closed form.
#include "core/compile/fourth_form.h"
#include "tests/duel.h"
#include "tests/poles.h"

namespace ressort {
namespace {

using rig::Bare;
using rig::Comparison;
using rig::Continuous;
using rig::isas;
using rig::network_of;
using rig::program_of;
using rig::show;

Program formed(Program program) {
  auto form = fourth_form(program);
  REQUIRE(form);
  program.form = *std::move(form);
  return program;
}

Program fourth(const std::string& text) {
  return formed(program_of(text));
}

// A blow on one mass; heard at another.
Program struck(const std::string& text, double rate_hz, std::uint32_t node) {
  Program program = make_program(network_of(text), rate_hz, true);
  program.velocity[node] = 0.01 * program.rate_ratio;
  return program;
}

// How near the kernel's output is to the continuous network for a second.
template <class T = double>
double nearness_db(const Program& program, Isa isa = best_isa()) {
  const auto frames = static_cast<std::size_t>(program.rate_hz);
  const std::vector<double> expected = Continuous(program).at(program.outputs[0].node, frames + 1);
  Bare<T> bare(program, 1, isa);
  Comparison comparison;
  for (std::size_t n = 1; n <= frames; ++n) {
    comparison.add(expected[n], bare.step({})[0]);
  }
  return comparison.snr_db();
}

std::string string50() {
  return scenes::string("s", 50, "0.1", "0.001") + scenes::output(1, "s_m37");
}

struct Scene {
  const char* name;
  std::string text;
  std::uint32_t node;
  double published_db;  // as measured: what the scheme is to improve on
  double wanted_db;
};

std::vector<Scene> linear_scenes() {
  return {{"string of 50", string50(), 13, 19.8, 60.0},
          {"mesh of 20x30",
           scenes::square_mesh("m", 20, 30, "0.1", "0.01") + scenes::output(1, "m_m13_17"), 65,
           38.5, 65.0},
          {"string of 150", scenes::string("s", 150, "0.3", "0.001") + scenes::output(1, "s_m40"),
           30, 13.5, 40.0}};
}

}  // namespace

TEST_CASE("fourth order comes near to the continuous network", "[fourth]") {
  for (const Scene& scene : linear_scenes()) {
    const Program program = struck(scene.text, Network::reference_rate_hz, scene.node);
    const double published = nearness_db(program);
    const double found = nearness_db(formed(program));
    INFO(scene.name << ": " << found << " dB, as published " << published);
    CHECK(found >= scene.wanted_db);
    CHECK(std::fabs(published - scene.published_db) < 6.0);
  }
}

TEST_CASE("halving the time step gains 24 dB", "[fourth]") {
  struct Case {
    const char* damping;
    double rate_hz;  // where the fastest modes, which never decay, are near enough to count
  };
  for (const auto& [damping, slowest_hz] : {Case{"0.0", 88200.0}, Case{"0.001", 44100.0}}) {
    const std::string text = scenes::string("s", 50, "0.1", damping) + scenes::output(1, "s_m37");
    double before = 0.0;
    for (const double rate_hz : {slowest_hz, 2.0 * slowest_hz, 4.0 * slowest_hz}) {
      const double found = nearness_db(formed(struck(text, rate_hz, 13)));
      INFO(rate_hz << " Hz, Z = " << damping << ": " << found << " dB after " << before);
      CHECK((before == 0.0 || found >= before + 22.0));
      before = found;
    }
  }
}

TEST_CASE("dampers that are not in proportion to the springs are as near", "[fourth]") {
  const Program program = rig::program_of(scenes::triangle("0.1", "0.001"));
  const auto expected = rig::continuous_poles(rig::matrices_of(program));
  const auto published = rig::poles_of(rig::transition(program));
  const auto found = rig::poles_of(rig::transition(fourth(scenes::triangle("0.1", "0.001"))));
  REQUIRE(expected.size() == 3);
  REQUIRE(found.size() == 3);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto cents = [&](const rig::Pole& pole) {
      return std::fabs(1200.0 * std::log2(pole.hertz / expected[i].hertz));
    };
    INFO("mode " << i << ": " << cents(found[i]) << " cents, as published " << cents(published[i]));
    CHECK(cents(found[i]) <= 0.5);
    CHECK(cents(published[i]) > 2.0);
    CHECK(std::fabs(found[i].t60_s / expected[i].t60_s - 1.0) < 1e-3);
  }
}

TEST_CASE("fourth order is stable up to K + 6Z = 12M, and no farther", "[fourth]") {
  for (const double z : {0.0, 0.1, 0.5, 1.0, 1.5}) {
    for (const double beyond : {-1e-5, 1e-5}) {
      const double k = (12.0 - 6.0 * z) * (1.0 + beyond);
      const std::string text = "@m mass 1. 0. 0.\n@g ground 0.\n@s springDamper @m @g " + show(k) +
                               " " + show(z) + "\n" + scenes::output(1, "m");
      Program program = program_of(text);
      INFO("K = " << k << ", Z = " << z);
      CHECK(fourth_form(program).has_value() == (beyond < 0.0));
      program.form = Fourth{.springs = {{.run = 0, .first = 0, .count = 1}}, .others = {}};
      const double radius = rig::spectral_radius(rig::transition(program));
      CHECK((beyond < 0.0 ? radius <= 1.0 + 1e-12 : radius > 1.0 + 1e-6));
    }
  }
}

// Five masses, every two of them linked by a spring and damper of their own.
std::string knot(rig::Random& random, double scale) {
  std::string text = "@g ground 0.\n";
  for (int i = 0; i < 5; ++i) {
    text += scenes::at("m", i) + " mass " + show(random.uniform(0.2, 2.0)) + " 0. 0.\n";
  }
  for (int i = 0; i < 5; ++i) {
    for (int j = i + 1; j <= 5; ++j) {
      text += scenes::at("s", i, j) + " springDamper " + scenes::at("m", i) + " " +
              (j == 5 ? "@g" : scenes::at("m", j)) + " " + show(scale * random.uniform(0.0, 1.0)) +
              " " + show(scale * std::pow(random.uniform(0.0, 1.0), 4)) + "\n";
    }
  }
  return text + scenes::output(1, "m0");
}

TEST_CASE("what is stable as published is so to fourth order", "[fourth]") {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const auto steepest = [&](double scale) {
      rig::Random random(seed);
      const auto matrices = rig::matrices_of(program_of(knot(random, scale)));
      const Eigen::VectorXd root = matrices.mass.cwiseSqrt().cwiseInverse();
      const Eigen::MatrixXd both = matrices.stiffness + 2.0 * matrices.damping;
      return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(root.asDiagonal() * both *
                                                            root.asDiagonal())
          .eigenvalues()
          .maxCoeff();
    };
    rig::Random random(seed);
    Program program = program_of(knot(random, 3.999 / steepest(1.0)));
    INFO("seed " << seed);
    CHECK(rig::spectral_radius(rig::transition(program)) < 1.0);
    Fourth form;
    for (std::uint32_t run = 0; run < program.link_runs.size(); ++run) {
      form.springs.push_back({run, program.link_runs[run].first, program.link_runs[run].count});
    }
    program.form = form;
    CHECK(rig::spectral_radius(rig::transition(program)) < 1.0);
  }
}

}  // namespace ressort
