// The chains kernel: detection of strings, and their motion.
#include <utility>

#include "core/kernels/chains/chains_form.h"
#include "tests/support/comparison.h"

namespace ressort::chains_test {
namespace {

using support::Comparison;
using support::ComparisonOptions;
using support::isas;
using support::program_of;
using support::Random;
using support::show;

// Returns the Program in the form of chains. It must contain at least one chain.
Program formed(const std::string& text) {
  Program program = program_of(text);
  auto form = chains_form(program);
  REQUIRE(form.has_value());
  program.form = std::move(*form);
  return program;
}

template <class T>
void check_same(const Program& program, ComparisonOptions options, double most_relative,
                double least_snr_db) {
  for (const Isa isa : isas()) {
    options.isa = isa;
    for (const Comparison& output : support::compare_kernels<T>(program, options)) {
      INFO("on " << isa_name(isa) << ", seed " << options.seed << ": " << show(output.relative())
                 << " of the peak, " << output.snr_db() << " dB");
      CHECK(output.worst <= most_relative * output.peak);
      CHECK(output.noise <= output.signal * std::pow(10.0, -least_snr_db / 10.0));
    }
  }
}

// Compares in double and, unless a contact amplifies rounding, in float.
void check_both(const Program& program, const ComparisonOptions& options,
                double most_relative = 1e-12) {
  check_same<double>(program, options, most_relative, 200.0);
  check_same<float>(program, options, 1e-4, 100.0);
}

// A force is a difference of positions, so float is less precise for it, as it is for quiet outputs
// beside loud ones. This holds in the direct form too.
void check_float(const Program& program, ComparisonOptions options) {
  Program plain = program;
  plain.form = Form();
  const std::vector<Comparison> direct = support::compare_kernels<float>(plain, options);
  for (const Isa isa : isas()) {
    options.isa = isa;
    const std::vector<Comparison> chains = support::compare_kernels<float>(program, options);
    for (std::size_t i = 0; i < chains.size(); ++i) {
      INFO(isa_name(isa) << ", seed " << options.seed << ", output " << i << ": "
                         << chains[i].snr_db() << " dB, direct " << direct[i].snr_db());
      const double least_db = std::min(100.0, direct[i].snr_db() - 6.0);
      CHECK(chains[i].noise <= chains[i].signal * std::pow(10.0, -least_db / 10.0));
    }
  }
}

// Returns the lines in random order.
std::string shuffled(const std::string& text, std::uint64_t seed) {
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    lines.push_back(text.substr(at, end + 1 - at));
    at = end + 1;
  }
  Random random(seed);
  for (std::size_t i = lines.size(); i > 1; --i) {
    std::swap(lines[i - 1], lines[random.below(i)]);
  }
  std::string result;
  for (const std::string& line : lines) {
    result += line;
  }
  return result;
}

// A row of `count` masses p_m0..., without the links that hold its ends.
std::string row(const std::string& p, int count, const std::string& mass,
                const std::string& spring) {
  std::string text;
  for (int i = 0; i < count; ++i) {
    text += scenes::at(p + "_m", i) + " " + mass + " 0. 0.\n";
    if (i > 0) {
      text += scenes::at(p + "_r", i) + " springDamper " + scenes::at(p + "_m", i - 1) + " " +
              scenes::at(p + "_m", i) + " " + spring + "\n";
    }
  }
  return text;
}

// Springs of K2 between masses that are two apart.
std::string second_row(const std::string& p, int count, const std::string& k2) {
  std::string text;
  for (int i = 0; i + 2 < count; ++i) {
    text += scenes::at(p + "_s", i) + " spring " + scenes::at(p + "_m", i + 2) + " " +
            scenes::at(p + "_m", i) + " " + k2 + "\n";
  }
  return text;
}

// The masses and springs of the macro stiffString, with p_K, p_Z and p_K2, between grounds at 0.1
// and -0.2.
std::string stiff_string(const std::string& p, int count) {
  const std::string first = scenes::at(p + "_m", 0);
  const std::string last = scenes::at(p + "_m", count - 1);
  return "@" + p + "_K param 0.3\n@" + p + "_Z param 0.01\n@" + p + "_K2 param 0.1\n@" + p +
         "_g ground 0.1\n@" + p + "_h ground -0.2\n" +
         row(p, count, "mass 1.2", p + "_K " + p + "_Z") + second_row(p, count, p + "_K2") +
         "@a1 springDamper @" + p + "_g " + first + " " + p + "_K " + p + "_Z\n" +
         "@a2 springDamper " + last + " @" + p + "_h " + p + "_K " + p + "_Z\n" + "@a3 spring @" +
         p + "_g " + first + " " + p + "_K2\n@a4 spring " + last + " @" + p + "_h " + p +
         "_K2\n@a5 spring " + scenes::at(p + "_m", 1) + " @" + p + "_g " + p + "_K2\n@a6 spring " +
         scenes::at(p + "_m", count - 2) + " @" + p + "_h " + p + "_K2\n";
}

}  // namespace

