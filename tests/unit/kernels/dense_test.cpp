// The dense kernel: what it takes, motions that are known by hand, and the direct kernel's sound.
#include <functional>

#include "core/kernels/dense/dense.h"
#include "core/kernels/dense/dense_form.h"
#include "tests/support/comparison.h"

namespace ressort::dense_test {
namespace {

using support::compare_kernels;
using support::Comparison;
using support::ComparisonOptions;
using support::Fighter;
using support::program_of;
using support::Random;
using support::show;

constexpr std::size_t second = 44100;  // frames

std::optional<Dense> form_of(const std::string& text) {
  return dense_form(program_of(text));
}

Program dense(const std::string& text) {
  Program program = program_of(text);
  auto form = dense_form(program);
  REQUIRE(form.has_value());
  program.form = std::move(*form);
  return program;
}

void each_isa(const std::function<void(Isa)>& use) {
  for (const Isa isa : support::isas()) {
    INFO(isa_name(isa));
    use(isa);
  }
}

struct Tolerance {
  double relative = 1e-11;  // in double
  double snr_db = 100.0;    // in float
};

void agree(const Program& program, ComparisonOptions options, const Tolerance& tolerance = {}) {
  each_isa([&](Isa isa) {
    options.isa = isa;
    for (const Comparison& output : compare_kernels<double>(program, options)) {
      CAPTURE(show(output.relative()));
      CHECK(output.peak > 0.0);
      CHECK(output.relative() < tolerance.relative);
    }
    for (const Comparison& output : compare_kernels<float>(program, options)) {
      CHECK(output.snr_db() > tolerance.snr_db);
    }
  });
}

// A hand that stays on the triangle: within the pluck's zone, crossing its steeper middle.
std::string held_triangle(const std::string& link) {
  return scenes::triangle("0.1", "0.001") + "@in1 posInput 0.\n@hold " + link + "\n" +
         scenes::output(1, "m_m2");
}

// Up to 16 masses of all kinds, everything coupled, driven and damped differently.
std::string random_body(std::uint64_t seed) {
  Random random(seed);
  const int masses = 2 + static_cast<int>(random.below(most_dense_masses - 1));
  const auto number = [&](double low, double high) { return show(random.uniform(low, high)); };
  const auto any = [&] {
    return scenes::at("m", static_cast<int>(random.below(static_cast<std::size_t>(masses))));
  };
  std::string text = "@K param 0.1\n@Z param 0.002\n@M param 1.5\n@in1 frcInput @m0\n";
  text += "@in2 posInput " + number(-0.1, 0.1) + "\n@in3 frcInput @m1\n@g ground 0.05\n";
  for (int i = 0; i < masses; ++i) {
    const std::string start = number(-0.1, 0.1);
    const std::size_t kind = random.below(4);
    text += scenes::at("m", i) +
            (kind == 0   ? " osc M K " + number(0.0, 0.01) + " " + start + " " + start
             : kind == 1 ? " mass M " + start + " " + start
                         : " mass " + number(0.5, 3.0) + " " + start + " " + start) +
            "\n";
    text += scenes::at("r", i) + " springDamper " + (i == 0 ? "@g" : scenes::at("m", i - 1)) + " " +
            scenes::at("m", i) + " K " + number(0.0005, 0.004) + "\n";
  }
  for (int i = 0; i < 3; ++i) {
    text += scenes::at("s", i) + " springDamper " + any() + " " + any() + " " + number(0.001, 0.1) +
            " Z\n";
  }
  text += "@h springDamper @in2 " + any() + " 0.02 Z\n";
  return text + "@out1 posOutput " + any() + "\n@out2 posOutput @m0\n";
}

}  // namespace

TEST_CASE("small bodies have a dense form", "[dense]") {
  const auto triangle = form_of(scenes::iplay_the_triangle());
  REQUIRE(triangle.has_value());
  CHECK(triangle->springs.size() == 4);
  CHECK(triangle->ports.size() == 1);
  CHECK(!triangle->has_constant);
  const auto string = [](int masses) {
    return scenes::string("s", masses, "0.1", "0.001") + scenes::output(1, "s_m0");
  };
  CHECK(form_of(string(16)).has_value());
  CHECK(!form_of(string(17)).has_value());
  CHECK(form_of("@g ground 1.\n@m mass 1. 0. 0.\n@r springDamper @g @m 0.1 0.\n"
                "@out1 posOutput @m\n")
            ->has_constant);
}

TEST_CASE("what the dense kernel does not hear or take has no dense form", "[dense]") {
  const std::string body = "@g ground 0.\n@m mass 1. 0. 0.\n@r springDamper @g @m K 0.\n";
  const std::string fixed = "@K param 0.1\n";
  CHECK(form_of(fixed + body + "@out1 posOutput @m\n").has_value());
  CHECK(!form_of(fixed + body).has_value());
  CHECK(!form_of(fixed + body + "@out1 frcOutput @m\n").has_value());
  CHECK(!form_of(fixed + body + "@out1 posOutput @g\n").has_value());
  CHECK(!form_of("@K audioParam @in1\n" + body + "@out1 posOutput @m\n").has_value());
}

TEST_CASE("a free mass keeps the speed of a push", "[dense]") {
  // A force f in the first sample: x = (n + 1) f / M.
  each_isa([](Isa isa) {
    Fighter<double> kernel(dense("@m mass 4. 0. 0.\n@in1 frcInput @m\n@out1 posOutput @m\n"), 1.0,
                           isa);
    double n = 0.0;
    for (const std::size_t frames : {64u, 1u, 31u, 32u, 33u, 7u, 63u}) {
      std::vector<std::vector<double>> inputs(frames, {0.0});
      if (n == 0.0) {
        inputs[0][0] = 2.0;
      }
      for (const double x : kernel.play(inputs)) {
        n += 1.0;
        CHECK(std::fabs(x - 0.5 * n) < 1e-13 * n);
      }
    }
  });
}

TEST_CASE("a hand holds a spring's far end", "[dense]") {
  // The spring's force is that of the sample before: x1 = k h / M at the second sample, and from
  // there on 2 (1 - k/2) x - x.
  const double k = 0.01;
  Fighter<double> kernel(dense("@in1 posInput 0.\n@m mass 1. 0. 0.\n"
                               "@r springDamper @in1 @m 0.01 0.\n@out1 posOutput @m\n"),
                         1.0, best_isa());
  double x = 0.0;
  double before = 0.0;
  double held = 0.0;
  for (int block = 0; block < 50; ++block) {
    const double hand = block < 25 ? 1.0 : 0.25;
    for (const double found : kernel.play(std::vector(64, std::vector{hand}))) {
      const double next = 2.0 * x - before + k * (held - x);
      before = x;
      x = next;
      held = hand;
      CHECK(std::fabs(found - x) < 1e-12);
    }
  }
}

TEST_CASE("the small instruments sound as in the direct kernel", "[dense]") {
  for (const bool turns : {false, true}) {
    CAPTURE(turns);
    agree(dense(scenes::poly_triangle()), {.turns = turns});
    agree(dense(scenes::physical_lfo()), {.turns = turns});
    agree(dense(scenes::iplay_the_triangle()), {.reach = 0.004, .turns = turns});
  }
  agree(dense(scenes::poly_triangle()), {.pitch = 3.7});
}

TEST_CASE("any small body sounds as in the direct kernel", "[dense]") {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    CAPTURE(seed);
    const Program program = dense(random_body(seed));
    agree(program, {.frames = second / 2, .seed = seed, .turns = seed % 3 == 0, .pitch = 0.7},
          {.snr_db = 96.0});  // everything vibrates around an offset
  }
}

