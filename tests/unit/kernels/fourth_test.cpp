// The fourth-order form against the continuous network, which is known in closed form.
#include <deque>

#include "core/compile/plan.h"
#include "core/kernels/direct/fourth_form.h"
#include "tests/support/comparison.h"
#include "tests/support/poles.h"

namespace ressort::fourth_test {
namespace {

using support::Bare;
using support::Comparison;
using support::Continuous;
using support::isas;
using support::network_of;
using support::program_of;
using support::show;

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
  const Program program = support::program_of(scenes::triangle("0.1", "0.001"));
  const auto expected = support::continuous_poles(support::matrices_of(program));
  const auto published = support::poles_of(support::transition(program));
  const auto found =
      support::poles_of(support::transition(fourth(scenes::triangle("0.1", "0.001"))));
  REQUIRE(expected.size() == 3);
  REQUIRE(found.size() == 3);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto cents = [&](const support::Pole& pole) {
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
      const double radius = support::spectral_radius(support::transition(program));
      CHECK((beyond < 0.0 ? radius <= 1.0 + 1e-12 : radius > 1.0 + 1e-6));
    }
  }
}

// Five masses, every two of them linked by a spring and damper of their own.
std::string knot(support::Random& random, double scale) {
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
      support::Random random(seed);
      const auto matrices = support::matrices_of(program_of(knot(random, scale)));
      const Eigen::VectorXd root = matrices.mass.cwiseSqrt().cwiseInverse();
      const Eigen::MatrixXd both = matrices.stiffness + 2.0 * matrices.damping;
      return support::eigenbasis_of(root.asDiagonal() * both * root.asDiagonal()).values.maxCoeff();
    };
    support::Random random(seed);
    Program program = program_of(knot(random, 3.999 / steepest(1.0)));
    INFO("seed " << seed);
    CHECK(support::spectral_radius(support::transition(program)) < 1.0);
    Fourth form;
    for (std::uint32_t run = 0; run < program.link_runs.size(); ++run) {
      form.springs.push_back({run, program.link_runs[run].first, program.link_runs[run].count});
    }
    program.form = form;
    CHECK(support::spectral_radius(support::transition(program)) < 1.0);
  }
}

// A force that rises and stays, on a body at rest, and what it does in the long run and on the way.
TEST_CASE("a force moves the fourth-order form as the continuous network", "[fourth]") {
  const std::string text = scenes::string("s", 20, "0.2", "0.002") + "@in1 frcInput @s_m4\n" +
                           scenes::output(1, "s_m11");
  // The same at 16 times the rate is 2^16 times nearer, and so is the reference.
  constexpr std::size_t finer = 16;
  constexpr std::size_t frames = 4000;
  const auto force = [](double t) {  // smooth, and long beside a sample
    return 0.01 * (1.0 - std::cos(2.0 * std::numbers::pi * t / 97.0)) * std::exp(-t / 400.0);
  };
  // A force's sample acts between its own tick and the one before.
  const auto perform = [&](const Program& program, std::size_t steps) {
    Bare<double> bare(program);
    std::vector<double> out;
    const double pace = static_cast<double>(steps);
    for (std::size_t n = 1; n <= frames * steps; ++n) {
      const double x = bare.step({force((static_cast<double>(n) - 1.0) / pace) / (pace * pace)})[0];
      if (n % steps == 0) {
        out.push_back(x);
      }
    }
    return out;
  };
  const auto reference =
      perform(formed(make_program(network_of(text), 44100.0 * finer, true)), finer);
  const Program program = program_of(text);
  Comparison published;
  Comparison found;
  const auto plain = perform(program, 1);
  const auto corrected = perform(formed(program), 1);
  for (std::size_t n = 0; n < frames; ++n) {
    published.add(reference[n], plain[n]);
    found.add(reference[n], corrected[n]);
  }
  INFO(found.snr_db() << " dB, as published " << published.snr_db());
  CHECK(found.snr_db() > published.snr_db() + 20.0);
  CHECK(found.snr_db() > 55.0);
}

TEST_CASE("every instruction set and precision is of fourth order alike", "[fourth]") {
  const Program program = struck(string50(), Network::reference_rate_hz, 13);
  const double expected = nearness_db(formed(program), Isa::base);
  for (const Isa isa : isas()) {
    INFO(isa_name(isa));
    CHECK(std::fabs(nearness_db<double>(formed(program), isa) - expected) < 1e-3);
    CHECK(std::fabs(nearness_db<float>(formed(program), isa) - expected) < 0.1);
  }
}