TEST_CASE("strings are found in any order of their lines", "[chains]") {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    CAPTURE(seed);
    const Program program = formed(shuffled(scenes::plucked_harmonics(), seed));
    const auto& form = program.form.get<Chains>();
    REQUIRE(form.chains.size() == 1);
    const Chain& chain = form.chains[0];
    CHECK(chain.count == 150);
    CHECK(chain.left >= program.moving);
    CHECK(chain.right >= program.moving);
    CHECK(chain.left != chain.right);
    CHECK(form.loose.empty());
    CHECK(form.links.size() == 7);
    // All neighbours are linked.
    std::vector<std::uint64_t> springs;
    for (const Ends& ends : program.ends) {
      springs.push_back(std::uint64_t{std::min(ends.a, ends.b)} << 32 | std::max(ends.a, ends.b));
    }
    for (std::uint32_t i = 0; i + 1 < chain.count; ++i) {
      const auto [low, high] = std::minmax(form.nodes[i], form.nodes[i + 1]);
      CHECK(std::count(springs.begin(), springs.end(), std::uint64_t{low} << 32 | high) == 1);
    }
  }
}

TEST_CASE("networks without strings have no chains form", "[chains]") {
  CHECK(!chains_form(program_of(scenes::iplay_the_triangle())));
  CHECK(!chains_form(program_of(scenes::mesh_20x30())));
  CHECK(!chains_form(program_of(row("a", 7, "mass 1.", "0.1 0.01"))));
  CHECK(chains_form(program_of(row("a", 8, "mass 1.", "0.1 0.01"))));
  // A branching mass belongs to no string, and a different mass or spring ends a string.
  const std::string star =
      row("a", 8, "mass 1.", "0.1 0.01") + row("b", 9, "mass 1.", "0.1 0.01") +
      row("c", 10, "mass 1.", "0.1 0.01") + "@o mass 1. 0. 0.\n" +
      "@s1 springDamper @o @a_m0 0.1 0.01\n" + "@s2 springDamper @o @b_m0 0.1 0.01\n" +
      "@s3 springDamper @c_m9 @o 0.1 0.01\n" + "@s4 springDamper @c_m0 @b_m8 0.1 0.02\n";
  const auto form = chains_form(program_of(star));
  REQUIRE(form);
  CHECK(form->chains.size() == 3);
  CHECK(form->loose.size() == 1);
  CHECK(form->links.size() == 4);
  // A ring is cut at one of its masses.
  const auto ring = chains_form(
      program_of(row("a", 12, "mass 1.", "0.1 0.01") + "@s springDamper @a_m11 @a_m0 0.1 0.01\n"));
  REQUIRE(ring);
  CHECK(ring->chains[0].count == 12);
  CHECK(ring->links.size() == 1);
}

