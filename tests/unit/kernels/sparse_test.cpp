// The kernel for what has no order: who is looked up by whom, and the same sound as without it.
#include <algorithm>
#include <string>
#include <vector>

#include "core/compile/plan.h"
#include "core/kernels/sparse/sparse_form.h"
#include "tests/support/duel.h"

namespace ressort {
namespace {

using rig::Comparison;
using rig::DuelOptions;
using rig::program_of;
using rig::Random;
using rig::same_as_direct;
using rig::show;

Program formed(const std::string& text) {
  Program program = program_of(text);
  std::optional<Sparse> sparse = sparse_form(program);
  REQUIRE(sparse);
  program.form = std::move(*sparse);
  return program;
}

const Sparse& sparse_of(const Program& program) {
  return std::get<Sparse>(program.form);
}

// Masses m0, m1... and `links` between any two of them; each link is one of `laws`, in turn.
std::string graph(int masses, int links, const std::vector<std::string>& laws, Random& random) {
  std::string text = "@K param 0.03\n@Z param 0.002\n";
  for (int i = 0; i < masses; ++i) {
    text += scenes::at("m", i) + (i % 5 == 4 ? " mass 2. 0. 0.\n" : " mass 1. 0. 0.\n");
  }
  for (int i = 0; i < links; ++i) {
    const auto count = static_cast<std::size_t>(masses);
    const std::size_t a = i < masses ? static_cast<std::size_t>(i) : random.below(count);
    const std::size_t b = (a + 1 + random.below(count - 1)) % count;
    std::string law = laws[static_cast<std::size_t>(i) % laws.size()];
    law.insert(law.find(' '), " " + scenes::at("m", static_cast<int>(a)) + " " +
                                  scenes::at("m", static_cast<int>(b)));
    text += scenes::at("l", i) + " " + law + "\n";
  }
  return text;
}

const std::string hands =
    "@g ground 0.1\n@hold springDamper @g @m3 0.01 0.001\n@in1 frcInput @m1\n"
    "@out1 posOutput @m1\n@out2 posOutput @m7\n";

}  // namespace

TEST_CASE("springs that are most are summed by y, anything else has an owner that moves",
          "[sparse]") {
  Random random(5);
  const Program program = formed(graph(30, 40, {"springDamper K Z"}, random) + hands +
                                 "@c1 nlSpring3 @g @m2 .1 .1 0\n@c2 nlSpring3 @m2 @m4 .1 .1 0\n"
                                 "@c3 nlSpring3 @m2 @m5 .1 .1 0\n@c4 nlSpring3 @m6 @m2 .1 .1 0\n");
  const Sparse& sparse = sparse_of(program);
  REQUIRE(sparse.springs != Sparse::none);
  CHECK(program.link_runs[sparse.springs].count == 40);
  REQUIRE(sparse.rest.size() == 2);  // the one spring to the ground, and the cubic ones
  CHECK(sparse.rest[0].size() == 1);
  CHECK(sparse.rest[0][0].is_reversed);
  REQUIRE(sparse.rest[1].size() == 4);
  std::vector<int> owned(program.position.size());
  for (const SparseLink& link : sparse.rest[1]) {
    const Ends ends = program.ends[link.link];
    ++owned[link.is_reversed ? ends.b : ends.a];
  }
  // What hangs on the ground falls to m_2, all others to the masses around it.
  std::sort(owned.rbegin(), owned.rend());
  CHECK(owned[0] == 1);
  CHECK(owned[3] == 1);
  std::vector<std::uint32_t> order = sparse.order;
  std::sort(order.begin(), order.end());
  for (std::uint32_t i = 0; i < 30; ++i) {
    REQUIRE(order[i] == i);
  }
}

TEST_CASE("masses with as many links are side by side", "[sparse]") {
  std::string text = "@hub mass 1. 0. 0.\n@out1 posOutput @hub\n";
  for (int i = 0; i < 20; ++i) {
    text += scenes::at("m", i) + " mass 1. 0. 0.\n" + scenes::at("s", i) + " springDamper @hub " +
            scenes::at("m", i) + " 0.01 0.001\n";
  }
  const Program program = formed(text);
  CHECK(sparse_of(program).order[0] == 0);  // twenty springs; then those with one
  CHECK(sparse_of(program).rest.empty());
}

TEST_CASE("linear networks sound the same in any order", "[sparse]") {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    Random random(seed);
    const int masses = 10 + static_cast<int>(random.below(120));
    const int links = masses + static_cast<int>(random.below(static_cast<std::size_t>(masses) * 3));
    INFO("seed " << seed << ": " << masses << " masses, " << links << " links");
    const auto options = [&](bool turns) {
      return DuelOptions{.frames = 4410, .seed = seed, .turns = turns, .pitch = 0.8};
    };
    same_as_direct(formed(graph(masses, links, {"springDamper K Z"}, random) + hands),
                   options(true), 1e-12, 100.0);
    // Of three kinds none is most.
    const Program mixed =
        formed(graph(masses, 3 * links, {"springDamper K Z", "spring .02", "springDamper .01 .01"},
                     random) +
               "@few spring @m1 @m2 .03\n" + hands);
    CHECK(sparse_of(mixed).springs == Sparse::none);
    same_as_direct(mixed, options(true), 1e-12, 100.0);
  }
}