// What turns, at any pitch, and whatever else pulls: nearer to the same at a higher rate than the
// published scheme is.
TEST_CASE("the fourth-order form follows what is turned and touched", "[fourth]") {
  const std::string text = scenes::string("s", 16, "0.1", "0.004") +
                           "@o osc 2. 0.02 0.001 0. 0.\n@c springDamper @o @s_m9 0.05 0.001\n"
                           "@in1 frcInput @s_m3\n@in2 posInput 0.\n"
                           "@h springDamper @in2 @s_m12 0.05 0.003\n"
                           "@b nlSpring3 @s_m2 @o 0.01 0.05 0.001\n" +
                           scenes::output(1, "s_m6") + scenes::output(2, "o");
  const Program program = program_of(text);
  for (const bool turns : {false, true}) {
    for (const double pitch : {1.0, 0.6}) {
      const support::ComparisonOptions options{.frames = 8000,
                                               .push = 0.001,
                                               .lowest_hz = 5.0,
                                               .highest_hz = 60.0,
                                               .turns = turns,
                                               .pitch = pitch};
      const support::Score score = support::score_of(program, options);
      const auto expected = support::perform<double>(formed(program), score, Isa::base);
      const auto published = support::perform_directly(program, score);
      for (const Isa isa : isas()) {
        INFO(isa_name(isa) << (turns ? ", turning" : ", steady") << " at pitch " << pitch);
        for (const Comparison& output :
             support::compare(2, expected, support::perform<double>(formed(program), score, isa))) {
          CHECK(output.relative() < 1e-12);
        }
        for (const Comparison& output :
             support::compare(2, expected, support::perform<float>(formed(program), score, isa))) {
          CHECK(output.snr_db() > 85.0);
        }
      }
      for (const Comparison& output : support::compare(2, expected, published)) {
        INFO("published: " << output.snr_db() << " dB");
        CHECK(output.peak > 1e-4);
        CHECK(output.snr_db() < 60.0);  // another scheme indeed
        CHECK(output.snr_db() > 0.0);   // of the same network
      }
    }
  }
}

// Points have no inertia: links at them are added as published.
TEST_CASE("points on macros are held in the fourth-order form", "[fourth]") {
  const std::string text =
      "@k param 0.05\n@u param 0.3\n@s string 24 1. k 0.003 0. 0.\n@t string 20 1. k 0.003 0. 0.\n"
      "@in1 frcInput [@s u]\n@j springDamper [@s 0.8] [@t 1-u] 0.03 0.001\n"
      "@out1 posOutput [@t u]\n";
  const Program program = program_of(text);
  const support::Score score =
      support::score_of(program, {.frames = 4000, .push = 0.001, .turns = true});
  const auto expected = support::perform_directly(program, score);
  for (const Isa isa : isas()) {
    const auto found = support::perform<double>(formed(program), score, isa);
    const Comparison output = support::compare(1, expected, found)[0];
    INFO(output.snr_db() << " dB from the published scheme");
    CHECK(output.snr_db() > 10.0);
    CHECK(output.snr_db() < 60.0);
  }
}

TEST_CASE("voices side by side are of fourth order each", "[fourth]") {
  const Program program = formed(program_of(string50() + "@in1 frcInput @s_m4\n"));
  for (const Isa isa : isas()) {
    Bare<double> all(program, 8, isa);
    std::deque<Bare<double>> alone;
    for (std::size_t lane = 0; lane < all.lanes(); ++lane) {
      alone.emplace_back(program, 1, isa);
      const double factor = 1.0 - 0.1 * static_cast<double>(lane);
      all.set_coefficients(lane, program.parameters, factor, false);
      alone[lane].set_coefficients(0, program.parameters, factor, false);
    }
    for (std::size_t n = 0; n < 500; ++n) {
      for (std::size_t lane = 0; lane < all.lanes(); ++lane) {
        const double force = n == 3 * lane ? 0.01 : 0.0;
        all.feed(lane, 0, force);
        alone[lane].feed(0, 0, force);
      }
      all.run(0);
      for (std::size_t lane = 0; lane < all.lanes(); ++lane) {
        CHECK(all.outputs(lane)[0] == alone[lane].run(0)[0]);
      }
    }
  }
}

TEST_CASE("a budget for pitch or decay gets the fourth-order form where it is needed", "[fourth]") {
  const auto method_for = [](const std::string& text, const Budget& budget) {
    const Machine machine = make_machine(network_of(text), Network::reference_rate_hz, true);
    return make_plan(machine, {}, {}, 0, budget).parts.at(0).method;
  };
  const std::string touched =
      string50() + "@in1 posInput 1.\n@c contact @s_m9 @in1 0.01 0.01 0.01\n";
  const std::string heavy =
      "@m mass 1. 0. 0.\n@n mass 0.001 0. 0.\n@o mass 1. 0. 0.\n"
      "@g ground 0.\n@s springDamper @m @n 1. 0.\n"
      "@t springDamper @o @m 1. 0.\n@u springDamper @o @g 1. 0.\n@in1 frcInput @m\n" +
      scenes::output(1, "m");
  CHECK(method_for(touched, {}) != Method::fourth);
  CHECK(method_for(touched, {.cents = 100.0}) != Method::fourth);
  CHECK(method_for(touched, {.cents = 3.0}) == Method::fourth);
  CHECK(method_for(touched, {.t60_percent = 1.0}) != Method::fourth);
  CHECK(method_for(touched, {.t60_percent = 0.01}) == Method::fourth);
  CHECK(method_for(heavy, {.cents = 3.0}) != Method::fourth);  // K + 6Z > 12M
}

}  // namespace ressort::fourth_test
