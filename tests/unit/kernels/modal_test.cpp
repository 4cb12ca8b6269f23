// The modal kernel against the direct one, and the eigenvectors against known properties.
#include "core/kernels/modal/modal_form.h"
#include "tests/support/comparison.h"

namespace ressort::modal_test {
namespace {

using support::compare_kernels;
using support::Comparison;
using support::ComparisonOptions;
using support::isas;
using support::network_of;
using support::Random;
using support::show;

Program modal_program(const std::string& text, double rate_hz = 44100.0) {
  Program program = make_program(network_of(text), rate_hz, true);
  std::optional<Modes> modes = modal_form(program);
  REQUIRE(modes);
  program.form = std::move(*modes);
  return program;
}
const Modes& modes_of(const Program& program) {
  return program.form.get<Modes>();
}
bool has_modes(const std::string& text) {
  return modal_form(support::program_of(text)).has_value();
}

template <class T>
void check_same(const Program& program, const ComparisonOptions& options, double tolerance) {
  for (const Comparison& output : compare_kernels<T>(program, options)) {
    INFO("peak " << show(output.peak) << ", off by " << show(output.relative()) << ", "
                 << show(output.snr_db()) << " dB, " << isa_name(options.isa)
                 << (options.turns ? ", turning" : "") << ", seed " << options.seed);
    CHECK(output.peak > 0.0);
    CHECK(output.relative() < tolerance);
  }
}

TEST_CASE("The modes of a string follow the closed form", "[modal]") {
  const Program program = modal_program(scenes::string("s", 20, "0.1", "0.01") +
                                        "@in1 frcInput @s_m0\n" + scenes::output(1, "s_m4"));
  const Modes& modes = modes_of(program);
  REQUIRE(modes.modes == 20);
  REQUIRE(modes.stiffness.size() == 1);
  REQUIRE(modes.damping.size() == 1);
  std::vector<double> factors = modes.stiffness[0].factor;
  std::sort(factors.begin(), factors.end());
  for (int j = 1; j <= 20; ++j) {
    const double half = std::sin(j * std::numbers::pi / 42.0);
    CHECK(std::fabs(factors[static_cast<std::size_t>(j - 1)] / (4.0 * half * half) - 1.0) < 1e-13);
  }
  CHECK(modes.stiffness[0].factor == modes.damping[0].factor);
}

TEST_CASE("Modes of a body are independent of each other", "[modal]") {
  // Each mode's decay is a coefficient of its own that changes only this mode, so the form stores
  // as many numbers as modes, not their square.
  std::string text = "@ring param 1.\n@b body 1. p\n";
  for (int i = 1; i <= 300; ++i) {
    text += "@m" + std::to_string(i) + " mode @b " + std::to_string(50 * i) + " [ring/" +
            std::to_string(i) + "] 1.\n";
  }
  text += "@in1 frcInput [@b p]\n@out1 posOutput [@b p]\n";
  const auto modes = modal_form(make_program(network_of(text), 44100.0, true), {}, {}, false, true);
  REQUIRE(modes);
  REQUIRE(modes->modes == 300);
  std::vector<int> turned(300);
  for (const ModalShare& share : modes->damping) {
    REQUIRE(share.factor.size() == 1);
    ++turned[share.first];
  }
  CHECK(std::all_of(turned.begin(), turned.end(), [](int times) { return times == 1; }));
}

TEST_CASE("Inaudible modes are left out", "[modal]") {
  // The middle of a string of 21 is a node of every even mode. Strikes at other places excite these
  // modes.
  const std::string string = scenes::string("s", 21, "0.1", "0.01");
  CHECK(modes_of(modal_program(string + "@in1 frcInput @s_m4\n" + scenes::output(1, "s_m10")))
            .modes == 11);
  CHECK(modes_of(modal_program(string + "@in1 frcInput @s_m10\n" + scenes::output(1, "s_m4")))
            .modes == 21);
}

TEST_CASE("Networks without common eigenvectors have no modal form", "[modal]") {
  CHECK(has_modes(scenes::mesh_20x30()));
  // The springs at the triangle's corner have another ratio of K and Z than those at its sides.
  CHECK_FALSE(has_modes(scenes::iplay_the_triangle()));
  const std::string two =
      "@K param 0.1\n@L param 0.1\n@g ground 0.\n@a mass 1. 0. 0.\n@b mass 1. 0. 0.\n"
      "@in1 frcInput @a\n@out1 posOutput @b\n";
  CHECK(has_modes(two + "@r spring @g @a K\n@s spring @a @b K\n"));
  CHECK(has_modes(two + "@r spring @g @a 0.1\n@s spring @a @b 0.2\n"));
  CHECK_FALSE(has_modes(two + "@r spring @g @a K\n@s spring @a @b L\n"));
  CHECK_FALSE(has_modes(two + "@r spring @g @a K\n@s spring @a @b 0.2\n"));
}

TEST_CASE("A mesh with modes matches the direct kernel", "[modal]") {
  const Program program = modal_program(scenes::mesh_20x30());
  for (const bool turns : {false, true}) {
    check_same<double>(program, {.turns = turns, .pitch = 0.7}, 1e-9);
    for (const Comparison& output :
         compare_kernels<float>(program, {.turns = turns, .pitch = 0.7})) {
      INFO(show(output.snr_db()));
      CHECK(output.snr_db() > 100.0);
    }
  }
  for (const Isa isa : isas()) {
    check_same<double>(program, {.frames = 3000, .turns = true, .isa = isa}, 1e-11);
    check_same<float>(program, {.frames = 3000, .turns = true, .isa = isa}, 1e-5);
  }
}

TEST_CASE("A position input on springs drives the modes", "[modal]") {
  const Program program = modal_program(scenes::resonator());
  for (const bool turns : {false, true}) {
    check_same<double>(program, {.reach = 1.0, .turns = turns}, 1e-9);
    check_same<float>(program, {.reach = 1.0, .turns = turns}, 1e-4);
  }
}

TEST_CASE("Masses, grounds, gravity and offsets keep their positions with modes", "[modal]") {
  const std::vector<std::string> scenes = {
      // Different masses; a ground and a position input away from 0.
      "@K param 0.1\n@Z param 0.01\n@g ground 1.\n@in1 posInput 1.5\n"
      "@a mass 1. 1.2 0.\n@b mass 2. 1. 0.\n@c mass 3. 1.1 0.\n"
      "@r springDamper @g @a K Z\n@s springDamper @a @b K Z\n@t springDamper @b @c K Z\n"
      "@u springDamper @c @in1 K Z\n@out1 posOutput @a\n@out2 posOutput @c\n@out3 posOutput @in1\n",
      // No link holds the network: it drifts.
      "@K param 0.1\n@Z param 0.01\n@a mass 1. 1. 0.9\n@b mass 1. 1. 1.\n@c mass 1. 1. 1.\n"
      "@s springDamper @a @b K Z\n@t springDamper @b @c K Z\n@in1 frcInput @b\n"
      "@out1 posOutput @a\n@out2 posOutput @c\n",
      // One parameter for all masses, which changes; oscillators about 0, with damping by air,
      // beside a ground at 1.
      "@K param 0.1\n@M param 1.5\n@A param 0.02\n@B param 0.003\n@g ground 1.\n"
      "@a osc M A B 0.1 0.\n@b osc M A B 0. 0.\n@in1 frcInput @b\n"
      "@s spring @a @b K\n@r spring @a @g A\n@u spring @b @g A\n@out1 posOutput @a\n",
      // A network with gravity.
      "@K param 0.1\n@Z param 0.01\n@G param 0.001\n@g ground 0.\n@in1 posInput 0.\n"
      "@a mass 1. G 0. 0.\n@b mass 1. G 0. 0.\n@s springDamper @a @b K Z\n"
      "@t springDamper @g @a K Z\n@u springDamper @b @in1 K Z\n@out1 posOutput @b\n"};
  for (const std::string& scene : scenes) {
    INFO(scene);
    const Program program = modal_program(scene, 48000.0);
    for (const bool turns : {false, true}) {
      check_same<double>(program, {.frames = 10000, .turns = turns, .pitch = 1.3}, 1e-10);
    }
  }
}

// Fingers that touch a mesh, leave it and return, and a soft pick.
std::string touched_mesh() {
  return scenes::square_mesh("m", 8, 9, "0.1", "0.001") +
         "@in1 posInput 0.02\n@in2 posInput 0.05\n@in3 posInput 0.08\n"
         "@t1 contact @m_m2_3 @in1 0.05 0.01 0.\n@t2 contact @m_m5_5 @in2 0.05 0.01 0.\n"
         "@pick nlPluck @in3 @m_m4_4 0.02 0.05\n@in4 frcInput @m_m6_2\n" +
         scenes::output(1, "m_m3_3") + scenes::output(2, "m_m7_1");
}

TEST_CASE("Nonlinear links act on modes as on masses", "[modal]") {
  const Program program = modal_program(touched_mesh());
  for (const bool turns : {false, true}) {
    for (const double reach : {0.02, 0.06, 0.2}) {
      for (const Isa isa : isas()) {
        check_same<double>(
            program,
            {.frames = 6000, .reach = reach, .highest_hz = 30.0, .turns = turns, .isa = isa}, 1e-9);
      }
    }
  }
}

TEST_CASE("A strike acts on distant links within its block", "[modal]") {
  // A hard finger strikes one end of a light chain at rest; the other end is close to the ground
  // and hits it at once.
  const std::string text =
      "@K param 0.9\n@Z param 0.01\n@g ground 0.\n@floor ground -0.001\n@in1 posInput 0.05\n"
      "@a mass 1. 0. 0.\n@b mass 1. 0. 0.\n@c mass 1. 0. 0.\n@h springDamper @g @a K Z\n"
      "@i springDamper @a @b K Z\n@j springDamper @b @c K Z\n"
      "@blow contact @a @in1 0.3 0. 0.\n@bounce contact @floor @c 0.3 0. 0.\n"
      "@out1 posOutput @b\n@out2 posOutput @c\n";
  const Program program = modal_program(text);
  for (const std::uint64_t seed : {4u, 5u, 6u, 7u, 8u}) {
    check_same<double>(program, {.frames = 2000, .seed = seed, .reach = 1.0, .highest_hz = 100.0},
                       1e-9);
  }
}

TEST_CASE("A hammer drifts away from a string and returns", "[modal]") {
  // The hammer's mode is soft (lK = 1e-6, 2 pi 1000 samples a period), so between two blows it
  // flies much further than the string moves. The forces of springs and dampers are heard
  // meanwhile.
  const Program program = modal_program(
      scenes::string("s", 20, "0.1", "0.01") + "@g ground 0.05\n@h mass s_M 0.05 0.\n" +
      "@back spring @g @h 1e-6\n@in1 frcInput @h\n@blow contact @h @s_m7 0.05 0.001 0.\n" +
      "@out1 frcOutput @s_m3\n@out2 posOutput @h\n" + scenes::output(3, "s_m12"));
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    for (const Isa isa : isas()) {
      check_same<double>(
          program, {.frames = 12000, .seed = seed, .reach = 1e-7, .highest_hz = 10.0, .isa = isa},
          1e-9);
    }
  }
}

TEST_CASE("Links are tested even if the energy gives no bound", "[modal]") {
  const Program program = modal_program(
      "@g ground 0.\n@in1 posInput 0.01\n@a mass 1. 0.01 0.\n@h spring @g @a 3.98\n"
      "@t contact @a @in1 0.001 0. 0.\n@out1 posOutput @a\n");
  check_same<double>(program, {.frames = 2000, .reach = 0.1, .highest_hz = 100.0}, 1e-9);
}

TEST_CASE("A reset voice with modes repeats its motion", "[modal]") {
  support::Bare<double> bare(modal_program(touched_mesh()));
  const auto play = [&] {
    std::vector<double> heard;
    for (std::size_t n = 0; n < 500; ++n) {
      const double push = n < 20 ? 0.1 : 0.0;
      heard.push_back(bare.step({0.02 - 1e-3 * double(n), 0.05, 0.08, push})[0]);
    }
    return heard;
  };
  CHECK(bare.kernel().is_near_start(0, 1e-9));
  const std::vector<double> first = play();
  CHECK_FALSE(bare.kernel().is_near_start(0, 1e-9));
  bare.kernel().reset(0);
  bare.feed(0, 0, 0.02);  // the position input returns to its place
  CHECK(bare.kernel().is_near_start(0, 1e-9));
  CHECK(play() == first);
}

TEST_CASE("More links than one sweep has rows are computed correctly", "[modal]") {
  std::string text =
      scenes::string("s", 40, "0.1", "0.01") + "@in1 posInput 0.\n@ceiling ground 0.5\n";
  for (int i = 0; i < 12; ++i) {
    const std::string label = std::to_string(i);
    text += "@n" + label + " nlSpring3 " + scenes::at("s_m", 3 * i) + " " +
            (i % 4 == 0   ? "@in1"
             : i % 4 == 1 ? "@ceiling"
                          : scenes::at("s_m", 3 * i - 2)) +
            " 0.01 0.02 0.001\n";
  }
  text += "@bow nlBow @in1 @s_m20 0.01 0.01\n";
  for (int i = 0; i < 5; ++i) {
    text += scenes::output(i + 1, "s_m" + std::to_string(7 * i));
  }
  const Program program = modal_program(text);
  for (const bool turns : {false, true}) {
    check_same<double>(program, {.frames = 10000, .turns = turns}, 1e-9);
    check_same<float>(program, {.frames = 10000, .turns = turns}, 1e-3);
  }
}

TEST_CASE("The large mesh is plucked and touched with modes", "[modal]") {
  const Program program = modal_program(scenes::large_triangle_mesh());
  CHECK(modes_of(program).places.size() == 7);
  check_same<double>(program, {.frames = 3000, .reach = 0.06}, 1e-9);
}

}  // namespace
}  // namespace ressort::modal_test