TEST_CASE("a contact that lasts sounds as in the direct kernel", "[dense]") {
  for (const char* link : {"nlPluck @in1 @m_m1 0.05 0.5", "contact @m_m1 @in1 0.05 0.01 1.",
                           "nlBow @in1 @m_m1 0.02 5.", "nlBow @in1 @m_m1 0.02 5. 1",
                           "nlSpring2 @in1 @m_m1 0.01 0.02 0.001"}) {
    CAPTURE(link);
    const Tolerance bent{.snr_db = 75.0};  // a pluck's middle repels
    agree(dense(held_triangle(link)), {.reach = 0.02}, bent);
    agree(dense(held_triangle(link)), {.reach = 0.02, .turns = true}, bent);
  }
}

// One to four masses in a row, with a weight or not, heard at up to three places.
std::string leaning_row(int masses, const std::string& ends, bool is_heavy, int outputs) {
  std::string text = "@K param 0.1\n@g ground 0.\n@in1 posInput 0.\n";
  for (int i = 0; i < masses; ++i) {
    const std::string m = scenes::at("m", i);
    text += m + (is_heavy ? " osc 1. 0.001 0.0001 0. 0. 0.00001\n" : " mass 1.3 0. 0.\n");
    text += "@r" + std::to_string(i) + " springDamper " + m + " " +
            (i == 0 ? "@g" : scenes::at("m", i - 1)) + " K 0.002\n";
  }
  text += "@hold " + ends + "\n";
  for (int o = 1; o <= outputs; ++o) {
    text += scenes::output(o, "m" + std::to_string((o - 1) % masses));
  }
  return text;
}