TEST_CASE("the instruments' strings match the direct kernel", "[chains]") {
  for (const bool turns : {false, true}) {
    CAPTURE(turns);
    check_both(formed(scenes::resonator()), {.reach = 1.0, .turns = turns});
    check_both(formed(scenes::physical_lfo()), {.reach = 0.1, .turns = turns, .pitch = 1.3});
    // Nearly constant bowing, because in float a bow slips a sample earlier or later.
    check_same<double>(formed(scenes::bowed_string()),
                       {.frames = 8000, .reach = 2e-3, .turns = turns}, 1e-9, 180.0);
    check_same<double>(formed(scenes::plucked_harmonics()),
                       {.frames = 22050, .reach = 0.03, .turns = turns}, 1e-9, 180.0);
    check_same<double>(formed(scenes::string_1000()),
                       {.frames = 22050, .reach = 0.03, .turns = turns, .pitch = 0.7}, 1e-9, 180.0);
  }
}

TEST_CASE("strings of every length fold into every pack", "[chains]") {
  for (int count = 8; count <= 70; ++count) {
    CAPTURE(count);
    for (const int ends : {0, 1, 2, 3}) {
      CAPTURE(ends);
      std::string text = row("a", count, "mass 1.", "0.2 0.01");
      text += "@in1 frcInput @a_m3\n";
      text += "@in2 posInput 0.5\n@g ground 0.2\n";
      if (ends & 1) {
        text += "@e springDamper @g @a_m0 0.2 0.01\n";
      }
      if (ends & 2) {
        text += "@f springDamper @in2 " + scenes::at("a_m", count - 1) + " 0.2 0.01\n";
      }
      text += scenes::output(1, "a_m0") + scenes::output(2, scenes::at("a_m", count - 1).substr(1));
      check_same<double>(formed(text), {.frames = 600, .reach = 0.1}, 1e-12, 200.0);
    }
  }
}

TEST_CASE("stiff strings are found in any order of their lines", "[chains]") {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    CAPTURE(seed);
    const Program program =
        formed(shuffled(stiff_string("a", 60) + "@in1 frcInput @a_m7\n@out1 posOutput @a_m50\n" +
                            "@out2 posOutput @a_m59\n",
                        seed));
    const auto& form = program.form.get<Chains>();
    REQUIRE(form.chains.size() == 1);
    CHECK(form.chains[0].count == 60);
    CHECK(form.chains[0].is_stiff);
    CHECK(form.loose.empty());
    CHECK(form.links.empty());
    const ComparisonOptions options{.frames = 10000, .seed = seed, .turns = true, .pitch = 0.9};
    check_same<double>(program, options, 1e-12, 200.0);
    check_float(program, options);
  }
  // The same string from the macro, whose ends are grounds, with places on it.
  const std::string macro =
      "@k param 0.4\n@k2 param 0.1\n@s stiffString 152 1. k k2 0.01 0. 0.\n@in1 frcInput [@s 0.3]\n"
      "@out1 posOutput [@s 0.81]\n";
  const Program program = formed(macro);
  CHECK(program.form.get<Chains>().chains.at(0).is_stiff);
  CHECK(program.form.get<Chains>().chains.at(0).count == 150);
  CHECK(program.form.get<Chains>().links.size() <= 1);  // the link of a ground to itself
  check_both(program, {.turns = true});
}

