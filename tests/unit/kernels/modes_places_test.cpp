// Places on macros with modes: sums of masses, as in the direct kernel.
#include "tests/support/modes.h"

namespace ressort::modes_places_test {
namespace {

using support::check_same;
using support::ComparisonOptions;
using support::in_modes;
using support::isas;
using support::show;

TEST_CASE("A string with inputs and outputs at places has a modal form", "[modes_places]") {
  const Program program = in_modes(
      "@K param 0.3\n@Z param 0.002\n@s string 20 1. K Z 0. 0.\n@in1 frcInput [@s 0.3]\n"
      "@out1 posOutput [@s 0.7]\n@out2 posOutput [@s 0.01]\n");
  for (const bool turns : {false, true}) {
    for (const Isa isa : isas()) {
      check_same<double>(program, {.frames = 8820, .turns = turns, .pitch = 0.8, .isa = isa},
                         1e-10);
      check_same<float>(program, {.frames = 8820, .turns = turns, .pitch = 0.8, .isa = isa}, 1e-4);
    }
  }
}

TEST_CASE("A place's modes are sums of those of the masses around it", "[modes_places]") {
  // 0.3 of 19 lengths is 0.7 of the way from mass 5 to mass 6.
  const std::string string = "@s string 20 1. 0.3 0.002 0. 0.\n@in1 frcInput [@s 0.]\n";
  const Modes at = in_modes(string + "@out1 posOutput [@s 0.3]\n").form.get<Modes>();
  const Program ends = in_modes(string + "@out1 posOutput [@s 5/19]\n@out2 posOutput [@s 6/19]\n");
  const Modes& around = ends.form.get<Modes>();
  REQUIRE(at.modes == around.modes);
  for (std::size_t i = 0; i < at.modes; ++i) {
    const double wanted =
        0.3 * around.outputs[0].place.shape[i] + 0.7 * around.outputs[1].place.shape[i];
    CHECK(std::fabs(at.outputs[0].place.shape[i] - wanted) < 1e-13);
  }
}

TEST_CASE("A mesh with modes is held and struck at places", "[modes_places]") {
  // Springs at places are springs between sums of masses. K and Z have the same ratio everywhere.
  const std::string mesh =
      "@k param 0.1\n@z param 0.004\n@s cornerMesh 6 9 1. k z 0. 0.\n@g ground 0.02\n"
      "@in1 frcInput [@s 0.31 0.6]\n@in2 posInput 0.\n"
      "@h springDamper @in2 [@s 0.77 0.42] k z\n@j springDamper [@s 0.1 0.9] @g k z\n"
      "@i springDamper [@s 0.2 0.25] [@s 0.24 0.31] k z\n";
  const std::string heard = "@out1 posOutput [@s 0.5 0.5]\n@out2 posOutput [@s 0.93 0.07]\n";
  for (const bool turns : {false, true}) {
    check_same<double>(in_modes(mesh + heard), {.frames = 8820, .turns = turns}, 1e-10);
  }
  const std::string touched = mesh +
                              "@in3 posInput 0.05\n@c contact [@s 0.5 0.55] @in3 0.1 0.01 0.\n" +
                              "@n nlSpring3 [@s 0.5 0.58] [@s 0.81 0.13] 0.01 0.5 0.001\n";
  const std::string plucked = touched + "@p nlPluck @in3 [@s 0.22 0.71] 0.02 0.05\n";
  for (const bool turns : {false, true}) {
    const ComparisonOptions options{.frames = 8820, .turns = turns};
    check_same<double>(in_modes(plucked + heard, Passivity::never), options, 1e-9);
    check_same<double>(in_modes(touched + heard, Passivity::always), options, 1e-9);
    // The direct kernel takes, in substeps, the displacement of a place for its speed, and the
    // modal kernel the speed of its masses.
    check_same<double>(in_modes(plucked + heard, Passivity::always), options, 1e-5);
  }
}

TEST_CASE("Force outputs at masses, places, grounds and position inputs work with modes",
          "[modes_places]") {
  const std::string held =
      "@k param 0.1\n@z param 0.004\n@s cornerMesh 6 9 1. k z 0. 0.\n@g ground 0.02\n"
      "@m mass 2. 0. 0.\n@in1 frcInput [@s 0.31 0.6]\n@in2 posInput 0.\n@in3 frcInput @m\n"
      "@h springDamper @in2 [@s 0.77 0.42] k z\n@j springDamper [@s 0.1 0.9] @g k z\n"
      "@i springDamper [@s 0.2 0.25] @m k z\n@l springDamper @m @in2 k z\n";
  const std::string touched =
      "@in4 posInput 0.05\n@c contact [@s 0.5 0.55] @in4 0.1 0.01 0.\n"
      "@n nlSpring3 [@s 0.5 0.58] @m 0.01 0.5 0.001\n@b contact @g @in4 0.1 0. 0.\n"
      "@p nlPluck @in4 @m 0.02 0.05\n";
  const std::string felt =
      "@out1 frcOutput @m\n@out2 frcOutput [@s 0.3 0.55]\n@out3 frcOutput @g\n"
      "@out4 frcOutput @in2\n@out5 posOutput @m\n@out6 frcOutput [@s 0.5 0.57]\n";
  for (const bool turns : {false, true}) {
    for (const double rate_hz : {44100.0, 96000.0}) {
      for (const std::string& links : {std::string(), touched}) {
        for (const Passivity passive : {Passivity::never, Passivity::always}) {
          const Network network = expand_macros(support::network_of(held + links + felt));
          Program program =
              make_program(network, rate_hz, true, support::schemes_of(network, passive).links);
          std::optional<Modes> modes = modal_form(program);
          REQUIRE(modes);
          program.form = std::move(*modes);
          check_same<double>(program, {.frames = 8820, .turns = turns}, 1e-9);
        }
      }
    }
  }
}

TEST_CASE("A constant force equals its reaction force", "[modes_places]") {
  // A mass on one spring, with exact modes: the spring's force on the mass is its reaction force on
  // the ground.
  const std::string text =
      "@g ground 0.\n@m mass 1. 0. 0.\n@s springDamper @g @m 0.8 0.4\n@in1 frcInput @m\n"
      "@out1 frcOutput @g\n@out2 frcOutput @m\n";
  Program program = support::program_of(text);
  program.form = *modal_form(program, {.cents = 1e-6});
  support::Bare<double> bare(program);
  std::vector<double> heard;
  for (int n = 0; n < 1000; ++n) {
    heard = bare.step({0.3});
  }
  CHECK(std::fabs(heard[0] - 0.3) < 1e-12);
  CHECK(std::fabs(heard[1]) < 1e-12);
}

TEST_CASE("A place that a parameter moves has no modal form", "[modes_places]") {
  const std::string string = "@u param 0.3\n@s string 20 1. 0.3 0.002 0. 0.\n";
  const auto has_modes = [&](const std::string& text) {
    return modal_form(support::program_of(string + text)).has_value();
  };
  CHECK(has_modes("@in1 frcInput [@s 0.2]\n@out1 posOutput [@s 0.7]\n"));
  CHECK_FALSE(has_modes("@in1 frcInput [@s u]\n@out1 posOutput [@s 0.7]\n"));
}

}  // namespace
}  // namespace ressort::modes_places_test
