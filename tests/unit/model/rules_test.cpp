// The rules by which the dialects become one language. Rules about
// macros and places are in macro_test.cpp, those about errors in
// problems_test.cpp.
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "core/laws/laws.h"
#include "core/model/language/keywords.h"
#include "core/model/language/mdl.h"
#include "core/model/language/tokens.h"
#include "tests/support/app/messages.h"
#include "tests/support/catch.h"
#include "tests/support/harness.h"

namespace ressort::rules_test {
namespace {

using messages::check_error;
using messages::check_told;
using messages::check_warning;
using support::network_of;

constexpr auto delayed = ThirdArgument::delayed_position;
constexpr auto velocity = ThirdArgument::velocity_per_second;

const std::string two_masses = "@a mass 1. 0. 0.\n@b mass 1. 0. 0.\n";
const std::string heard = "@out1 posOutput @a\n";

double value(const Network& network, ArgumentId id) {
  return argument_value(network, id, parameter_values(network));
}

// Returns argument `slot` of the last link.
double link_value(const Network& network, std::size_t slot) {
  return value(network, network.links.back().arguments[slot]);
}

Network linked(const std::string& line) {
  return network_of("@p param 0.5\n" + two_masses + "@l " + line);
}

}  // namespace

// --- R1 ----------------------------------------------------------------------------------------

TEST_CASE("an unknown keyword is an error with a suggestion", "[rules]") {
  // Every keyword with a letter lost, a letter doubled, and two exchanged. The suggestion is no
  // further away than the intended word.
  for (const Keyword& keyword : keywords()) {
    const std::string word(keyword.word);
    std::string exchanged = word;
    std::swap(exchanged[1], exchanged[2]);
    for (const std::string& typed :
         {word.substr(0, 1) + word.substr(2), word + word.back(), exchanged}) {
      const bool is_a_word = std::any_of(keywords().begin(), keywords().end(),
                                         [&](const Keyword& k) { return k.word == typed; });
      if (is_a_word) {
        continue;
      }
      INFO(typed);
      const ParsedNetwork parsed = parse_network("@x " + typed + " 1");
      REQUIRE_FALSE(parsed.ok());
      const std::string& message = parsed.diagnostics[0].message;
      const std::string start = "unknown keyword '" + typed + "'; did you mean '";
      REQUIRE(message.starts_with(start));
      const std::string told = message.substr(start.size(), message.size() - start.size() - 2);
      CHECK(distance(typed, told) <= distance(typed, word));
      CHECK(parsed.diagnostics[0].column == 4);
      CHECK(parsed.diagnostics[0].length == static_cast<int>(typed.size()));
    }
  }
  check_error(two_masses + "@l springdamper @a @b 1 1", 3, 4,
              "unknown keyword 'springdamper'; did you mean 'springDamper'?");
  check_error(two_masses + "@l rubberBand @a @b 1 1", 3, 4, "unknown keyword 'rubberBand'");
  check_error(two_masses + "@l [@a] @b", 3, 4, "unknown keyword '[@a]'");
}

// --- R2 ----------------------------------------------------------------------------------------

TEST_CASE("older keywords are synonyms of newer ones", "[rules]") {
  CHECK(linked("springDamperDamper @a @b 1 2") == linked("springDamper @a @b 1 2"));
  CHECK(linked("detent @a @b 1 2 3") == linked("contact @a @b 1 2 3"));
  CHECK(linked("detent @a @b 1 2") == linked("contact @a @b 1 2"));
  CHECK(linked("nlSpring @a @b 1 2 3") == linked("nlSpring2 @a @b 1 2 3"));
  CHECK(network_of(two_masses + "@in1 forceInput @b") ==
        network_of(two_masses + "@in1 frcInput @b"));
  CHECK(network_of("@o cel 1 2 3 4 5") == network_of("@o osc 1 2 3 4 5"));
  CHECK(network_of("@o cel 1 2 3 9 4 5") == network_of("@o osc 1 2 3 9 4 5"));
  // Messages quote the word as written.
  check_error(two_masses + "@l detent @a @b 1", 3, 18,
              "'detent' takes 4 to 5 arguments (@A @B K Z [THRESHOLD]), found 3");
  check_error("@o cel 1 2 3 4", 1, 15,
              "'cel' takes 5 to 6 arguments (M K Z [G] POSITION MOTION), found 4");
}

// --- R3, R4 ------------------------------------------------------------------------------------

TEST_CASE("omitted arguments are 0", "[rules]") {
  CHECK(linked("spring @a @b 2 3") == linked("springDamper @a @b 2 3"));
  CHECK(linked("spring @a @b 2") == linked("springDamper @a @b 2"));
  struct Form {
    std::string less;
    std::string more;
    std::size_t slot;
  };
  for (const Form& form : {Form{"spring @a @b 2", "spring @a @b 2 7", 1},
                           Form{"springDamper @a @b 2", "springDamper @a @b 2 7", 1},
                           Form{"contact @a @b 2 3", "contact @a @b 2 3 7", 2},
                           Form{"nlPluck @a @b 2 3", "nlPluck @a @b 2 3 7", 2},
                           Form{"nlContact @a @b 2 3 4 5", "nlContact @a @b 2 3 4 5 7", 4}}) {
    INFO(form.more);
    const Network less = linked(form.less);
    const Network more = linked(form.more);
    CHECK(less.links[0].arguments[form.slot] == no_argument);
    CHECK(link_value(less, form.slot) == 0.0);
    CHECK(link_value(more, form.slot) == 7.0);
    for (std::size_t slot = 0; slot < form.slot; ++slot) {
      CHECK(link_value(less, slot) == link_value(more, slot));
      CHECK(link_value(less, slot) == 2.0 + static_cast<double>(slot));
    }
  }
  const Network damper = linked("damper @a @b 2");
  CHECK(link_value(damper, 0) == 0.0);
  CHECK(link_value(damper, 1) == 2.0);
  CHECK(linked("nlBow @a @b 2 3").links[0].law == Law::bow);
  CHECK(linked("nlBow @a @b 2 3 0.0").links[0].law == Law::bow);
  CHECK(linked("nlBow @a @b 2 3 0.5").links[0].law == Law::smooth_bow);
  CHECK(linked("nlBow @a @b 2 3 -1").links[0].law == Law::bow);
  CHECK(linked("nlBow @a @b 2 3 [2-1]") == linked("nlBow @a @b 2 3 1"));
  for (const char* const profile : {"p", "[1-p]", "[p+0*p]"}) {
    const Network turned = linked(std::string("nlBow @a @b 2 3 ") + profile);
    CHECK(turned.links[0].law == Law::either_bow);
    CHECK(link_value(turned, 2) == 0.5);
  }

  // The gravity of a mass or an oscillator, in the middle, may be omitted.
  const Network heavy = network_of("@a mass 2 3 4 5\n@b osc 2 3 4 5 6 7\n");
  CHECK(value(heavy, heavy.masses[0].gravity) == 3.0);
  CHECK(heavy.masses[0].position == 4.0);
  CHECK(heavy.masses[0].third == 5.0);
  CHECK(value(heavy, heavy.masses[1].gravity) == 5.0);
  CHECK(heavy.masses[1].position == 6.0);
  CHECK(heavy.masses[1].third == 7.0);
  const Network light = network_of("@a mass 2 4 5\n@b osc 2 3 4 6 7\n");
  CHECK(light.masses[0].gravity == no_argument);
  CHECK(light.masses[1].gravity == no_argument);
  CHECK(light.masses[1].position == 6.0);
}

// --- R5 ----------------------------------------------------------------------------------------

TEST_CASE("a form of one dialect determines the meaning of the third argument", "[rules]") {
  // The form is after a mass that would otherwise be read in the other meaning.
  const std::string as_delayed = two_masses + "@c mass 1 0 1\n@k param 1\n";
  const std::string as_velocity = two_masses + "@c mass 1 1 0\n@k param 1\n";
  REQUIRE(network_of(as_delayed).third == delayed);
  REQUIRE(network_of(as_velocity).third == velocity);
  for (const char* const line : {"@x mass 1 [0 0 0] 0",
                                 "@x mass 1 0 [0 0 0]",
                                 "@x ground [0 0 0]",
                                 "@in1 posInput [0 0 0]",
                                 "@x osc 1 1 1 [0 0 0] 0",
                                 "@x mass [k*2] 0 0",
                                 "@x mass '2 * k' 0 0",
                                 "@x spring @a @b [k]",
                                 "@x springDamper @a @b 1 [k + 1]",
                                 "~begin view\n~end view",
                                 "@x mass 1 1 0 0",
                                 "@x osc 1 1 1 1 0 0",
                                 "@x nlContact @a @b 1 1 1 1",
                                 "@x nlContact @a @b 1 1 1 1 1",
                                 "@x nlSpringDamper @a @b 1 1 1 1",
                                 "@x contact @a @b 1 1",
                                 "@x detent @a @b 1 1",
                                 "@x nlPluck @a @b 1 1 1",
                                 "@x nlBow @a @b 1 1 0",
                                 "@x nlBow @a @b 1 1 1",
                                 "@x string 5 1 1 1 0 0",
                                 "@x string 5 1 1 1 1 0 0",
                                 "@x chain 5 1 1 1 0 0",
                                 "@x chain 5 1 1 1 1 0 0",
                                 "@x stiffString 5 1 1 1 1 0 0",
                                 "@x stiffString 5 1 1 1 1 1 0 0",
                                 "@x mesh 2 2 1 1 1 0 0",
                                 "@x mesh 2 2 1 1 1 1 0 0",
                                 "@x closedMesh 3 3 1 1 1 0 0",
                                 "@x cornerMesh 3 3 1 1 1 0 0",
                                 "@x chain 5 1 1 1 0 0\n@y spring [@x 0] @a 1"}) {
    INFO(line);
    CHECK(network_of(as_delayed + line).third == velocity);
    CHECK(network_of(as_velocity + line).third == velocity);
  }
  for (const char* const line :
       {"@x massG 1 1 0 0", "@x massG 1 1 0 0 view 1 1", "@x mass 1 0 0 view 1 1",
        "@x osc 1 1 1 0 0 view 1 1", "@x ground 0 view 1 1", "@in1 posInput 0 view 1 1",
        "@x string 5 1 1 1 0", "@x chain 5 1 1 1 0", "@x stiffString 5 1 1 1 1 0",
        "@x mesh 2 2 1 1 1 0", "@x closedMesh 3 3 1 1 1 0", "@x cornerMesh 3 3 1 1 1 0",
        "@x chain 5 1 1 1 0\n@y springDamper @x @a 1 1 0.5",
        "@x mesh 3 3 1 1 1 0\n@out1 posOutput @x 0.5:0.5"}) {
    INFO(line);
    CHECK(network_of(as_delayed + line).third == delayed);
    CHECK(network_of(as_velocity + line).third == delayed);
  }
  // Forms that all dialects share indicate nothing.
  for (const char* const line :
       {"@x spring @a @b 1", "@x spring @a @b 1 1", "@x springDamper @a @b 1 1",
        "@x damper @a @b 1", "@x contact @a @b 1 1 1", "@x nlPluck @a @b 1 1", "@x nlBow @a @b 1 1",
        "@x nlSpring2 @a @b 1 1 1", "@x nlSpring3 @a @b 1 1 1", "@x mass k*2 0 0", "@x ground 1",
        "@in1 posInput 1", "@in1 frcInput @a", "@out1 frcOutput @a", "@x audioParam @in1",
        "# [0 0 0] ~begin massG"}) {
    INFO(line);
    CHECK(network_of(as_delayed + line).third == delayed);
    CHECK(network_of(as_velocity + line).third == velocity);
  }
  // If a file mixes dialects, the newer one wins.
  CHECK(network_of(two_masses + "@c massG 1 1 2 0\n@x contact @a @b 1 1").third == velocity);
}

TEST_CASE("otherwise the states determine the meaning", "[rules]") {
  const auto third = [](const std::string& text) { return network_of(text).third; };
  // (x, x) is at rest in one meaning, (x, 0) in the other; (0, x) has a velocity in MIMS.
  CHECK(third("@a mass 1 0 0") == delayed);
  CHECK(third("@a mass 1 1 1") == delayed);
  CHECK(third("@a mass 1 -0.02 -0.02") == delayed);
  CHECK(third("@a mass 1 0 1") == delayed);
  CHECK(third("@a mass 1 1 0.9") == delayed);
  CHECK(third("@a mass 1 1 0") == velocity);
  CHECK(third("@a mass 1 -1 0.") == velocity);
  CHECK(third("@a osc 1 .1 0 1 0") == velocity);
  CHECK(third("@a osc 1 .1 0 1 1") == delayed);
  // Grounds and position inputs have no third argument.
  CHECK(third("@a ground 1\n@in1 posInput 1\n@b mass 1 0 0") == delayed);

  // The result: the velocity per sample at the start.
  const auto start = [](const std::string& text) {
    const Network network = network_of(text);
    return initial_velocity(network, network.masses[0]);
  };
  CHECK(start("@a mass 1 1. 0.9") == 1. - 0.9);
  CHECK(start("@a mass 1 0 0.25") == -0.25);
  CHECK(start("@a mass 1 1 1") == 0.0);
  CHECK(start("@a mass 1 1 0") == 0.0);
  CHECK(start("@a mass 1 [0 0 2] -441") == -441. / 44100.);
  CHECK(start("@a ground 3\n@m mass 1 0 0") == 0.0);
  CHECK(start("@in1 posInput 2\n@m mass 1 0 0") == 0.0);
}

// --- R6 ----------------------------------------------------------------------------------------

TEST_CASE("the third component of a vector moves, the others are for drawing", "[rules]") {
  const Network network = network_of(
      "@a mass 2. [1. 2. 3.] -100\n@g ground [4 5 6]\n@in1 posInput [7 8 9]\n"
      "@o osc 1 1 1 [1 1 1] [2 2 2]\n@c chain 4 1 1 1 [1 2 3] [4 5 6]\n@p mass 1 0 0\n");
  CHECK(network.masses[0].position == 3.0);
  CHECK(network.masses[0].third == -100.0);
  CHECK(network.masses[1].position == 6.0);
  CHECK(network.masses[2].third == 2.0);
  CHECK(network.masses[4].position == 9.0);  // a position input follows the masses
  CHECK(network.macros[0].position == 3.0);
  CHECK(network.macros[0].third == 6.0);
  const auto drawn = [&](std::uint32_t drawing) { return network.drawings.at(drawing - 1); };
  CHECK(drawn(network.masses[0].drawing) == Drawing{"", 1.0, 2.0});
  CHECK(drawn(network.masses[4].drawing) == Drawing{"", 7.0, 8.0});
  CHECK(drawn(network.macros[0].drawing) == Drawing{"", 1.0, 2.0});
  CHECK(network.masses[3].drawing == 0);
  check_error("@a mass 1 [1 2] 0", 1, 11, "a position is one number or three, [x y z]; found 2");
  check_error("@a mass 1 [] 0", 1, 11, "a position is one number or three, [x y z]; found 0");
  check_error("@a mass 1 0 [1 2 3 4]", 1, 13,
              "a position is one number or three, [x y z]; found 4");
  check_error("@a mass 1 [1 y 3] 0", 1, 14, "found 'y' where a number was expected");
  check_error("@a mass 1 [1 2 3", 1, 11, "this [ is never closed");
  check_error("@a mass 'p + 1 0 0", 1, 9, "this ' is never closed");
  check_error("@a mass 1 0 '", 1, 13, "this ' is never closed");
}

TEST_CASE("display triples and blocks are kept as groups", "[rules]") {
  const Network triples = network_of(
      "@a mass 1 0 0 skin 1 -2\n@b massG 1 1 0 0 skin .5 0\n@o osc 1 1 1 0 0 bone 3 4\n"
      "@g ground 0 skin 5 6\n@c mass 1 0 0\n@in1 posInput 0 hand 7 8\n");
  const Drawing expected[] = {
      {"skin", 1, -2}, {"skin", .5, 0}, {"bone", 3, 4}, {"skin", 5, 6}, {"hand", 7, 8}};
  for (std::size_t i = 0; i < std::size(expected); ++i) {
    const std::size_t at = i < 4 ? i : i + 1;
    CHECK(triples.drawings.at(triples.masses[at].drawing - 1) == expected[i]);
  }
  CHECK(triples.masses[4].drawing == 0);

  // The innermost open block is the group; ending an outer one leaves it open.
  const Network blocks = network_of(
      "~begin x\n@a mass 1 0 0\n~begin y\n@b mass 1 [1 2 0] 0\n~end x\n@c chain 4 1 1 1 0 0\n"
      "~end y\n@d mass 1 0 0\n~begin x\n@in1 posInput 0\n@r spring @a @b 1\n~end x\n");
  const auto group = [&](std::uint32_t drawing) {
    return drawing == 0 ? "none" : blocks.drawings.at(drawing - 1).group;
  };
  CHECK(group(blocks.masses[0].drawing) == "x");
  CHECK(group(blocks.masses[1].drawing) == "y");
  CHECK(group(blocks.macros[0].drawing) == "y");
  CHECK(group(blocks.masses[2].drawing) == "none");
  CHECK(group(blocks.masses[3].drawing) == "x");
  check_error(two_masses + "~end x", 3, 6, "no block 'x' is open here");
  check_error(two_masses + "~begin", 3, 1, "expected '~begin NAME' or '~end NAME'");
  check_error(two_masses + "~begin x y", 3, 1, "expected '~begin NAME' or '~end NAME'");
  check_error(two_masses + "~open x", 3, 1, "expected '~begin NAME' or '~end NAME'");
  // A text that cannot be a name is a surplus argument.
  check_error(
      "@a mass 1 0 0 0 7 7", 1, 17,
      "'mass' takes 3 to 4 arguments (M [G] POSITION MOTION), found 6; a drawing is GROUP X "
      "Y, but '0' is not a group's name");
  check_error("@g ground 0 -1 7 7", 1, 13,
              "'ground' takes 1 argument (POSITION), found 4; a drawing is GROUP X Y, but '-1' is "
              "not a group's name");
  check_error("@o osc 1 1 1 0 0 [1 2 3] 7 7", 1, 26,
              "'osc' takes 5 to 6 arguments (M K Z [G] POSITION MOTION), found 8; a drawing is "
              "GROUP X Y, but '[1 2 3]' is not a group's name");
  check_error("@a mass 1 0 0 skin x 0", 1, 20,
              "found 'x' where a number was expected (a state at the start cannot be a parameter)");
}

// --- R7 ----------------------------------------------------------------------------------------

TEST_CASE("only links may share a label, and only outputs a number", "[rules]") {
  check_told(
      two_masses + "@l spring @a @b 1\n@l damper @a @b 1\n@l spring @b @a 2\n" + heard,
      {{Severity::warning, 4, 1, 1, "'@l' is already declared in line 3; both links are kept"},
       {Severity::warning, 5, 1, 1, "'@l' is already declared in line 3; both links are kept"}});
  CHECK(network_of(two_masses + "@l spring @a @b 1\n@l damper @a @b 1\n").links.size() == 2);
  const char* const others[] = {"@x spring @a @b 1", "@x param 1",  "@x audioParam @in1",
                                "@x mass 1 0 0",     "@x ground 0", "@x osc 1 1 1 0 0",
                                "@x chain 4 1 1 1 0"};
  for (const char* const first : others) {
    for (const char* const second : std::span(others).subspan(1)) {
      INFO(first << ", then " << second);
      const ParsedNetwork parsed =
          parse_network(two_masses + first + "\n" + second + "\n@y spring @x @a 1\n");
      REQUIRE_FALSE(parsed.ok());
      CHECK(parsed.diagnostics[0].message == "'@x' is already declared in line 3");
      CHECK(parsed.diagnostics[0].line == 4);
      CHECK(parsed.diagnostics[0].column == 1);
    }
  }
  check_error(two_masses + "@out1 posOutput @a\n@out1 mass 1 0 0", 4, 1,
              "'@out1' is already declared in line 3");
  check_error(two_masses + "@in1 frcInput @a\n@in1 posInput 0", 4, 1,
              "'@in1' is already declared in line 3");
}

// --- R8 ----------------------------------------------------------------------------------------

TEST_CASE("a plus adds, and a sum is scaled as a whole", "[rules]") {
  const Network network = linked("springDamper @a @b p*0.1+0.01 0.002+0.004*p");
  CHECK(link_value(network, 0) == 0.5 * 0.1 + 0.01);
  CHECK(link_value(network, 1) == 0.002 + 0.004 * 0.5);
  CHECK(link_value(linked("spring @a @b 1e+2"), 0) == 100.0);
  CHECK(link_value(linked("spring @a @b +p"), 0) == 0.5);
  // At twice the rate a damping is halved, with both of its terms.
  const Program program = make_program(network, 88200.0, true);
  const LinkRun& run = program.link_runs.at(0);
  const auto coefficient = [&](std::size_t i) {
    return coefficient_value(program, program.coefficients[run.coefficients[i]], program.parameters,
                             1.0);
  };
  CHECK(coefficient(0) == (0.5 * 0.1 + 0.01) / 4.0);
  CHECK(coefficient(1) == (0.002 + 0.004 * 0.5) / 2.0);
}

// --- R9 ----------------------------------------------------------------------------------------

TEST_CASE("a slash that an editor lost is restored with a warning", "[rules]") {
  const std::string start = "@kScale param 0.3\n@k2 param 8\n" + two_masses + heard;
  const std::string missing = "a '/' is missing (MIMS4Max drops the first one of a file); read as ";
  check_told(start + "@l springDamper @a @b sqrt(kScale3) k2",
             {{Severity::warning, 6, 23, 1, missing + "'sqrt(kScale/3)'"}});
  check_told(start + "@l springDamper @a @b [0.1 * kScale12] k2",
             {{Severity::warning, 6, 24, 1, missing + "'0.1 * kScale/12'"}});
  const Network network = network_of(start + "@l spring @a @b sqrt(kScale3)");
  CHECK(link_value(network, 0) == std::sqrt(0.3 / 3));
  // A parameter with exactly that name wins; a name without digits is an error.
  CHECK(link_value(network_of(start + "@l spring @a @b kScale*k2"), 0) == 0.3 * 8.0);
  check_error(start + "@l spring @a @b kScal*k2", 6, 17,
              "'kScal' is not a parameter of this model");
  check_error(start + "@l spring @a @b kScal", 6, 17,
              "'kScal' is not a parameter of this model; did you mean 'kScale'?");
  check_error(start + "@l spring @a @b kScale3x", 6, 17,
              "'kScale3x' is not a parameter of this model; did you mean 'kScale'?");
}

// --- R12 ---------------------------------------------------------------------------------------

TEST_CASE("unusual networks are accepted with warnings", "[rules]") {
  check_warning(two_masses + "@l spring @a @b 1", 1, 1,
                "the model has no output, so it will be silent");
  check_told(two_masses + "@l spring @a @b 1\n" + heard, {});
  check_told("@o osc 1 1 0 0 0\n@out1 posOutput @o", {});
  check_told(two_masses + "@l spring @a @b 1\n@k spring @b @a 1\n" + heard, {});
  check_told(two_masses + "@in1 posInput 0\n@l spring @a @in1 1\n@k spring @a @b 1\n" +
                 "@out1 posOutput @in1\n@out2 frcOutput @in1\n",
             {});
  const std::string sounding = two_masses + "@l spring @a @b 1\n" + heard;
  check_warning(sounding + "@c mass 1 0 0", 5, 1, "nothing is attached to '@c'");
  check_warning(sounding + "@c ground 0", 5, 1, "nothing is attached to '@c'");
  check_warning(sounding + "@in1 posInput 0", 5, 1, "nothing is attached to '@in1'");
  check_warning(sounding + "@k spring @b @b 1", 5, 14,
                "the link's two ends are the same mass: it has no effect");
  check_warning(sounding + "@p param 1", 5, 1, "the parameter 'p' is never used");
  check_warning(sounding + "@p audioParam @in1", 5, 1, "the parameter 'p' is never used");
  check_warning(
      sounding + "@in1 posInput 0\n@k contact @in1 @b 1 1 1", 6, 1,
      "the contact's ends look swapped: it acts while the second is below the first, here '@b' "
      "below '@in1'");
  check_told(sounding + "@in1 posInput 0\n@k contact @b @in1 1 1 1", {});
  check_warning(sounding + "@g ground 0\n@k spring @g @a 1\n @in1 frcInput @g", 7, 2,
                "'@in1' pushes '@g', which never moves: it has no effect");
  check_warning(sounding + "@in1 posInput 0\n@k spring @in1 @a 1\n@in2 frcInput @in1", 7, 1,
                "'@in2' pushes '@in1', which only follows its input: it has no effect");
  check_error("@p param 1", 1, 1, "the model has no masses, so it makes no sound");
  check_error("# nothing", 1, 1,
              "the model is empty: expected elements such as '@m mass 1. 0. 0.'");
}

TEST_CASE("missing channels cause a warning", "[rules]") {
  const std::string sounding = two_masses + "@l spring @a @b 1\n";
  check_warning(sounding + "@out1 posOutput @a\n  @out3 posOutput @b\n", 5, 3,
                "there is @out3, but no @out2");
  check_told(sounding + heard + "@in4 frcInput @a\n@in2 frcInput @b\n",
             {{Severity::warning, 5, 1, 1, "there is @in4, but no @in1"},
              {Severity::warning, 5, 1, 1, "there is @in4, but no @in3"}});
  check_warning(sounding + heard + "@in64 frcInput @a\n", 5, 1,
                "there is @in64, but none of @in1 to @in63");
  // The channel of an audio parameter is not a gap, and may also be a position input.
  check_told(sounding + heard + "@in2 frcInput @a\n@p audioParam @in1\n@k spring @a @b p\n", {});
  check_told(sounding + heard + "@in1 frcInput @a\n@p audioParam @in1\n@k spring @a @b p\n", {});
  check_warning(sounding + heard + "@p audioParam @in2\n@k spring @a @b p\n", 5, 1,
                "there is @in2, but no @in1");
}

// --- R13, R15, R16 -----------------------------------------------------------------------------

TEST_CASE("gravity is divided by the reference rate in MIMS4Max, and not in MIMS", "[rules]") {
  // One step from rest: v = -g/M, with g as in the dialect.
  const auto first_step = [](const std::string& mass, double rate_hz, bool rescale) {
    support::Bare<double> bare(
        make_program(network_of(mass + "\n@out1 posOutput @m"), rate_hz, rescale));
    return bare.step({})[0];
  };
  CHECK(first_step("@m massG 2. 0.5 0. 0.", 44100.0, true) == -0.25);
  CHECK(first_step("@m mass 2. 441 0. 0.", 44100.0, true) == -441.0 / 44100.0 / 2.0);
  CHECK(first_step("@m osc 2. 0. 0. 441 0. 0.", 44100.0, true) == -441.0 / 44100.0 / 2.0);
  // Half the time gives a quarter of the distance; raw numbers ignore the rate.
  CHECK(first_step("@m massG 2. 0.5 0. 0.", 88200.0, true) == -0.25 / 4.0);
  CHECK(first_step("@m mass 2. 441 0. 0.", 88200.0, true) == -441.0 / 44100.0 / 8.0);
  CHECK(first_step("@m massG 2. 0.5 0. 0.", 88200.0, false) == -0.25);
}

TEST_CASE("coefficients follow the sample rate unless rescaling is off", "[rules]") {
  const Network network =
      network_of(two_masses +
                 "@s springDamper @a @b 8 4\n@w nlBow @a @b 8 4\n@k nlPluck @a @b 8 4 2\n"
                 "@c contact @a @b 8 4 2\n");
  const auto coefficients = [&](double rate_hz, bool rescale, Law law) {
    const Program program = make_program(network, rate_hz, rescale);
    const auto run = std::find_if(program.link_runs.begin(), program.link_runs.end(),
                                  [&](const LinkRun& r) { return r.law == law; });
    std::vector<double> values;
    for (std::size_t i = 0; i < 3; ++i) {
      values.push_back(coefficient_value(program, program.coefficients[run->coefficients[i]],
                                         program.parameters, 1.0));
    }
    return values;
  };
  CHECK(coefficients(88200.0, true, Law::spring) == std::vector{2.0, 2.0, 0.0});
  CHECK(coefficients(88200.0, true, Law::bow) == std::vector{4.0, 2.0, 0.0});
  CHECK(coefficients(88200.0, true, Law::pluck) == std::vector{2.0, 4.0, 1.0});
  CHECK(coefficients(88200.0, true, Law::contact) == std::vector{2.0, 2.0, 2.0});
  CHECK(coefficients(88200.0, false, Law::contact) == std::vector{8.0, 4.0, 2.0});
  CHECK(coefficients(44100.0, true, Law::bow) == std::vector{8.0, 4.0, 0.0});
}

TEST_CASE("forces and positions act in the same sample", "[rules]") {
  support::Bare<double> struck(
      make_program(network_of("@m mass 2 0 0\n@in1 frcInput @m\n@in2 frcInput @m\n"
                              "@out1 posOutput @m\n@out2 frcOutput @m"),
                   44100.0, true));
  CHECK(struck.step({1.0, 0.5}) == std::vector{0.75, 1.5});
  CHECK(struck.step({0.0, 0.0}) == std::vector{1.5, 0.0});
  // A position is output at once; the mass moves one sample later.
  support::Bare<double> pulled(
      make_program(network_of("@m mass 2 0 0\n@in1 posInput 0\n@l spring @in1 @m 0.5\n"
                              "@out1 posOutput @in1\n@out2 posOutput @m\n@out3 frcOutput @in1\n"
                              "@out4 frcOutput @m"),
                   44100.0, true));
  CHECK(pulled.step({1.0}) == std::vector{1.0, 0.0, -0.5, 0.5});
  CHECK(pulled.step({1.0}) == std::vector{1.0, 0.25, -0.375, 0.375});
}

}  // namespace ressort::rules_test
