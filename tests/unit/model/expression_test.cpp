// Arithmetic in arguments: values, precedence, and errors with their columns.
#include "core/model/language/expression.h"

#include <limits>
#include <vector>

#include "tests/support/harness.h"

namespace ressort::expression_test {
namespace {

const std::vector<std::string> names = {"p", "q2", "a_K"};
const std::vector<double> values = {0.5, 3.0, -2.0};

double value(const std::string& text) {
  const auto formula = parse_expression(text, names);
  INFO(text << (formula ? "" : ": " + formula.error().message));
  REQUIRE(formula);
  return evaluate(*formula, values);
}

void check_error(const std::string& text, int column, const std::string& message) {
  const auto formula = parse_expression(text, names);
  INFO(text);
  REQUIRE_FALSE(formula);
  CHECK(formula.error().column == column);
  CHECK(formula.error().message == message);
}

std::string repeated(const std::string& text, int times) {
  std::string all;
  for (int i = 0; i < times; ++i) {
    all += text;
  }
  return all;
}

}  // namespace

TEST_CASE("expressions have the usual values and precedence", "[expression]") {
  CHECK(value("1+2*3") == 7.0);
  CHECK(value("(1+2)*3") == 9.0);
  CHECK(value("8-3-2") == 3.0);
  CHECK(value("8/4/2") == 1.0);
  CHECK(value("8/4*2") == 4.0);
  CHECK(value("2*-3") == -6.0);
  CHECK(value("-2*3") == -6.0);
  CHECK(value("--2") == 2.0);
  CHECK(value("-+-+2") == 2.0);
  CHECK(value("-(p)") == -0.5);
  CHECK(value("-p*q2") == -1.5);
  CHECK(value("4 - -p") == 4.5);
  CHECK(value(" \t1 +\t2 ") == 3.0);
  CHECK(value("1.+.5") == 1.5);
  CHECK(value("1e-3*1E3") == 1.0);
}

TEST_CASE("parameters and functions", "[expression]") {
  CHECK(value("p") == 0.5);
  CHECK(value("q2*a_K") == -6.0);
  CHECK(value("sqrt(q2+1)") == 2.0);
  CHECK(value("abs(a_K)") == 2.0);
  CHECK(value("sin(p)") == std::sin(0.5));
  CHECK(value("cos(p)") == std::cos(0.5));
  CHECK(value("exp(p)") == std::exp(0.5));
  CHECK(value("pow(q2,2)") == 9.0);
  CHECK(value("pow(2, q2)") == 8.0);
  CHECK(value("min(p,q2)") == 0.5);
  CHECK(value("max(p,q2)") == 3.0);
  CHECK(value("clamp(q2, 0, 1)") == 1.0);
  CHECK(value("clamp(a_K, 0, 1)") == 0.0);
  CHECK(value("clamp(p, 0, 1)") == 0.5);
  CHECK(value("max(min(1,2),sqrt( 9 ))+1") == 4.0);
  const auto constant = parse_expression("1+sqrt(4)", names);
  const auto varying = parse_expression("1+p", names);
  REQUIRE(constant);
  REQUIRE(varying);
  CHECK(is_constant(*constant));
  CHECK_FALSE(is_constant(*varying));
}

TEST_CASE("errors in expressions have a column", "[expression]") {
  const std::string expected = "where a number, a name or '(' was expected";
  check_error("", 1, "the expression ends " + expected);
  check_error("1+", 3, "the expression ends " + expected);
  check_error("1+*2", 3, "found '*' " + expected);
  check_error("$", 1, "found '$' " + expected);
  check_error("1 2", 3, "found '2' where an operator or the end was expected");
  check_error("1x", 2, "found 'x' where an operator or the end was expected");
  check_error("1,2", 2, "found ',' where an operator or the end was expected");
  check_error("(1+2", 5, "expected ')'");
  check_error("1)", 2, "found ')' where an operator or the end was expected");
  check_error("2*P", 3, "'P' is not a parameter of this model");
  check_error("nan", 1, "'nan' is not a parameter of this model");
  check_error("inf+1", 1, "'inf' is not a parameter of this model");
  check_error("1+tan(2)", 3,
              "unknown function 'tan'; known functions: sqrt abs sin cos exp pow min max clamp");
  check_error("pow(1)", 6, "expected ',': pow takes 2 arguments");
  check_error("sqrt(1,2)", 7, "expected ')' after the arguments of sqrt");
  check_error("sqrt", 1, "'sqrt' is not a parameter of this model");
  check_error("1e400", 1, "the number is too large or too small");
  check_error("2*1e-400", 3, "the number is too large or too small");
}

TEST_CASE("expressions that are too deep or too long are rejected", "[expression]") {
  CHECK(value(repeated("(", 32) + "1" + repeated(")", 32)) == 1.0);
  check_error(repeated("(", 33) + "1" + repeated(")", 33), 34,
              "the parentheses are nested too deeply");
  CHECK(value(repeated("abs(", 32) + "1" + repeated(")", 32)) == 1.0);
  CHECK_FALSE(parse_expression(repeated("abs(", 33) + "1" + repeated(")", 33), names));
  // 1+(1+(1+ ... puts one more number on the stack at each level.
  CHECK(value(repeated("1+(", 31) + "1" + repeated(")", 31)) == 32.0);
  CHECK_FALSE(parse_expression(repeated("1+(", 32) + "1" + repeated(")", 32), names));
  // An expression has at most 256 steps: 128 numbers with 127 operators fit, 129 with 128 do not.
  CHECK(value("1" + repeated("+1", 127)) == 128.0);
  CHECK_FALSE(parse_expression("1" + repeated("+1", 128), names));
  CHECK_FALSE(parse_expression(repeated("-", 100000), names));
  CHECK(value(repeated("-", 100000) + "2") == 2.0);
  CHECK_FALSE(parse_expression(repeated("(", 1000000), names));
}

TEST_CASE("numbers are read and printed independently of the locale, without loss",
          "[expression]") {
  const std::vector<std::pair<std::string, double>> good = {
      {"1", 1},       {"1.", 1},       {".1", .1}, {"-0.2", -.2},   {"+3", 3},
      {"1e-3", 1e-3}, {"-1E+2", -100}, {"007", 7}, {"1e308", 1e308}};
  for (const auto& [text, expected] : good) {
    double number = -77;
    INFO(text);
    CHECK(parse_number(text, number));
    CHECK(number == expected);
  }
  for (const std::string text :
       {"",      "-",      "+",    ".",   "1x", "x1", "nan", "inf", "-inf", "infinity", "NAN",
        "1e999", "1e-999", "0x10", "1,5", " 1", "1 ", "--1", "+-1", "1e",   "e1",       "1e+"}) {
    double number = -77;
    INFO(text);
    CHECK_FALSE(parse_number(text, number));
    CHECK(number == -77);
  }
  support::Random random(2);
  for (int i = 0; i < 2000; ++i) {
    const double number = random.uniform(-1, 1) * std::pow(10.0, random.uniform(-300, 300));
    double again = 0.0;
    REQUIRE(parse_number(print_number(number), again));
    REQUIRE(again == number);
  }
  CHECK(print_number(0.1) == "0.1");
  CHECK(print_number(44100.0) == "44100");
  CHECK(print_number(0.0005) == "0.0005");
  CHECK(print_number(-1e-20) == "-1e-20");
  CHECK(print_number(1e22) == "1e22");
}

TEST_CASE("random formulas have the expected text and value", "[expression]") {
  // Random trees, printed with all parentheses and evaluated at the same time.
  support::Random random(8);
  struct Tree {
    std::string text;
    double value = 0.0;
  };
  const auto leaf = [&] {
    const double number = std::round(random.uniform(1, 100)) / 8.0;
    return Tree{print_number(number), number};
  };
  for (int i = 0; i < 500; ++i) {
    Tree tree = leaf();
    for (std::size_t k = random.below(20); k-- > 0;) {
      const Tree other = leaf();
      switch (random.below(5)) {
        case 0:
          tree = {"(" + tree.text + "+" + other.text + ")", tree.value + other.value};
          break;
        case 1:
          tree = {"(" + other.text + "-" + tree.text + ")", other.value - tree.value};
          break;
        case 2:
          tree = {tree.text + "*" + other.text, tree.value * other.value};
          break;
        case 3:
          tree = {tree.text + "/" + other.text, tree.value / other.value};
          break;
        default:
          tree = {"-" + tree.text, -tree.value};
          break;
      }
    }
    INFO(tree.text);
    REQUIRE(value(tree.text) == tree.value);
  }
}

}  // namespace ressort::expression_test