TEST_CASE("incomplete second springs stay ordinary links", "[chains]") {
  std::string text = row("a", 40, "mass 1.", "0.2 0.01") + second_row("a", 40, "0.05");
  const std::string missing = "@a_s17 spring @a_m19 @a_m17 0.05\n";
  const std::size_t at = text.find(missing);
  REQUIRE(at != std::string::npos);
  CHECK(chains_form(program_of(text))->chains.at(0).is_stiff);
  CHECK(chains_form(program_of(text))->links.empty());
  // A spring that is written twice acts twice. A spring to a node that is not an end of the chain
  // becomes a link.
  const std::string more = text +
                           "@x spring @a_m19 @a_m17 0.05\n@y spring @a_m3 @a_m30 0.05\n"
                           "@o mass 2. 0. 0.\n@z spring @a_m0 @o 0.05\n"
                           "@in1 frcInput @a_m18\n@out1 posOutput @a_m33\n";
  CHECK(chains_form(program_of(more))->chains.at(0).is_stiff);
  CHECK(chains_form(program_of(more))->links.size() == 3);
  check_both(formed(more), {.frames = 10000});
  const std::string less =
      text.erase(at, missing.size()) + "@in1 frcInput @a_m18\n@out1 posOutput @a_m33\n";
  CHECK(!chains_form(program_of(less))->chains.at(0).is_stiff);
  CHECK(chains_form(program_of(less))->links.size() == 37);
  check_both(formed(less), {.frames = 10000});
}

TEST_CASE("stiff strings of every length and every end fold into every pack", "[chains]") {
  for (int count = 8; count <= 70; ++count) {
    CAPTURE(count);
    for (const int ends : {0, 1, 2, 4, 8, 16, 32, 63, 21, 42}) {
      CAPTURE(ends);
      std::string text = row("a", count, "osc 1. 0.001 0.001", "0.2 0.01") +
                         second_row("a", count, "0.07") + "@in1 frcInput @a_m3\n" +
                         "@in2 posInput 0.5\n@g ground 0.2\n";
      const auto hold = [&](int bit, const std::string& label, const std::string& holder, int mass,
                            const std::string& spring) {
        if (ends & bit) {
          text += "@" + label + " " + holder + " " + scenes::at("a_m", mass) + " " + spring + "\n";
        }
      };
      hold(1, "e1 springDamper", "@g", 0, "0.2 0.01");
      hold(2, "e2 springDamper", "@in2", count - 1, "0.2 0.01");
      hold(4, "e3 spring", "@g", 0, "0.07");
      hold(8, "e4 spring", "@in2", 1, "0.07");
      hold(16, "e5 spring", "@g", count - 1, "0.07");
      hold(32, "e6 spring", "@in2", count - 2, "0.07");
      text += scenes::output(1, "a_m0") + scenes::output(2, scenes::at("a_m", count - 1).substr(1));
      text += "@out3 frcOutput @a_m1\n@out4 frcOutput " + scenes::at("a_m", count - 2) +
              "\n@out5 frcOutput @g\n@out6 frcOutput @in2\n";
      const Program program = formed(text);
      CHECK(program.form.get<Chains>().chains.at(0).is_stiff);
      CHECK(program.form.get<Chains>().links.empty());
      check_same<double>(program, {.frames = 300, .reach = 0.1}, 1e-12, 200.0);
    }
  }
}

