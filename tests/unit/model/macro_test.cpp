// Macros and places on them: golden values, the expanded network, and a moving place
// against the published array algorithm.
#include <cmath>

#include "core/model/topology.h"
#include "tests/support/app/messages.h"
#include "tests/support/harness.h"

namespace ressort::macro_test {
namespace {

using namespace support;
using messages::check_error;
using messages::check_warning;

constexpr auto delayed = ThirdArgument::delayed_position;
constexpr auto velocity = ThirdArgument::velocity_per_second;

const std::string two_masses = "@a mass 1. 0. 0.\n@b mass 1. 0. 0.\n";

double value(const Network& network, ArgumentId id) {
  return argument_value(network, id, parameter_values(network));
}

// Returns argument `slot` of the last link.
double link_value(const Network& network, std::size_t slot) {
  return value(network, network.links.back().arguments[slot]);
}

// One line of appendix A: the response at `out` to a unit force at sample 0 at `in`. In the
// appendix a force acts one sample later than here, so its sample n is n - 1 here.
struct Golden {
  const char* name;
  const char* text;
  double values[5];  // at n = 10, 50, 100, 500, 1000
};

constexpr Golden goldens[] = {
    {"string 10, MIMS4Max",
     "@s string 10 1. 0.5 0.0003 [0 0 0] [1 0 0]\n@in1 frcInput [@s 0.7]\n@out1 posOutput [@s "
     "0.2]\n",
     {0.652352293, 0.131696201, 0.15709703, 0.0896413892, 0.84386536}},
    {"string 40 with air damping",
     "@u param 0.1\n@s string 40 1. 0.1 0.001 0.00005 0. 0.\n@in1 frcInput [@s u]\n"
     "@out1 posOutput [@s 1 - u]\n",
     {0.0, 4.02e-15, 0.71058385, -0.111553637, 0.0664286054}},
    {"stiffString 50, MIMS",
     "@s stiffString 50 1. 0.6 0.3 0.01 0.\n@in1 frcInput @s 0.3\n@out1 posOutput @s 0.95\n",
     {0.0, -0.292899707, 0.296881254, 0.0981248068, -0.0799573707}},
    {"closedMesh 10 x 5",
     "@s closedMesh 10 5 1. 0.2 0.0001 0. 0.\n@in1 frcInput [@s 0.3 0.5]\n"
     "@out1 posOutput [@s 0.75 0.5]\n",
     {0.112107271, 0.0812319167, -0.214518211, 0.408542317, 0.30793603}},
    {"cornerMesh 10 x 5, MIMS",
     "@s cornerMesh 10 5 1. 0.2 0.001 0.\n@in1 frcInput @s 0.3:0.5\n@out1 posOutput @s 0.95:0.5\n",
     {0.0169090608, -0.066783052, 0.0631320395, -0.00557740625, 0.0322460119}},
};

std::vector<double> struck(const std::string& text, std::size_t frames) {
  Bare<double> bare(make_program(network_of(text), 44100.0, true));
  std::vector<double> heard;
  for (std::size_t n = 0; n < frames; ++n) {
    heard.push_back(bare.step(std::vector{n == 0 ? 1.0 : 0.0})[0]);
  }
  return heard;
}

}  // namespace

TEST_CASE("macros match the golden values of appendix A in every digit", "[macro]") {
  constexpr std::size_t at[] = {10, 50, 100, 500, 1000};
  for (const Golden& golden : goldens) {
    const std::vector<double> heard = struck(golden.text, 1000);
    for (std::size_t i = 0; i < std::size(at); ++i) {
      INFO(golden.name << ", n = " << at[i] << ": " << show(heard[at[i] - 1]));
      // Nine significant digits, or three for the value near 1e-15, as printed.
      const double digits = std::fabs(golden.values[i]) < 1e-12 ? 1e-2 : 1e-8;
      CHECK(std::fabs(heard[at[i] - 1] - golden.values[i]) <=
            0.5 * digits * std::fabs(golden.values[i]) + 1e-30);
    }
  }
}

TEST_CASE("a macro equals the same network of masses and links", "[macro]") {
  // 5 nodes, two of them fixed; place 0.25 is node 1, 0.75 is node 3.
  const std::string written =
      "@a ground 0.1\n@b osc 2. 0. z 0.1 0.1\n@c osc 2. 0. z 0.1 0.1\n@d osc 2. 0. z 0.1 0.1\n"
      "@e ground 0.1\n@z param 0.002\n@r0 springDamper @a @b 0.3 0.01\n"
      "@r1 springDamper @b @c 0.3 0.01\n@r2 springDamper @c @d 0.3 0.01\n"
      "@r3 springDamper @d @e 0.3 0.01\n";
  const std::string ends = "@in1 frcInput @b\n@out1 posOutput @d\n";
  const std::string places = "@in1 frcInput [@s 0.25]\n@out1 posOutput [@s 0.75]\n";
  CHECK(struck(written + ends, 3000) ==
        struck("@z param 0.002\n@s string 5 2. 0.3 0.01 z 0.1 0.\n" + places, 3000));
  const std::string stiff =
      "@k0 spring @a @c 0.1\n@k1 spring @b @d 0.1\n@k2 spring @c @e 0.1\n@k3 spring @a @b 0.1\n"
      "@k4 spring @d @e 0.1\n";
  CHECK(struck(written + stiff + ends, 3000) ==
        struck("@z param 0.002\n@s stiffString 5 2. 0.3 0.1 0.01 z 0.1 0.\n" + places, 3000));
}

TEST_CASE("the expansions have the published numbers of nodes and links", "[macro]") {
  struct Count {
    const char* line;
    std::size_t moving;
    std::size_t fixed;
    std::size_t links;
  };
  for (const Count& count :
       {Count{"@s string 10 1 1 0 0 0", 8, 2, 9}, Count{"@s stiffString 50 1 1 1 0 0 0", 48, 2, 99},
        Count{"@s chain 10 1 1 0 0 0", 10, 0, 9}, Count{"@s closedMesh 10 5 1 1 0 0 0", 24, 26, 85},
        Count{"@s cornerMesh 10 5 1 1 0 0 0", 46, 4, 85},
        Count{"@s mesh 10 5 1 1 0 0 0", 50, 0, 85}}) {
    INFO(count.line);
    const Program program = make_program(network_of(count.line), 44100.0, true);
    CHECK(program.moving == count.moving);
    CHECK(program.position.size() - program.moving == count.fixed);
    CHECK(program.ends.size() == count.links);
  }
}

TEST_CASE("a place that moves at audio rate follows the published array algorithm", "[macro]") {
  // A finger on a spring to a place that moves along a chain of 12. Positions by 2x - x_before,
  // weights max(0, 1 - |p - i|), the velocity from the place's previous position.
  constexpr std::size_t nodes = 12;
  constexpr double mass = 1.3;
  constexpr double k = 0.2;
  constexpr double z = 0.003;
  constexpr double hold_k = 0.05;
  constexpr double hold_z = 0.02;
  const Network network = network_of(
      "@u audioParam @in2\n@s chain 12 1.3 0.2 0.003 0. 0.\n@in1 posInput 0.\n"
      "@h springDamper @in1 [@s u] 0.05 0.02\n@out1 posOutput [@s u]\n@out2 frcOutput @in1\n");
  auto compiled = compile_network(network, default_preset(network, true), {.bare = true});
  REQUIRE(compiled);
  constexpr std::size_t frames = 8000;
  const Motion hand(71, 0.5, 40.0);
  const Motion place(72, 0.5, 5.0);
  std::vector<double> finger(frames);
  std::vector<double> coordinate(frames);
  std::vector<double> expected(frames);
  std::vector<double> reaction(frames);
  std::vector<long double> x(nodes, 0.0L);
  std::vector<long double> before(nodes, 0.0L);
  std::vector<long double> force(nodes, 0.0L);
  long double point = 0.0L;
  long double finger_before = 0.0L;
  for (std::size_t n = 0; n < frames; ++n) {
    finger[n] = hand(n);
    coordinate[n] = 0.5 + 0.7 * place(n);  // sometimes beyond the ends, where it is clamped
    for (std::size_t i = 0; i < nodes; ++i) {
      const long double next = 2 * x[i] - before[i] + force[i] / mass;
      before[i] = x[i];
      x[i] = next;
      force[i] = 0;
    }
    const double clamped = std::min(1.0, std::max(0.0, coordinate[n]));
    const auto weight = [&](std::size_t i) {
      return std::max(0.0, 1.0 - std::fabs(clamped * (nodes - 1) - static_cast<double>(i)));
    };
    long double now = 0.0L;
    for (std::size_t i = 0; i < nodes; ++i) {
      now += weight(i) * x[i];
    }
    for (std::size_t i = 0; i + 1 < nodes; ++i) {
      const long double f =
          k * (x[i] - x[i + 1]) + z * ((x[i] - before[i]) - (x[i + 1] - before[i + 1]));
      force[i] -= f;
      force[i + 1] += f;
    }
    const long double held =
        hold_k * (finger[n] - now) + hold_z * ((finger[n] - finger_before) - (now - point));
    for (std::size_t i = 0; i < nodes; ++i) {
      force[i] += weight(i) * held;
    }
    expected[n] = static_cast<double>(now);
    reaction[n] = static_cast<double>(-held);
    point = now;
    finger_before = finger[n];
  }
  std::vector<double> heard(frames);
  std::vector<double> felt(frames);
  double* const outputs[] = {heard.data(), felt.data()};
  const double* const inputs[] = {finger.data(), coordinate.data()};
  compiled->engine->process({}, inputs, outputs, frames);
  Comparison positions;
  Comparison forces;
  for (std::size_t n = 0; n < frames; ++n) {
    positions.add(expected[n], heard[n]);
    forces.add(reaction[n], felt[n]);
  }
  INFO("residuals " << show(positions.relative()) << ", " << show(forces.relative()));
  CHECK(positions.peak > 0.05);
  CHECK(positions.relative() < 1e-12);
  CHECK(forces.relative() < 2e-12);
}

TEST_CASE("the number of a macro's arguments determines dialect and air damping", "[macro]") {
  struct Form {
    std::string start;
    int least;
  };
  for (const Form& form :
       {Form{"@s string 5 2 3 4", 5}, Form{"@s chain 5 2 3 4", 5},
        Form{"@s stiffString 5 2 3 9 4", 6}, Form{"@s mesh 3 3 2 3 4", 6},
        Form{"@s closedMesh 3 3 2 3 4", 6}, Form{"@s cornerMesh 3 3 2 3 4", 6}}) {
    INFO(form.start);
    const Network mims = network_of(form.start + " 0.5");
    const Network max = network_of(form.start + " 0.5 7");
    const Network air = network_of(form.start + " 6 0.5 7");
    CHECK(mims.third == delayed);
    CHECK(mims.macros[0].third == 0.5);  // at rest
    CHECK(max.third == velocity);
    CHECK(max.macros[0].third == 7.0);
    CHECK(air.third == velocity);
    CHECK(air.macros[0].third == 7.0);
    CHECK(mims.macros[0].air_damping == no_argument);
    CHECK(max.macros[0].air_damping == no_argument);
    CHECK(value(air, air.macros[0].air_damping) == 6.0);
    for (const Network& network : {mims, max, air}) {
      const Macro& macro = network.macros[0];
      CHECK(value(network, macro.mass) == 2.0);
      CHECK(value(network, macro.stiffness) == 3.0);
      CHECK(value(network, macro.damping) == 4.0);
      CHECK(macro.position == 0.5);
      CHECK(value(network, macro.second_stiffness) ==
            (macro.kind == MacroKind::stiff_string ? 9.0 : 0.0));
    }
  }
  // At rest in a file of the other dialect, too.
  const Network mixed = network_of("@s string 5 2 3 4 0.5\n@m mass 1 [0 0 1] 0\n");
  CHECK(mixed.third == velocity);
  CHECK(mixed.macros[0].third == 0.0);
  check_error("@s string 5 1 1 0", 1, 18,
              "'string' takes 5 to 7 arguments (N M K Z [ZO] POSITION [MOTION]), found 4");
  check_error("@s mesh 3 3 1 1 1 1 1 1 1", 1, 25,
              "'mesh' takes 6 to 8 arguments (LENGTH WIDTH M K Z [ZO] POSITION [MOTION]), found 9");
  const std::string count = " where a number of nodes from 2 to 4000000 was expected";
  check_error("@s string 2000000000 1 1 0 0 0", 1, 11, "found '2000000000'" + count);
  check_error("@s string 99999999999999999999999 1 1 0 0 0", 1, 11,
              "found '99999999999999999999999'" + count);
  check_error("@s string -5 1 1 0 0 0", 1, 11, "found '-5'" + count);
  check_error("@s string 5.0 1 1 0 0 0", 1, 11, "found '5.0'" + count);
  check_error("@s stiffString 2 1 1 1 0 0 0", 1, 16,
              "found '2' where a number of nodes from 3 to 4000000 was expected");
  check_error("@s mesh 3000 3000 1 1 0 0 0", 1, 9,
              "the macros have more than 4000000 nodes in all");
  check_error("@s string 3000000 1 1 0 0 0\n@t string 3000000 1 1 0 0 0", 2, 11,
              "the macros have more than 4000000 nodes in all");
}

TEST_CASE("a place after the arguments does not count as one", "[macro]") {
  const std::string macros =
      two_masses + "@s chain 5 1 1 1 0\n@q mesh 3 4 1 1 1 0\n@p param 0.25\n";
  const auto tapped = [&](const std::string& line) { return network_of(macros + line); };
  const auto coordinate = [](const Network& network, std::size_t tap) {
    return std::pair(value(network, network.taps.at(tap).u),
                     value(network, network.taps.at(tap).v));
  };
  Network n = tapped("@l contact @s @a 1 2 3 0.5");
  CHECK(link_value(n, 2) == 3.0);
  CHECK(coordinate(n, 0) == std::pair(0.5, 0.0));
  n = tapped("@l contact @a @s 1 2 0.5");
  CHECK(n.links[0].arguments[2] == no_argument);
  CHECK(coordinate(n, 0) == std::pair(0.5, 0.0));
  n = tapped("@l springDamper @s @q 1 2 p 0.1:p+0.5");
  CHECK(link_value(n, 1) == 2.0);
  CHECK(coordinate(n, 0) == std::pair(0.25, 0.0));
  CHECK(coordinate(n, 1) == std::pair(0.1, 0.75));
  CHECK(n.masses[n.links[0].a].kind == MassKind::point);
  CHECK(n.masses[n.links[0].b].tap == 1);
  n = tapped("@in1 frcInput @q 0:1\n@out1 frcOutput @s 1.");
  CHECK(coordinate(n, 0) == std::pair(0.0, 1.0));
  CHECK(coordinate(n, 1) == std::pair(1.0, 0.0));
  // Brackets in the newer dialect mean the same.
  CHECK(network_of(macros + "@m ground [0 0 0]\n@l spring [@s p] [@q 0.1 p+0.5] 1 2").links ==
        network_of(macros + "@m ground [0 0 0]\n@l spring @s @q 1 2 p 0.1:p+0.5").links);
  CHECK(coordinate(tapped("@l spring [@s p + 0.1] @a 1"), 0) == std::pair(0.35, 0.0));
  CHECK(coordinate(tapped("@l spring [ @s  0.5 ] @a 1"), 0) == std::pair(0.5, 0.0));

  const std::string one = " is a chain: a place on it needs one coordinate, [@s u], from 0 to 1";
  const std::string two =
      " is a mesh: a place on it needs two coordinates, [@m u v], each from 0 to 1";
  check_error(
      macros + "@l spring @a @s 1", 6, 16,
      "'spring' takes 3 to 4 arguments (@A @B K [Z]), found 2 before the place on the macro");
  check_error(macros + "@out1 posOutput @s", 6, 17, "'@s'" + one);
  check_error(macros + "@out1 posOutput [@s]", 6, 17, "'@s'" + one);
  check_error(macros + "@out1 posOutput @q 0.5", 6, 17, "'@q'" + two);
  check_error(macros + "@out1 posOutput [@q 0.5]", 6, 17, "'@q'" + two);
  check_error(macros + "@out1 posOutput [@q 0.1 0.2 0.3]", 6, 17, "'@q'" + two);
  check_error(macros + "@out1 posOutput @s 0.1:0.2", 6, 17, "'@s'" + one);
  check_error(macros + "@out1 posOutput [@s 0.1 0.2]", 6, 25,
              "found '0' where an operator or the end was expected");
  check_error(macros + "@out1 posOutput [@a 0.5]", 6, 18,
              "'@a' is a single mass, not a macro: write it without '['");
  check_error(macros + "@out1 posOutput [@ss 0.5]", 6, 18,
              "no macro is called '@ss'; did you mean '@s'?");
  check_error(macros + "@out1 posOutput @a 0.5 2", 6, 24,
              "'posOutput' takes 1 to 2 arguments (@MASS [LEVEL]), found 3");
  check_error(macros + "@out1 posOutput [@s w]", 6, 21,
              "'w' is not a parameter of this model; did you mean 'p'?");
}

TEST_CASE("a place beyond the end of a macro is clamped, with a warning", "[macro]") {
  const std::string models = "@s chain 5 1 1 0 0 0\n@q mesh 3 3 1 1 0 0 0\n";
  const std::string beyond = "a place on a macro goes from 0 to 1; ";
  check_warning(models + "@out1 posOutput [@s 1.5]", 3, 21, beyond + "'1.5' is read as 1");
  check_warning(models + "@out1 posOutput [@q 1 -0.1]", 3, 23, beyond + "'-0.1' is read as 0");
  check_warning(models + "@out1 posOutput @s 2", 3, 20, beyond + "'2' is read as 1");
  messages::check_told(models + "@out1 posOutput [@q 0 1]", {});
}

TEST_CASE("places, grounds and position inputs start at rest", "[macro]") {
  // Dampers only: every node is at rest before the first sample, so there is no force.
  support::Bare<double> bare(
      make_program(network_of("@in1 posInput 3\n@g ground -2\n@s chain 5 1 0.1 0 [0 0 1.5] 0\n"
                              "@q closedMesh 4 4 1 0.1 0 [0 0 0.5] [0 0 0]\n"
                              "@k damper [@s 0.3] @in1 1\n@l damper [@s 0.6] @g 1\n"
                              "@m damper [@q 0.4 0.6] @g 1\n@out1 frcOutput @in1\n"
                              "@out2 frcOutput @g\n@out3 posOutput [@s 0.4]\n"
                              "@out4 posOutput [@q 0.3 0.3]"),
                   44100.0, true));
  for (int n = 0; n < 10; ++n) {
    const auto outputs = bare.step({3.0});
    CHECK(std::fabs(outputs[0]) < 1e-15);
    CHECK(std::fabs(outputs[1]) < 1e-15);
    CHECK(std::fabs(outputs[2] - 1.5) < 1e-14);
    CHECK(std::fabs(outputs[3] - 0.5) < 1e-14);
  }
  // The ends of a string stay fixed at any initial velocity.
  const Network moving = expand_macros(network_of("@s string 4 1 0.1 0 0 441"));
  CHECK(initial_velocity(moving, moving.masses[0]) == 0.0);
  CHECK(initial_velocity(moving, moving.masses[1]) == 0.01);
  CHECK(initial_velocity(moving, moving.masses[3]) == 0.0);
}

TEST_CASE("the force at a place is interpolated, with input forces", "[macro]") {
  // 3 nodes: 0.25 is midway between the first two. A push there acts by half on each, so half
  // of it is measured at the same place. 0.125 has the weights 3/4 and 1/4.
  support::Bare<double> bare(
      make_program(network_of("@s chain 3 1 0 0 0 0\n@in1 frcInput [@s 0.25]\n"
                              "@out1 frcOutput [@s 0.25]\n@out2 frcOutput [@s 0.125]\n"
                              "@out3 frcOutput [@s 1]\n@out4 posOutput [@s 0.25]"),
                   44100.0, true));
  CHECK(bare.step({1.0}) == std::vector{0.5, 0.5, 0.0, 0.5});
  CHECK(bare.step({0.0}) == std::vector{0.0, 0.0, 0.0, 1.0});
}

}  // namespace ressort::macro_test
