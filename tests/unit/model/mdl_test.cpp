// The .mdl reader: accepted forms, their meaning, and the position of every error.
#include "core/model/language/mdl.h"

#include <string>
#include <vector>

#include "core/laws/laws.h"
#include "core/model/language/tokens.h"
#include "tests/support/catch.h"
#include "tests/support/harness.h"

namespace ressort::mdl_test {
namespace {

using support::network_of;

const std::string two_masses = "@a mass 1. 0. 0.\n@b mass 1. 0. 0.\n";

std::vector<Diagnostic> said(const ParsedNetwork& parsed, Severity severity) {
  std::vector<Diagnostic> of_it;
  for (const Diagnostic& diagnostic : parsed.diagnostics) {
    if (diagnostic.severity == severity) {
      of_it.push_back(diagnostic);
    }
  }
  return of_it;
}

// Returns argument `slot` of the only link.
double link_value(const Network& network, std::size_t slot) {
  return argument_value(network, network.links.at(0).arguments.at(slot), parameter_values(network));
}

struct Complaint {
  std::string text;
  int line;
  int column;
  std::string message;
};

// Checks that the text has exactly this one error at this position.
void check_error(const Complaint& complaint) {
  const ParsedNetwork parsed = parse_network(complaint.text);
  const auto errors = said(parsed, Severity::error);
  INFO(complaint.text);
  CHECK_FALSE(parsed.ok());
  REQUIRE(errors.size() == 1);
  CHECK(errors[0].message == complaint.message);
  CHECK(errors[0].line == complaint.line);
  CHECK(errors[0].column == complaint.column);
  CHECK(errors[0].length >= 1);
}

}  // namespace

TEST_CASE("every keyword accepts only its numbers of arguments", "[mdl]") {
  struct Form {
    std::string start;          // label, keyword and references
    std::string word;           // as in the message
    std::vector<int> accepted;  // numbers of arguments after the references
    int references = 0;
  };
  const std::vector<Form> forms = {
      {"@p param", "param", {1}},
      {"@g ground", "ground", {1}},
      {"@m mass", "mass", {3, 4}},
      {"@m massG", "massG", {4}},
      {"@o osc", "osc", {5, 6}},
      {"@o cel", "cel", {5, 6}},
      {"@in1 posInput", "posInput", {1}},
      {"@in1 frcInput @a", "frcInput", {0}, 1},
      {"@in1 forceInput @a", "forceInput", {0}, 1},
      {"@out1 posOutput @a", "posOutput", {0, 1}, 1},
      {"@out1 frcOutput @a", "frcOutput", {0, 1}, 1},
      {"@l spring @a @b", "spring", {1, 2}, 2},
      {"@l springDamper @a @b", "springDamper", {1, 2}, 2},
      {"@l springDamperDamper @a @b", "springDamperDamper", {1, 2}, 2},
      {"@l damper @a @b", "damper", {1}, 2},
      {"@l nlSpring @a @b", "nlSpring", {3}, 2},
      {"@l nlSpring2 @a @b", "nlSpring2", {3}, 2},
      {"@l nlSpring3 @a @b", "nlSpring3", {3}, 2},
      {"@l nlSpringDamper @a @b", "nlSpringDamper", {4}, 2},
      {"@l nlContact @a @b", "nlContact", {4, 5}, 2},
      {"@l powerContact @a @b", "powerContact", {2, 3, 4}, 2},
      {"@l nlPluck @a @b", "nlPluck", {2, 3}, 2},
      {"@l nlBow @a @b", "nlBow", {2, 3}, 2},
      {"@l contact @a @b", "contact", {2, 3}, 2},
      {"@l detent @a @b", "detent", {2, 3}, 2},
  };
  for (const Form& form : forms) {
    std::string line = form.start;
    for (int count = 0; count <= 9; ++count) {
      INFO(line);
      const ParsedNetwork parsed = parse_network(two_masses + line);
      const bool accepted =
          std::find(form.accepted.begin(), form.accepted.end(), count) != form.accepted.end();
      CHECK(parsed.ok() == accepted);
      if (!accepted) {
        const auto errors = said(parsed, Severity::error);
        REQUIRE(errors.size() == 1);
        CHECK(errors[0].line == 3);
        CHECK(errors[0].message.starts_with("'" + form.word + "' takes "));
        CHECK(errors[0].message.find("found " + std::to_string(count + form.references)) !=
              std::string::npos);
        // The position is the end of the line, or the first surplus argument.
        const int most = form.accepted.back();
        const bool missing = count < form.accepted.front();
        const std::size_t column =
            missing ? line.size() + 1 : form.start.size() + 2 + 2 * static_cast<std::size_t>(most);
        CHECK(errors[0].column == static_cast<int>(column));
      }
      line += " 1";
    }
  }
  // References are counted like arguments.
  check_error({two_masses + "@l spring @a", 3, 13,
               "'spring' takes 3 to 4 arguments (@A @B K [Z]), found 1"});
  check_error({two_masses + "@out1 posOutput", 3, 16,
               "'posOutput' takes 1 to 2 arguments (@MASS [LEVEL]), found 0"});
}

TEST_CASE("masses, grounds and oscillators are read correctly", "[mdl]") {
  const Network network = network_of(
      "@p param 0.5\n"
      "@m mass p 1. 2. membrane 0.25 -3\n"
      "@o osc 1. 2.*p .25 0. 0.\n"
      "@g ground -0.2\n"
      "@in3 posInput 4.\n"
      "@in1 frcInput @m\n"
      "@out2 posOutput @o\n");
  REQUIRE(network.masses.size() == 4);
  const auto value = [&](ArgumentId id) {
    return argument_value(network, id, parameter_values(network));
  };
  const Mass& m = network.masses[0];
  CHECK(m.name == "m");
  CHECK(m.kind == MassKind::mass);
  CHECK(value(m.mass) == 0.5);
  CHECK(m.position == 1.0);
  CHECK(m.third == 2.0);
  REQUIRE(m.drawing == 1);
  CHECK(network.drawings[0] == Drawing{"membrane", 0.25, -3.0});
  CHECK(m.location.line == 2);
  CHECK(m.location.column == 1);
  const Mass& o = network.masses[1];
  CHECK(o.kind == MassKind::oscillator);
  CHECK(value(o.mass) == 1.0);
  CHECK(value(o.stiffness) == 1.0);
  CHECK(value(o.damping) == 0.25);
  CHECK(o.drawing == 0);
  CHECK(network.masses[2].kind == MassKind::ground);
  CHECK(network.masses[2].position == -0.2);
  CHECK(network.masses[3].kind == MassKind::position);
  CHECK(network.masses[3].position == 4.0);
  // Inputs are sorted by number in any order of the lines.
  REQUIRE(network.inputs.size() == 2);
  CHECK(network.inputs[0].number == 1);
  CHECK(network.inputs[0].is_force);
  CHECK(network.inputs[0].mass == 0);
  CHECK(network.inputs[1].number == 3);
  CHECK_FALSE(network.inputs[1].is_force);
  CHECK(input_count(network) == 3);
  CHECK(output_count(network) == 2);
}

TEST_CASE("links are read correctly", "[mdl]") {
  const auto link = [](const std::string& line) { return network_of(two_masses + "@l " + line); };
  Network n = link("spring @b @a 2");
  CHECK(n.links[0].law == Law::spring);
  CHECK(n.links[0].a == 1);
  CHECK(n.links[0].b == 0);
  CHECK(link_value(n, 0) == 2.0);
  CHECK(link_value(n, 1) == 0.0);
  CHECK(link("springDamper @a @b 2 3") == link("spring @a @b 2 3"));
  CHECK(link("springDamperDamper @a @b 2 3") == link("springDamper @a @b 2 3"));
  n = link("damper @a @b 3");
  CHECK(n.links[0].law == Law::spring);
  CHECK(link_value(n, 0) == 0.0);
  CHECK(link_value(n, 1) == 3.0);
  n = link("nlPluck @a @b 2 3");
  CHECK(n.links[0].law == Law::pluck);
  CHECK(link_value(n, 1) == 3.0);
  CHECK(link_value(n, 2) == 0.0);
  CHECK(link_value(link("nlPluck @a @b 2 3 4"), 2) == 4.0);
  CHECK(link("nlBow @a @b 2 3").links[0].law == Law::bow);
  CHECK(link("nlBow @a @b 2 3 0").links[0].law == Law::bow);
  CHECK(link("nlBow @a @b 2 3 1").links[0].law == Law::smooth_bow);
  CHECK(link("nlBow @a @b 2 3 [1]").links[0].law == Law::smooth_bow);
  n = link("contact @a @b 2 3");
  CHECK(n.links[0].law == Law::contact);
  CHECK(link_value(n, 2) == 0.0);
  CHECK(link_value(link("contact @a @b 2 3 4"), 2) == 4.0);
  CHECK(link("detent @a @b 2 3 4") == link("contact @a @b 2 3 4"));
  CHECK(network_of("@o osc 1 2 3 4 5") == network_of("@o cel 1 2 3 4 5"));
  CHECK(network_of("@in1 frcInput @m\n@m mass 1 0 0") ==
        network_of("@in1 forceInput @m\n@m mass 1 0 0"));
}

TEST_CASE("arguments may be numbers, names and expressions", "[mdl]") {
  const auto k = [](const std::string& argument) {
    return link_value(
        network_of("@p param 0.5\n@q2 param 3.\n" + two_masses + "@l spring @a @b " + argument), 0);
  };
  CHECK(k("1.") == 1.0);
  CHECK(k(".1") == 0.1);
  CHECK(k("-0.2") == -0.2);
  CHECK(k("+2") == 2.0);
  CHECK(k("1e-3") == 0.001);
  CHECK(k("1E+2") == 100.0);
  CHECK(k("p") == 0.5);
  CHECK(k("0.1*p") == 0.1 * 0.5);
  CHECK(k("p*q2+1") == 2.5);
  CHECK(k("[p + q2]") == 3.5);
  CHECK(k("'p + q2'") == 3.5);
  CHECK(k("[ ( p + q2 ) * 2 ]") == 7.0);
  CHECK(k("sqrt(q2/12)") == 0.5);
  CHECK(k("p#and a comment") == 0.5);
  // Equal texts share one entry.
  const Network network = network_of(scenes::string("s", 50, "0.1", "0.001"));
  CHECK(network.arguments.size() == 3);
}

TEST_CASE("lines may come in any order and layout", "[mdl]") {
  const Network straight = network_of(
      "@p param 1.\n@a mass p 0. 0.\n@g ground 0.\n@l spring @a @g p\n@out1 posOutput @a\n");
  const std::vector<std::string> same = {
      // CR LF, CR, no final newline
      "@p param 1.\r\n@a mass p 0. 0.\r\n@g ground 0.\r\n@l spring @a @g p\r\n@out1 posOutput @a",
      "@p param 1.\r@a mass p 0. 0.\r@g ground 0.\r@l spring @a @g p\r@out1 posOutput @a\r",
      // blanks, tabs, comments
      "# prose\n\n  \t@p   param\t1. \n   # more\n@a mass p 0. 0. # its mass\n@g ground 0.\n"
      "@l spring @a @g p#none\n@out1 posOutput @a",
      // forward references: of outputs and parameters
      "@out1 posOutput @a\n@l spring @a @g p\n@a mass p 0. 0.\n@g ground 0.\n@p param 1.",
  };
  for (const std::string& text : same) {
    INFO(text);
    const Network network = network_of(text);
    CHECK(network == straight);
  }
  // Lines are counted in the same way for errors.
  check_error({"#\r\n\r\n@m mass 0 0 0\r\n", 3, 9, "a mass must be above 0, found '0'"});
  check_error({"#\r\r@m mass 0 0 0\r", 3, 9, "a mass must be above 0, found '0'"});
  check_error({"@s chain 9 0.0-2 1 1 0", 1, 12, "a mass must be above 0, found '0.0-2'"});
  check_error({"\n\n\t@m\tmass\t0\t0\t0", 3, 10, "a mass must be above 0, found '0'"});
}

TEST_CASE("every error has a line, a column and the expected text", "[mdl]") {
  const std::string p = "@m_K param 1\n";
  const std::vector<Complaint> complaints = {
      {"", 1, 1, "the model is empty: expected elements such as '@m mass 1. 0. 0.'"},
      {"# only a comment\n", 1, 1,
       "the model is empty: expected elements such as '@m mass 1. 0. 0.'"},
      {"@p param 1\n", 1, 1, "the model has no masses, so it makes no sound"},
      {"  @", 1, 3, "expected a label right after '@'"},
      {"@m", 1, 3, "the line ends where a keyword was expected, such as 'mass' or 'springDamper'"},
      {"@m mas 1. 0. 0.", 1, 4, "unknown keyword 'mas'; did you mean 'mass'?"},
      {"@m  sprnigDamper @a @b 1", 1, 5,
       "unknown keyword 'sprnigDamper'; did you mean 'springDamper'?"},
      {"@m xyzzyplugh 1", 1, 4, "unknown keyword 'xyzzyplugh'"},
      {"@m mass 0. 0. 0.", 1, 9, "a mass must be above 0, found '0.'"},
      {"@m mass -1 0. 0.", 1, 9, "a mass must be above 0, found '-1'"},
      {"@m mass 1. zero 0.", 1, 12,
       "found 'zero' where a number was expected (a state at the start cannot be a parameter)"},
      {"@m mass 1. 0. 1..2", 1, 15, "found '1..2' where a number was expected"},
      {"@m mass 1. [1 2] 0", 1, 12, "a position is one number or three, [x y z]; found 2"},
      {"@m mass 1. [1 2 x] 0", 1, 17, "found 'x' where a number was expected"},
      {"@k audioParam @out2", 1, 15,
       "'audioParam' needs the label '@inN' with N from 1 to 64, found '@out2'"},
      {"~begin", 1, 1, "expected '~begin NAME' or '~end NAME'"},
      {"~end x", 1, 6, "no block 'x' is open here"},
      {"@m mass 1. nan 0.", 1, 12,
       "found 'nan' where a number was expected (a state at the start cannot be a parameter)"},
      {"@m mass 1. 0. -inf", 1, 15, "found '-inf' where a number was expected"},
      {"@m mass 1. 0. 1e999", 1, 15, "found '1e999' where a number was expected"},
      {"@m mass inf 0. 0.", 1, 9, "'inf' is not a parameter of this model"},
      {"@m mass 1x 0. 0.", 1, 10, "found 'x' where an operator or the end was expected"},
      {"@m mass 2*(1 0. 0.", 1, 13, "expected ')'"},
      {"@m mass [2*(1 ] 0. 0.", 1, 15, "expected ')'"},
      {p + "@m mass m_k 0. 0.", 2, 9,
       "'m_k' is not a parameter of this model; did you mean 'm_K'?"},
      {p + "@m mass 2*m_k 0. 0.", 2, 11, "'m_k' is not a parameter of this model"},
      {p + "@m mass sqr(m_K) 0. 0.", 2, 9,
       "unknown function 'sqr'; known functions: sqrt abs sin cos exp pow min max clamp"},
      {"@p param x\n@m mass p 0 0", 1, 10,
       "found 'x' where the parameter's value, a number, was expected"},
      {"@p param nan\n@m mass p 0 0", 1, 10,
       "found 'nan' where the parameter's value, a number, was expected"},
      {"@a-b param 1\n@m mass 1 0 0", 1, 1,
       "a parameter's name may have only letters, digits and '_'"},
      {"@m mass 1 0 0\n\n@m mass 1 0 0", 3, 1, "'@m' is already declared in line 1"},
      {"@m mass 1 0 0\n@m param 1", 2, 1, "'@m' is already declared in line 1"},
      {two_masses + "@in1 frcInput @a\n@in1 frcInput @b", 4, 1,
       "'@in1' is already declared in line 3"},
      {"@first mass 1 0 0\n@l spring @first @frist 1", 2, 18,
       "no mass is called '@frist'; did you mean '@first'?"},
      {"@first mass 1 0 0\n@out1 posOutput @nothing", 2, 17, "no mass is called '@nothing'"},
      {"@first mass 1 0 0\n@in1 frcInput first", 2, 15,
       "found 'first' where '@' and the label of a mass were expected"},
      {p + "@m mass m_K 0 0\n@out1 posOutput @m_K", 3, 17,
       "'@m_K' is not a mass, so nothing can be attached to it"},
      {"@m mass 1e999 0. 0.", 1, 9, "the number is too large or too small"},
      {two_masses + "@l nlBow @a @b 1 1 smooth", 3, 20,
       "'smooth' is not a parameter of this model"},
      {two_masses + "@K param 1\n@l spring @a @b K * 2", 4, 21,
       "'spring' takes 3 to 4 arguments (@A @B K [Z]), found 5; an expression with blanks needs "
       "brackets, [K * 2]"},
      {two_masses + "@l springDamper @a @b 1 + 2", 3, 27,
       "'springDamper' takes 3 to 4 arguments (@A @B K [Z]), found 5; an expression with blanks "
       "needs brackets, [K * 2]"},
      {two_masses + "@in0 frcInput @a", 3, 1,
       "'frcInput' needs the label '@inN' with N from 1 to 64, found '@in0'"},
      {two_masses + "@in65 frcInput @a", 3, 1,
       "'frcInput' needs the label '@inN' with N from 1 to 64, found '@in65'"},
      {"@input posInput 0", 1, 1,
       "'posInput' needs the label '@inN' with N from 1 to 64, found '@input'"},
      {two_masses + "@out posOutput @a", 3, 1,
       "'posOutput' needs the label '@outN' with N from 1 to 64, found '@out'"},
      {two_masses + "@out1x posOutput @a", 3, 1,
       "'posOutput' needs the label '@outN' with N from 1 to 64, found '@out1x'"},
      {two_masses + "@in1 posOutput @a", 3, 1,
       "'posOutput' needs the label '@outN' with N from 1 to 64, found '@in1'"},
      {two_masses + "@in99999999999 frcInput @a", 3, 1,
       "'frcInput' needs the label '@inN' with N from 1 to 64, found '@in99999999999'"},
      {std::string("@m mass 1 0 0\n@n m\0ss", 20), 2, 5,
       "found a zero byte: this is a binary file, not a model"},
      {std::string(1, '\0'), 1, 1, "found a zero byte: this is a binary file, not a model"},
      {std::string(max_model_bytes + 1, '\n'), 1, 1,
       "the model is longer than the limit of 32 MiB"},
  };
  for (const Complaint& complaint : complaints) {
    check_error(complaint);
  }
}

TEST_CASE("reading stops after a hundred errors", "[mdl]") {
  // Each kind of text is the worst case for another part of the reader. A quadratic algorithm would
  // exceed the time limit.
  std::string unknown_words;
  std::string unknown_masses;
  std::string duplicates;
  for (int i = 0; i < 200000; ++i) {
    const std::string number = std::to_string(i);
    unknown_words += "@x" + number + " sprungDemper @a @b 1\n";
    unknown_masses +=
        "@m" + number + " mass 1 0 0\n@l" + number + " spring @n" + number + " @z 1\n";
    duplicates += "@m mass 1 0 0\n";
  }
  for (const std::string& text : {unknown_words, unknown_masses, duplicates}) {
    const ParsedNetwork parsed = parse_network(text);
    CHECK_FALSE(parsed.ok());
    CHECK(parsed.diagnostics.size() >= 100);
    CHECK(parsed.diagnostics.size() <= 101);
  }
  const ParsedNetwork parsed = parse_network(unknown_masses);
  CHECK(parsed.diagnostics.back().message == "too many errors; stopping here");
}

TEST_CASE("random text does not crash the reader", "[mdl]") {
  support::Random random(3);
  const std::string letters = "@@@@  \t\n\n\r#[]'+-*/().,0129eabmassosc_\x80\xff~";
  for (int i = 0; i < 3000; ++i) {
    std::string text = scenes::iplay_the_triangle();
    for (std::size_t k = random.below(30); k-- > 0;) {
      const std::size_t place = random.below(text.size());
      switch (random.below(3)) {
        case 0:
          text[place] = letters[random.below(letters.size())];
          break;
        case 1:
          text.insert(place, 1, letters[random.below(letters.size())]);
          break;
        default:
          text.erase(place, 1 + random.below(5));
          break;
      }
    }
    const ParsedNetwork parsed = parse_network(text);
    INFO(text);
    for (const Diagnostic& diagnostic : parsed.diagnostics) {
      REQUIRE(diagnostic.line >= 1);
      REQUIRE(diagnostic.column >= 1);
      REQUIRE(!diagnostic.message.empty());
    }
    if (parsed.ok()) {
      for (const Link& link : parsed.network.links) {
        REQUIRE(link.a < parsed.network.masses.size());
        REQUIRE(link.b < parsed.network.masses.size());
      }
    }
  }
}

TEST_CASE("huge texts are rejected with an error", "[mdl]") {
  const std::string big(1'000'000, '(');
  const std::string rest = " 0. 0.";
  check_error({"@a mass " + big + "1" + rest, 1, 42, "the parentheses are nested too deeply"});
  check_error({"@a mass " + std::string(1'000'000, '1') + rest, 1, 9,
               "the number is too large or too small"});
  check_error({"@a mass 1e999999" + rest, 1, 9, "the number is too large or too small"});
  check_error({"@K param 1e999999\n@a mass 1" + rest, 1, 10,
               "found '1e999999' where the parameter's value, a number, was expected"});
  check_error({"@a mass 1 1e999999 0.", 1, 11, "found '1e999999' where a number was expected"});
  check_error({"@" + std::string(1'000'000, 'm') + " mass 1" + rest, 1, 1,
               "'" + std::string(40, 'm') +
                   "...' is not a label: it is longer than 1000 bytes or has characters that "
                   "cannot be printed"});
  check_error({"@a\x1b[2J mass 1" + rest, 1, 1,
               "'a?' is not a label: it is longer than 1000 bytes or has characters that cannot be "
               "printed"});
  check_error({"@a mass " + std::string(1'000'000, 'x') + rest, 1, 9,
               "'" + std::string(40, 'x') + "...' is not a parameter of this model"});
  // A single CR ends a line, also at the end of invalid text.
  check_error({std::string("@a mass 1 0 0\r@b mass 1 0 0\r\n@c\0", 32), 3, 3,
               "found a zero byte: this is a binary file, not a model"});
}

TEST_CASE("messages show valid UTF-8 unchanged, and '?' otherwise", "[mdl]") {
  CHECK(ressort::quoted("caf\u00e9 \u266a") == "'caf\u00e9 \u266a'");
  CHECK(ressort::quoted("\xe9\x1b\x80\xc2\x85\xe2\x82") == "'" + std::string(7, '?') + "'");
  CHECK(ressort::quoted(std::string(50, 'a')) == "'" + std::string(40, 'a') + "...'");
  std::string accents;
  for (int i = 0; i < 41; ++i) {
    accents += "\u00e9";
  }
  CHECK(ressort::quoted(accents) == "'" + accents.substr(0, 80) + "...'");
  check_error({"@a mass K\u00e9 0. 0.", 1, 9, "'K' is not a parameter of this model"});
  check_error(
      {"@a mass 1\u00e9 0. 0.", 1, 10, "found '\u00e9' where an operator or the end was expected"});
  check_error({"@mmm\u00e9 mass 1 0 0\n@l spring @mmm @mmm\u00e9 1\n", 2, 11,
               "no mass is called '@mmm'; did you mean '@mmm\u00e9'?"});
}

TEST_CASE("labels of any length survive copying the network", "[mdl]") {
  for (const std::size_t length : {1u, 14u, 15u, 16u, 17u, 127u, 300u}) {
    const std::string label(length, 'm');
    const std::string text = "@" + label + " mass 1. 0. 0.\n@g ground 0.\n@" + label +
                             "s spring @" + label + " @g 0.1\n@out1 posOutput @" + label + "\n";
    ParsedNetwork parsed = parse_network(text);
    REQUIRE(parsed.ok());
    Network copy = parsed.network;
    parsed = parse_network(text);  // the first network is gone
    CHECK(copy == parsed.network);
    CHECK(copy.masses[0].name == label);
    CHECK(copy.links[0].name == label + "s");
    copy.masses[0].name = copy.links[0].name;
    CHECK(copy.masses[0].name == label + "s");
    CHECK_FALSE(copy == parsed.network);
  }
}

}  // namespace ressort::mdl_test
