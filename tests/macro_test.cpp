// Macros and the places on them: golden values, the same network written out, and a moving place
// against the published array algorithm.
#include <cmath>

#include "tests/rig.h"

namespace ressort {
namespace {

using namespace rig;

// One line of appendix A: unit force at tick 0 through the place `in`, heard at `out`. There a
// force acts one tick after it is given, here on the same; so tick n there is n - 1 here.
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

TEST_CASE("macros have the golden values of appendix A in every printed digit", "[macro]") {
  constexpr std::size_t at[] = {10, 50, 100, 500, 1000};
  for (const Golden& golden : goldens) {
    const std::vector<double> heard = struck(golden.text, 1000);
    for (std::size_t i = 0; i < std::size(at); ++i) {
      INFO(golden.name << ", n = " << at[i] << ": " << show(heard[at[i] - 1]));
      // Nine significant digits; of the one of 1e-15, the three that are printed.
      const double digits = std::fabs(golden.values[i]) < 1e-12 ? 1e-2 : 1e-8;
      CHECK(std::fabs(heard[at[i] - 1] - golden.values[i]) <=
            0.5 * digits * std::fabs(golden.values[i]) + 1e-30);
    }
  }
}

TEST_CASE("a macro is the same network as its masses and links written out", "[macro]") {
  // 5 nodes with two fixed; the place 0.25 is node 1, 0.75 is node 3.
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
  // A finger, sprung to a place that wanders along a chain of 12: positions by 2x - x_before,
  // weights max(0, 1 - |p - i|), the place's velocity that of its own last position.
  constexpr std::size_t nodes = 12;
  constexpr double mass = 1.3;
  constexpr double k = 0.2;
  constexpr double z = 0.003;
  constexpr double hold_k = 0.05;
  constexpr double hold_z = 0.02;
  const Network network = network_of(
      "@u audioParam @in2\n@s chain 12 1.3 0.2 0.003 0. 0.\n@in1 posInput 0.\n"
      "@h springDamper @in1 [@s u] 0.05 0.02\n@out1 posOutput [@s u]\n@out2 frcOutput @in1\n");
  auto compiled = compile(network, default_preset(network, true), {.bare = true});
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
    coordinate[n] = 0.5 + 0.7 * place(n);  // beyond both ends at times: it is clamped
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

TEST_CASE("wrong macros and places are told with line and column", "[macro]") {
  struct Wrong {
    const char* text;
    int column;
    const char* message;
  };
  for (const Wrong& wrong :
       {Wrong{"@s string 2000000000 1 1 0 0 0\n", 11, "a number of nodes from 2 to 4000000"},
        Wrong{"@s string 1 1 1 0 0 0\n", 11, "a number of nodes from 2"},
        Wrong{"@s mesh 3000 3000 1 1 0 0 0\n", 9, "more than 4000000 nodes together"},
        Wrong{"@s string 5 1 1 0\n", 18, "'string' takes 5 to 7 arguments"},
        Wrong{"@s string n 1 1 0 0 0\n", 11, "found 'n' where a number of nodes"}}) {
    INFO(wrong.text);
    const ParsedNetwork parsed = parse_network(wrong.text);
    REQUIRE_FALSE(parsed.ok());
    CHECK(parsed.diagnostics[0].column == wrong.column);
    CHECK(parsed.diagnostics[0].message.find(wrong.message) != std::string::npos);
  }
  const std::string string = "@s string 5 1 1 0 0 0\n@m mesh 3 3 1 1 0 0 0\n@p mass 1 0 0\n";
  for (const Wrong& wrong :
       {Wrong{"@o springDamper @m @p 1 0.1 0.5", 17, "needs two coordinates, [@m u v]"},
        Wrong{"@o spring [@m 0.5] @p 1", 11, "needs two coordinates, [@m u v]"},
        Wrong{"@o spring [@q 0.5] @p 1", 12, "no macro is called '@q'"},
        Wrong{"@o spring [@p 0.5] [@s 1] 1", 12, "is one mass"},
        Wrong{"@o spring [@s w] @p 1", 15, "'w' is no parameter"}}) {
    INFO(wrong.text);
    const ParsedNetwork parsed = parse_network(string + wrong.text);
    REQUIRE_FALSE(parsed.ok());
    CHECK(parsed.diagnostics[0].line == 4);
    CHECK(parsed.diagnostics[0].column == wrong.column);
    CHECK(parsed.diagnostics[0].message.find(wrong.message) != std::string::npos);
  }
}

}  // namespace ressort