TEST_CASE("elements beside a string act on it", "[chains]") {
  // Two strings of different masses; a free mass and an oscillator between them; every smooth law;
  // gravity; force outputs at a mass in the middle, at an end, at a free mass, and at a node that
  // holds a string.
  const std::string text =
      row("a", 40, "mass 1.", "0.2 0.01") + row("b", 23, "osc 2. 0.001 0.002", "k 0.02") +
      "@k param 0.3\n@q param 0.02\n@g ground 0.1\n@h ground -0.1\n@in1 posInput 0.\n"
      "@in2 frcInput @a_m17\n@in3 frcInput @o\n@in4 frcInput @g\n"
      "@ga springDamper @g @a_m0 0.2 0.01\n@gb springDamper @in1 @b_m22 k 0.02\n"
      "@o osc 1.5 0.01 0.001 0. 0.\n@p mass 3. 0.1 0.\n@w massG 1. 0.0001 0. 0.\n"
      "@l1 springDamper @o @a_m3 q 0.01\n@l2 nlSpring2 @p @o 0.05 0.01 0.01\n"
      "@l3 nlSpring3 @p @b_m4 0.05 0.01 0.01\n@l4 springDamper @w @h 0.05 0.01\n"
      "@l5 nlSpringDamper @w @a_m39 0.01 0.02 0.1 0.01\n@l6 nlBow @in1 @a_m30 0.01 0.5 1\n"
      "@l7 damper @a_m5 @b_m5 0.01\n@l8 springDamper @a_m20 @a_m21 q 0.\n"
      "@out1 posOutput @a_m20\n@out2 posOutput @b_m0\n@out3 posOutput @w\n@out4 posOutput @in1\n"
      "@out5 frcOutput @a_m17\n@out6 frcOutput @a_m39\n@out7 frcOutput @o\n@out8 frcOutput @g\n"
      "@out9 frcOutput @in1\n@out10 frcOutput @b_m9\n";
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    CAPTURE(seed);
    const Program program = formed(shuffled(text, seed));
    CHECK(program.form.get<Chains>().chains.size() == 2);
    CHECK(program.form.get<Chains>().loose.size() == 3);
    const ComparisonOptions options{
        .frames = 15000, .seed = seed, .reach = 0.05, .turns = seed > 1, .pitch = 0.9};
    check_same<double>(program, options, 1e-12, 200.0);
    check_float(program, options);
  }
}

// One string between a position input and a ground stays in registers. Neighbours are in the same
// pack or in different packs.
TEST_CASE("elements beside a short string act on it", "[chains]") {
  for (const int count : {9, 31, 32, 77, 160}) {
    CAPTURE(count);
    const auto at = [&](int part, int of) { return scenes::at("a_m", count * part / of); };
    const Program program =
        formed(row("a", count, "mass m", "k z") +
               "@m param 1.1\n@k param 0.2\n@z param 0.01\n@g ground 0.1\n@in1 posInput 0.\n"
               "@in2 frcInput " +
               at(1, 2) + "\n@in3 frcInput " + at(1, 3) +
               "\n@o osc 1.5 0.01 0.001 0. 0.\n@ga springDamper @g @a_m0 k z\n"
               "@ge springDamper @in1 " +
               scenes::at("a_m", count - 1) +
               " k z\n"
               "@l1 springDamper @o " +
               at(1, 2) +
               " 0.05 0.01\n"
               "@l2 nlSpring3 @o " +
               at(1, 3) +
               " 0.05 0.01 0.01\n"
               "@l3 springDamper " +
               at(1, 3) + " " + at(2, 3) +
               " 0.05 0.01\n"
               "@l4 damper " +
               at(1, 2) +
               " @in1 0.01\n"
               "@out1 posOutput @a_m0\n@out2 posOutput @o\n@out3 posOutput " +
               at(2, 3) + "\n");
    check_both(program, {.frames = 6000, .turns = true, .pitch = 1.1});
  }
}

TEST_CASE("contacts act on a string while they touch", "[chains]") {
  const Program program =
      formed(row("a", 40, "mass 1.", "0.2 0.01") +
             "@g ground 0.\n@s springDamper @g @a_m0 0.2 0.01\n@in1 posInput -0.2\n"
             "@in2 posInput 0.1\n@c1 contact @in1 @a_m7 0.05 0.02 0.15\n"
             "@c2 contact @a_m22 @in2 0.05 0.02 -0.02\n"
             "@c3 nlContact @a_m30 @in2 0.02 0.5 0.1 0.01 0.03\n"
             "@out1 posOutput @a_m39\n");
  check_same<double>(program, {.frames = 8000, .reach = 0.2, .lowest_hz = 5.0, .highest_hz = 50.0},
                     1e-11, 200.0);
}