TEST_CASE("any law may be on any link", "[sparse]") {
  const std::vector<std::string> law = GENERATE(values<std::vector<std::string>>(
      {{"nlSpring2 K 0.05 Z"},
       {"nlSpring3 K 0.05 Z"},
       {"nlSpringDamper 0.02 0.05 K Z"},
       {"contact K Z 0.3"},
       {"nlContact 0.02 0.05 K Z 0.3"},
       {"nlPluck K 4. Z"},
       {"nlBow Z 0.5"},
       {"nlBow Z 0.5 1"},
       // As many runs as links, and all laws in one network.
       {"nlSpring3 K*1.1 0.05 Z", "nlSpring3 K*1.2 0.05 Z", "nlSpring3 .01 0.04 .001"},
       {"nlSpring3 K 0.05 Z", "contact K Z 0.3", "springDamper K Z", "nlBow Z 0.5",
        "nlContact 0.02 0.05 K Z 0.3", "nlSpring2 .01 .05 0", "nlSpringDamper 0.02 0.05 K Z"}}));
  INFO(law[0]);
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    INFO("seed " << seed);
    Random random(seed);
    const int masses = 10 + static_cast<int>(random.below(60));
    const Program program = formed(graph(masses, 2 * masses, law, random) + hands);
    same_as_direct(program,
                   {.frames = 2205, .seed = seed, .reach = 0.02, .turns = true, .pitch = 1.1},
                   1e-12, 80.0);
  }
}

TEST_CASE("oscillators, gravity, hands and forces that are heard are as in the direct form",
          "[sparse]") {
  Random random(9);
  const std::string text =
      graph(40, 90, {"springDamper K Z", "nlSpring3 K 0.05 Z", "springDamper K Z"}, random) +
      hands +
      "@o1 osc 2. K 0.001 0. 0.\n@o2 osc 1. 0.02 Z 0. 0.\n@w massG 1. 0.0001 0. 0.\n"
      "@t1 springDamper @o1 @m5 K Z\n@t2 springDamper @m6 @o2 K Z\n@t3 spring @w @m7 0.02\n"
      "@in2 posInput 0.2\n@in3 frcInput @o1\n@in4 frcInput @o1\n"
      "@t4 springDamper @in2 @m8 K Z\n@t5 nlSpring3 @m9 @in2 .02 .05 0\n"
      "@out3 posOutput @in2\n@out4 frcOutput @in2\n@out5 frcOutput @o1\n@out6 frcOutput @g\n"
      "@out7 frcOutput @m1\n@out8 posOutput @w\n@out9 posOutput @o2\n";
  same_as_direct(formed(text), {.frames = 4410, .turns = true, .pitch = 0.9}, 1e-12, 90.0);
}

TEST_CASE("a stiffness that audio gives acts sample by sample, on every form of link", "[sparse]") {
  Random random(4);
  const std::string text =
      "@A audioParam @in2\n" +
      graph(20, 60,
            {"springDamper A Z", "nlSpring3 A 0.05 Z", "springDamper A Z", "nlSpring3 A 0.06 Z"},
            random) +
      hands;
  const Program program = formed(text);
  REQUIRE_FALSE(program.audio_coefficients.empty());
  same_as_direct(program, {.frames = 1920}, 1e-12, 100.0);
}

TEST_CASE("a network without order begins again as it began, from wherever it is put", "[sparse]") {
  Random random(2);
  const Program program =
      formed(graph(30, 80, {"springDamper K Z", "nlSpring3 K 0.05 Z"}, random) + hands);
  rig::Bare<double> bare(program);
  const auto play = [&] {
    std::vector<std::vector<double>> heard;
    for (int n = 0; n < 101; ++n) {
      heard.push_back(bare.step({n == 0 ? 1.0 : 0.0}));
    }
    return heard;
  };
  const auto first = play();
  CHECK_FALSE(bare.kernel().is_near_start(0, 1e-3));
  bare.kernel().reset(0);
  CHECK(bare.kernel().is_near_start(0, 1e-12));
  REQUIRE(play() == first);
  std::vector<double> x(program.position.size());
  std::vector<double> v(x.size());
  REQUIRE(bare.kernel().save(0, x.data(), v.data()));
  bare.kernel().place(0, x.data(), v.data());
  const auto second = play();
  bare.kernel().place(0, x.data(), v.data());
  REQUIRE(play() == second);
  CHECK(second != first);
}

TEST_CASE("what is too small, or hears what nobody computes, is not taken", "[sparse]") {
  Random random(3);
  CHECK_FALSE(sparse_form(program_of(scenes::poly_triangle())));
  CHECK_FALSE(sparse_form(program_of("@s mesh 20 20 1. .1 .001 0.\n@out1 posOutput [@s .3 .4]\n")));
  const std::string text = graph(20, 60, {"springDamper K Z"}, random) + hands +
                           "@in2 posInput 0.\n@c contact @in2 @g .1 .01 0.\n";
  CHECK(sparse_form(program_of(text)));
  CHECK_FALSE(sparse_form(program_of(text + "@out3 frcOutput @in2\n")));
}

TEST_CASE("a large network without order is planned to be one", "[sparse]") {
  Random random(8);
  const auto chosen = [](const std::string& text) {
    Machine machine = make_machine(rig::network_of(text), 44100.0, true);
    return make_plan(machine, {.isa = Isa::v3}).parts.at(0).method;
  };
  CHECK(chosen(graph(1000, 3000, {"springDamper K Z"}, random) + hands) == Method::sparse);
  CHECK(chosen(graph(60, 150, {"nlSpring3 K 0.05 Z"}, random) + hands) == Method::sparse);
}

}  // namespace ressort
