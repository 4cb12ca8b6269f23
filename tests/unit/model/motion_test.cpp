// The meaning of the third state argument: how the reader decides it, reports it and warns if it is
// uncertain.
#include <string>

#include "core/model/language/mdl.h"
#include "tests/support/catch.h"
#include "tests/support/harness.h"

namespace ressort::motion_test {
namespace {

constexpr ThirdArgument delayed = ThirdArgument::delayed_position;
constexpr ThirdArgument velocity = ThirdArgument::velocity_per_second;
const std::string ends = "@a mass 1 0 0\n@b mass 1 0 0\n";

std::string motion_warning(const ParsedNetwork& parsed) {
  for (const Diagnostic& diagnostic : parsed.diagnostics) {
    if (diagnostic.message.find(" is read as ") != std::string::npos) {
      return std::to_string(diagnostic.line) + ": " + diagnostic.message;
    }
  }
  return "";
}

}  // namespace

TEST_CASE("the reader reports the meaning of a motion and the reason", "[motion]") {
  struct Case {
    std::string text;
    ThirdArgument third;
    std::string motion;
  };
  const std::string per_second = "a velocity in units per second, as ";
  const std::string before = "the position one sample before, as ";
  for (const Case& c : {
           Case{ends, delayed, "both meanings agree: every mass starts at 0, at rest"},
           Case{ends + "@l nlContact @a @b 1 1 1 1", delayed,
                "both meanings agree: every mass starts at 0, at rest"},
           Case{"~motion velocity\n@a mass 1 1 1", velocity, per_second + "line 1 says"},
           Case{"@a mass 1 1 0\n~motion delayed", delayed, before + "line 2 says"},
           Case{"@a mass 1 1 1", delayed,
                before + "line 1 rests with a motion equal to its position"},
           Case{"@a mass 1 0 1", delayed, before + "line 1 starts from 0"},
           Case{"@a mass 1 1 0", velocity,
                per_second + "line 1 rests away from 0 with a motion of 0"},
           Case{"@a mass 1 1 2", delayed, before + "nothing indicates the other meaning"},
           Case{"@a mass 1 1 2\n@b osc 1 1 1 1 0", velocity,
                per_second + "line 2 rests away from 0 with a motion of 0"},
           Case{"@a mass 1 [0 0 1] 2", velocity,
                per_second + "line 1 writes a position as [x y z], which is MIMS4Max"},
           Case{"@a mass [2*3] 1 2", velocity,
                per_second + "line 1 writes an argument in brackets, which is MIMS4Max"},
           Case{"@a mass 1 1 1 2", velocity,
                per_second + "line 1 gives a gravity without 'massG', which is MIMS4Max"},
           Case{"@a osc 1 1 1 1 1 2", velocity,
                per_second + "line 1 gives a gravity without 'massG', which is MIMS4Max"},
           Case{"@s string 5 1 1 0 1 2", velocity,
                per_second + "line 1 gives a macro a motion, which is MIMS4Max"},
           Case{"~begin x\n@a mass 1 1 1\n~end x", velocity,
                per_second + "line 1 opens a block, which is MIMS4Max"},
           Case{ends + "@c mass 1 1 1\n@l nlSpringDamper @a @b 1 1 1 1", velocity,
                per_second + "line 4 has 'nlSpringDamper', which is MIMS4Max"},
           Case{ends + "@c mass 1 1 1\n@l nlContact @a @b 1 1 1 1", velocity,
                per_second + "line 4 has 'nlContact', which is MIMS4Max"},
           Case{ends + "@c mass 1 1 1\n@l contact @a @b 1 1", velocity,
                per_second + "line 4 gives a contact no threshold, which is MIMS4Max"},
           Case{ends + "@c mass 1 1 1\n@l nlPluck @a @b 1 1 1", velocity,
                per_second + "line 4 gives a pluck a damping, which is MIMS4Max"},
           Case{ends + "@c mass 1 1 1\n@l nlBow @a @b 1 1 1", velocity,
                per_second + "line 4 chooses a bow's profile, which is MIMS4Max"},
           Case{"@a massG 1 1 1 0", delayed, before + "line 1 has 'massG', which is MIMS"},
           Case{"@a mass 1 1 0 x 1 1", delayed,
                before + "line 1 names a drawing after its arguments, which is MIMS"},
           Case{"@s string 5 1 1 0 1", delayed,
                before + "line 1 gives a macro no motion, which is MIMS"},
           Case{"@a mass 1 1 0\n@out1 posOutput @s 1\n@s string 5 1 1 0 0 ", delayed,
                before + "line 2 writes a place on a macro without brackets, which is MIMS"},
       }) {
    INFO(c.text);
    const ParsedNetwork parsed = parse_network(c.text);
    REQUIRE(parsed.ok());
    CHECK(parsed.network.third == c.third);
    CHECK(parsed.third == (c.motion.starts_with("both") ? std::nullopt : std::optional(c.third)));
    CHECK(parsed.motion == c.motion);
    CHECK(motion_warning(parsed).empty());
  }
}

TEST_CASE("the option for the meaning overrides the text", "[motion]") {
  for (const std::string text :
       {"@a mass 1 1 2", "@a mass 1 1 0", "~motion velocity\n@a mass 1 1 2",
        "~motion delayed\n@a mass 1 [0 0 1] 2"}) {
    for (const ThirdArgument third : {delayed, velocity}) {
      INFO(text);
      const ParsedNetwork parsed = parse_network(text, {.third = third});
      REQUIRE(parsed.ok());
      CHECK(parsed.network.third == third);
      CHECK(parsed.network.masses[0].third == parse_network(text).network.masses[0].third);
      CHECK(parsed.motion.ends_with(", as requested"));
      CHECK(parse_network(text, {.third = third, .third_by = "the preset says"})
                .motion.ends_with(", as the preset says"));
    }
  }
}

TEST_CASE("the meaning determines the initial velocity", "[motion]") {
  const auto speed = [](const std::string& text) {
    const Network network = support::network_of(text);
    return initial_velocity(network, network.masses[0]);
  };
  CHECK(speed("~motion velocity\n@a mass 1 1 441") == 0.01);
  CHECK(speed("~motion delayed\n@a mass 1 1 441") == -440.0);
  CHECK(speed("~motion delayed\n@a mass 1 1 0") == 1.0);  // a jump, as written
  // A macro without a motion is at rest in both meanings.
  for (const std::string word : {"velocity", "delayed"}) {
    const Network network = support::network_of("~motion " + word + "\n@s chain 5 1 1 0 3");
    const Macro& macro = network.macros[0];
    CHECK(macro.third == (network.third == velocity ? 0.0 : macro.position));
  }
}

TEST_CASE("states that fit both meanings are read as rest, with a warning", "[motion]") {
  const ParsedNetwork parsed =
      parse_network("@a mass 1 2 2\n@b mass 1 3 0\n@c osc 1 1 1 -1 0\n@d mass 1 0 0");
  REQUIRE(parsed.ok());
  CHECK(parsed.network.third == delayed);
  for (const Mass& mass : parsed.network.masses) {
    CHECK(initial_velocity(parsed.network, mass) == 0.0);
  }
  CHECK(motion_warning(parsed) ==
        "2: a motion of 0 is read as rest, although motions are the position one sample before, as "
        "line 1 rests with a motion equal to its position; add '~motion velocity' or '~motion "
        "delayed' to decide");
}

TEST_CASE("a mix of dialects causes a warning only if something moves", "[motion]") {
  const std::string both = ends + "@g massG 1 0.1 0 0\n@l nlContact @a @b 1 1 1 1\n";
  const ParsedNetwork moving = parse_network(both + "@c mass 1 2 1");
  REQUIRE(moving.ok());
  CHECK(moving.network.third == velocity);
  CHECK(motion_warning(moving) ==
        "5: its motion is read as a velocity in units per second, as line 4 has 'nlContact', which "
        "is MIMS4Max; but line 3 has 'massG', which is MIMS: add '~motion delayed' to read the "
        "motions as MIMS does, or '~motion velocity' to keep this reading");
  CHECK(motion_warning(parse_network(both)).empty());
  CHECK(motion_warning(parse_network(both + "@c mass 1 2 0")).empty());
  CHECK(motion_warning(parse_network(both + "@c mass 1 2 1\n~motion velocity")).empty());
  CHECK(motion_warning(parse_network(both + "@c mass 1 2 1", {.third = delayed})).empty());
  CHECK(motion_warning(parse_network(both + "@s string 5 1 1 0 0 1"))
            .starts_with("5: its motion is read"));
}

TEST_CASE("unknown and contradictory meanings are errors", "[motion]") {
  struct Wrong {
    const char* text;
    int line;
    int column;
    const char* message;
  };
  for (const Wrong& wrong :
       {Wrong{"@a mass 1 0 0\n~motion", 2, 1, "expected '~motion velocity' or '~motion delayed'"},
        Wrong{"~motion speed\n@a mass 1 0 0", 1, 9,
              "expected '~motion velocity' or '~motion delayed'"},
        Wrong{"~motion velocity now\n@a mass 1 0 0", 1, 9,
              "expected '~motion velocity' or '~motion delayed'"},
        Wrong{"~motion velocity\n@a mass 1 0 0\n ~motion delayed", 3, 10,
              "line 1 says the opposite"}}) {
    INFO(wrong.text);
    const ParsedNetwork parsed = parse_network(wrong.text);
    REQUIRE_FALSE(parsed.ok());
    CHECK(parsed.diagnostics[0].line == wrong.line);
    CHECK(parsed.diagnostics[0].column == wrong.column);
    CHECK(parsed.diagnostics[0].message == wrong.message);
  }
  CHECK(parse_network("~motion velocity\n~motion velocity # again\n@a mass 1 0 0").ok());
}

}  // namespace ressort::motion_test