TEST_CASE("random linked strings match the direct kernel", "[chains]") {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    CAPTURE(seed);
    Random random(seed);
    std::string text = "@k param 0.2\n@z param 0.01\n@in1 posInput 0.\n@g ground 0.\n";
    std::vector<std::string> masses = {"@g", "@in1"};
    for (const std::string name : {"a", "b", "c", "d"}) {
      const int count = static_cast<int>(4 + random.below(90));
      text += row(name, count, random.below(3) == 0 ? "osc 1.5 0.01 0.001" : "mass 1.2",
                  random.below(2) == 0 ? "k z" : "0.1 0.02");
      for (int i = 0; i < count; ++i) {
        masses.push_back(scenes::at(name + "_m", i));
      }
      text += "@h" + name + " springDamper @g " + scenes::at(name + "_m", 0) + " k z\n";
    }
    for (int i = 0; i < 12; ++i) {
      text += scenes::at("x", i) + " springDamper " + masses[random.below(masses.size())] + " " +
              masses[random.below(masses.size())] + (random.below(3) == 0 ? " k z\n" : " 0.05 z\n");
    }
    text += "@in2 frcInput " + masses[5] + "\n" + scenes::output(1, masses[4].substr(1)) +
            scenes::output(2, masses.back().substr(1));
    Program program = program_of(shuffled(text, seed));
    if (auto form = chains_form(program)) {
      program.form = std::move(*form);
      const ComparisonOptions options{.frames = 6000, .seed = seed, .turns = true};
      check_same<double>(program, options, 1e-12, 200.0);
      check_float(program, options);
    }
  }
}

TEST_CASE("places on a string and beside it transmit motion and force", "[chains]") {
  const std::string text =
      "@u param 0.3\n@s string 60 1. 0.2 0.01 0.0005 0. 0.\n@t chain 5 1. 0.1 0.01 0. 0.\n"
      "@in1 posInput 0.\n@in2 frcInput [@s u]\n@in3 frcInput [@t u]\n"
      "@l1 springDamper @in1 [@s 0.77] 0.1 0.01\n@l2 springDamper [@s 1.1 * u] [@t 2 * u] 0.1 0.\n"
      "@l3 springDamper [@s 1 - u] [@s u] 0.05 0.01\n@l4 springDamper [@t 0.] @in1 0.1 0.01\n"
      "@out1 posOutput [@s 2 * u]\n@out2 posOutput [@t u]\n";
  for (const bool turns : {false, true}) {
    CAPTURE(turns);
    const Program program = formed(text);
    CHECK(program.taps.size() >= 7);
    check_both(program, {.frames = 15000, .turns = turns});
  }
  CHECK(!chains_form(program_of(text + "@out3 frcOutput @in1\n")));
}

TEST_CASE("a stiffness driven by audio acts in every sample", "[chains]") {
  const Program program = formed("@k audioParam @in2\n" + row("a", 20, "mass 1.", "k 0.01") +
                                 "@in1 frcInput @a_m4\n@out1 posOutput @a_m16\n");
  REQUIRE(program.audio_coefficients.size() == 1);
  check_same<double>(program, {.frames = 2560}, 1e-12, 200.0);
}

TEST_CASE("a reset string restarts from any state", "[chains]") {
  const Program program = formed(scenes::resonator());
  support::Bare<float> used(program);
  support::Bare<float> fresh(program);
  CHECK(used.kernel().is_near_start(0, 1e-9));
  used.step({std::numeric_limits<double>::quiet_NaN()});
  for (int n = 0; n < 100; ++n) {
    used.step({0.5});
  }
  CHECK(!used.kernel().is_near_start(0, 1e9));
  used.kernel().reset(0);
  CHECK(used.kernel().is_near_start(0, 1e-9));
  used.feed(0, 0, 0.0);
  for (int n = 0; n < 100; ++n) {
    CHECK(used.step({0.1 * n}) == fresh.step({0.1 * n}));
  }
}

}  // namespace ressort::chains_test
