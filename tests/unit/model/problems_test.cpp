// The rules of the language for incorrect texts: errors and their positions, in one
// pass. rules_test.cpp tests correct texts.
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

namespace ressort::problems_test {
namespace {

using messages::check_error;
using messages::check_told;
using messages::check_warning;
using support::network_of;

const std::string two_masses = "@a mass 1. 0. 0.\n@b mass 1. 0. 0.\n";
const std::string heard = "@out1 posOutput @a\n";

}  // namespace

// --- R14 ---------------------------------------------------------------------------------------

TEST_CASE("unknown lines are skipped with a warning", "[problems]") {
  const std::string sounding = two_masses + "@l spring @a @b 1\n" + heard;
  const auto ignored = [](const std::string& word) {
    return "ignored: an element starts with '@', a comment with '#', found " + word;
  };
  check_warning(sounding + "  m mass 1. 0. 0.", 5, 3, ignored("'m'"));
  check_warning(sounding + "// a comment of another language", 5, 1, ignored("'//'"));
  check_warning(sounding + "[@a 0.5]", 5, 1, ignored("'[@a 0.5]'"));
  check_warning(sounding + "\x01\xff", 5, 1,
                ignored("'?"
                        "?'"));
  check_warning(sounding + std::string(60, 'x'), 5, 1,
                ignored("'" + std::string(40, 'x') + "...'"));
  check_told(sounding + "  # mass 1. 0. 0.\n   \n\t\n#@c mass 1 0 0\n", {});
  check_error(sounding + "@", 5, 1, "expected a label right after '@'");
  check_error(sounding + "@ c mass 1 0 0", 5, 1, "expected a label right after '@'");
}

// --- R17 ---------------------------------------------------------------------------------------

TEST_CASE("the laws are the current ones", "[problems]") {
  // Returns the force on the second end after one sample, at distance d and velocity v.
  const auto force = [](const std::string& link, double d, double v) {
    support::Bare<double> bare(make_program(
        network_of("@in1 posInput 0\n@g ground 0\n@l " + link + "\n@out1 frcOutput @g"), 44100.0,
        true));
    bare.step({d - v});
    return bare.step({d})[0];
  };
  // Within a tenth of the scale the pluck is damped, too; the law of 2018 attracts there.
  CHECK(force("nlPluck @in1 @g 1 1 0.5", 0.05, 0.25) == Approx(-0.9 * 0.05 + 0.5 * 0.25));
  CHECK(force("nlPluck @in1 @g 1 1", 0.5, 0.25) == Approx(-0.1 + 0.05));
  CHECK(force("nlBow @in1 @g 0.9 3", 0.0, 0.5) == Approx(0.6 * 0.5));
  CHECK(force("nlBow @in1 @g 0.9 3", 0.0, 2.0) == Approx(0.9 - 0.6));
  // Clipped at b = sqrt((k - s)/c) = 2, not at sqrt(k - s)/c = 1; extra damping beyond, and none in
  // the contact.
  CHECK(force("nlSpringDamper @in1 @g 1 1 5 0.5", 1.5, 0.25) ==
        Approx(1.5 + 1.5 * 1.5 * 1.5 + 0.125));
  CHECK(force("nlSpringDamper @in1 @g 1 1 5 0.5", 2.5, 0.25) == Approx(12.5 + 2.0 * 0.25));
  CHECK(force("nlContact @in1 @g 1 1 5 0.5", 2.5, 0.25) == Approx(12.5 + 0.125));
  CHECK(force("nlContact @in1 @g 1 1 5 0.5 2", -1.0, 0.25) == Approx(1.0 + 1.0 + 0.125));
  CHECK(force("powerContact @in1 @g 2 1.5 0.5 1", -0.75, 0.25) == Approx(2.125 * 0.125));
  // A contact may attract while it separates, as published.
  CHECK(force("contact @in1 @g 0.5 1", 0.5, -0.5) == Approx(0.25 - 0.5));
  CHECK(force("contact @in1 @g 0.5 1 1", -1.0, -0.5) == 0.0);
  CHECK(force("nlSpring3 @in1 @g 1 2 0", 0.5, 0.0) == Approx(0.5 + 2.0 * 0.125));  // once
}

// --- all of them -------------------------------------------------------------------------------

TEST_CASE("all errors of a file are reported in one pass", "[problems]") {
  check_told(
      "@p param one\n@a mass 1. 0. 0.\n@b mas 1. 0. 0.\nprose\n@r spring @a @c p\n"
      "@q spring @a @a\n@s string 1 1 1 0 0 0\n@in0 frcInput @a\n@out1 posOutput [@t 0.5]\n"
      "~end x\n@v mass [1+(2 0 0\n",
      {{Severity::error, 1, 10, 1,
        "found 'one' where the parameter's value, a number, was expected"},
       {Severity::error, 3, 4, 1, "unknown keyword 'mas'; did you mean 'mass'?"},
       {Severity::warning, 4, 1, 1,
        "ignored: an element starts with '@', a comment with '#', found 'prose'"},
       {Severity::error, 5, 14, 1, "no mass is called '@c'; did you mean '@a'?"},
       {Severity::error, 6, 16, 1, "'spring' takes 3 to 4 arguments (@A @B K [Z]), found 2"},
       {Severity::error, 7, 11, 1,
        "found '1' where a number of nodes from 2 to 4000000 was expected"},
       {Severity::error, 8, 1, 1,
        "'frcInput' needs the label '@inN' with N from 1 to 64, found '@in0'"},
       {Severity::error, 9, 18, 1, "no macro is called '@t'; did you mean '@s'?"},
       {Severity::error, 10, 6, 1, "no block 'x' is open here"},
       {Severity::error, 11, 9, 1, "this [ is never closed"}});
}

TEST_CASE("warnings stop after a hundred, and are not errors", "[problems]") {
  std::string text = two_masses + "@l spring @a @b 1\n" + heard;
  for (int i = 0; i < 300; ++i) {
    text += "prose\n";
  }
  const ParsedNetwork parsed = parse_network(text);
  CHECK(parsed.ok());
  REQUIRE(parsed.diagnostics.size() == 101);
  CHECK(parsed.diagnostics.back().message == "too many warnings; the rest are not shown");
  // An error after the warnings is still reported.
  const ParsedNetwork wrong = parse_network(text + "@c mas 1 0 0");
  CHECK_FALSE(wrong.ok());
  CHECK(wrong.diagnostics.back().line == 305);
}

TEST_CASE("searches for similar names are bounded", "[problems]") {
  std::string text = two_masses;
  std::string blocks = two_masses;
  for (int i = 0; i < 1025; ++i) {
    text += "@p" + std::to_string(i) + " param 1\n";
    blocks += "~begin b\n";
  }
  check_error(text, 1027, 1, "a model has at most 1024 parameters");
  check_error(blocks, 1027, 1, "more than 1024 blocks are open here");
}

TEST_CASE("errors have the format of compilers", "[problems]") {
  const ParsedNetwork parsed = parse_network(two_masses + "@l sprng @a @b 1\nx\n");
  REQUIRE(parsed.diagnostics.size() == 2);
  CHECK(to_string(parsed.diagnostics[0], "dir/x.mdl") ==
        "dir/x.mdl:3:4: error: unknown keyword 'sprng'; did you mean 'spring'?");
  CHECK(to_string(parsed.diagnostics[1], "x.mdl") ==
        "x.mdl:4:1: warning: ignored: an element starts with '@', a comment with '#', found 'x'");
}

TEST_CASE("arithmetic errors have a position", "[problems]") {
  const auto told = [](const std::string& argument, int column, const std::string& message) {
    check_error("@m mass " + argument + " 0 0", 1, column, message);
  };
  told("1/0", 9, "'1/0' is not a finite number");
  told("sqrt(0-1)", 9, "'sqrt(0-1)' is not a finite number");
  told("pow(10)", 15, "expected ',': pow takes 2 arguments");
  told("max(1,2,3)", 16, "expected ')' after the arguments of max");
  told("2**3", 11, "found '*' where a number, a name or '(' was expected");
  told("2*", 11, "the expression ends where a number, a name or '(' was expected");
  told("[ ]", 11, "the expression ends where a number, a name or '(' was expected");
  told("0x10", 10, "found 'x' where an operator or the end was expected");
  told("1,5", 10, "found ',' where an operator or the end was expected");
  told(std::string(40, '(') + "1" + std::string(40, ')'), 42,
       "the parentheses are nested too deeply");
  std::string sum = "1";
  for (int i = 0; i < 200; ++i) {
    sum += "+1";
  }
  told(sum, 266, "the expression is too long");
}

}  // namespace ressort::problems_test