TEST_CASE("a body that leans on a straight piece of a law sounds as in the direct kernel",
          "[dense]") {
  for (const char* ends : {"contact @m0 @in1 0.05 0.02 1.", "contact @in1 @m0 0.05 0.02 1.",
                           "nlPluck @in1 @m0 0.04 1. 0.01", "nlPluck @m0 @in1 0.04 1. 0.01"}) {
    for (int masses = 1; masses <= 4; ++masses) {
      for (const bool is_heavy : {false, true}) {
        CAPTURE(ends, masses, is_heavy);
        const std::string text = leaning_row(masses, ends, is_heavy, 1 + masses % 3);
        // Around its corner, and well on the outer piece.
        agree(dense(text), {.frames = 4096, .reach = 0.02}, {.relative = 1e-12, .snr_db = 80.0});
        agree(dense(text), {.frames = 4096, .reach = 0.6, .lowest_hz = 20.0, .highest_hz = 200.0},
              {.relative = 1e-12, .snr_db = 80.0});
      }
    }
  }
}

TEST_CASE("larger bodies in contact sound as in the direct kernel", "[dense]") {
  for (const int masses : {6, 11, 16}) {
    for (const char* second_link : {"", "@rest contact @in1 @s_m3 0.02 0.001 1.\n"}) {
      CAPTURE(masses, second_link);
      const std::string text = scenes::string("s", masses, "0.1", "0.001") +
                               "@in1 posInput 0.\n@hold nlBow @s_m2 @in1 0.02 5.\n" + second_link +
                               scenes::output(1, "s_m1");
      agree(dense(text), {.frames = second / 4, .reach = 0.02});
      agree(dense(text), {.frames = second / 4, .reach = 0.02, .turns = true});
    }
  }
}

TEST_CASE("a link between two masses sounds as in the direct kernel", "[dense]") {
  for (const int masses : {3, 6, 11, 16}) {
    for (const char* link : {"nlBow @s_m0 @s_m2 0.02 5.", "nlBow @s_m1 @s_m0 0.02 5.",
                             "nlSpring2 @s_m2 @s_m0 0.01 0.02 0.001"}) {
      CAPTURE(masses, link);
      const std::string text = scenes::string("s", masses, "0.1", "0.001") +
                               "@in1 frcInput @s_m1\n@hold " + link + "\n" +
                               scenes::output(1, "s_m2");
      agree(dense(text), {.frames = second / 4, .reach = 0.02});
    }
  }
}

TEST_CASE("contacts that come and go end a block where they begin", "[dense]") {
  // The window before two builds of the direct kernel would part.
  agree(dense(held_triangle("contact @m_m1 @in1 0.05 0.01 0.")),
        {.frames = 8192, .reach = 0.02, .lowest_hz = 40.0, .highest_hz = 200.0},
        {.relative = 1e-9, .snr_db = 60.0});
  agree(dense(held_triangle("nlPluck @in1 @m_m1 0.05 0.01")),
        {.frames = 4096, .reach = 0.05, .lowest_hz = 5.0, .highest_hz = 20.0},
        {.relative = 1e-9, .snr_db = 60.0});
}

TEST_CASE("a coefficient that jumps acts from its own sample on", "[dense]") {
  const Program program = dense(random_body(5));
  Program plain = program;
  plain.form = Direct{};
  each_isa([&](Isa isa) {
    Fighter<double> reference(plain, 1.0, Isa::base);
    Fighter<double> kernel(program, 1.0, isa);
    Comparison comparison;
    for (int block = 0; block < 100; ++block) {
      const std::vector<double> parameters = {block % 7 < 3 ? 0.1 : 0.12, 0.002, 1.5};
      reference.turn(parameters, 1.0, false);
      kernel.turn(parameters, 1.0, false);
      const std::vector<std::vector<double>> inputs(40, {0.01, 0.02, 0.0});
      const auto expected = reference.play(inputs);
      const auto found = kernel.play(inputs);
      for (std::size_t i = 0; i < expected.size(); ++i) {
        comparison.add(expected[i], found[i]);
      }
    }
    CHECK(comparison.relative() < 1e-12);
  });
}

TEST_CASE("a dense body starts again as it started", "[dense]") {
  const Program program = dense(scenes::poly_triangle());
  const auto kernel = make_kernel<double>(program, 1, best_isa());
  for (std::uint32_t c = 0; c < program.coefficients.size(); ++c) {
    kernel->coefficients.set(
        0, c, coefficient_value(program, program.coefficients[c], program.parameters, 1.0), false);
  }
  const auto play = [&] {
    std::vector<double> force(max_block_frames, 0.1);
    std::vector<double> heard(max_block_frames);
    kernel->step({.frames = max_block_frames,
                  .value = force.data(),
                  .velocity = force.data(),
                  .outputs = heard.data()});
    return heard;
  };
  CHECK(kernel->is_near_start(0, 1e-6));
  const auto first = play();
  CHECK(!kernel->is_near_start(0, 1e-6));
  kernel->reset(0);
  CHECK(kernel->is_near_start(0, 1e-6));
  CHECK(play() == first);
}

}  // namespace ressort::dense_test
