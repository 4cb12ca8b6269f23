#include "core/model/expression.h"

#include <charconv>
#include <cmath>

namespace ressort {
namespace {

struct Function {
  std::string_view name;
  Op op;
  int arguments;
};

constexpr Function functions[] = {
    {"sqrt", Op::sqrt, 1},   {"abs", Op::abs, 1},     {"sin", Op::sin, 1},
    {"cos", Op::cos, 1},     {"exp", Op::exp, 1},     {"pow", Op::power, 2},
    {"min", Op::minimum, 2}, {"max", Op::maximum, 2}, {"clamp", Op::clamp, 3},
};

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}
bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}

// The number that `text` starts with, infinite where it is out of a double's range; `length` is 0
// where it starts with none.
double leading_number(std::string_view text, std::size_t& length) {
  double number = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  length = error != std::errc::invalid_argument && (is_digit(text[0]) || text[0] == '.')
               ? static_cast<std::size_t>(end - text.data())
               : 0;
  return error == std::errc{} ? number : HUGE_VAL;
}

// Recursive descent; every rule writes its steps and tracks how deep the stack would be.
class Parser {
 public:
  Parser(std::string_view text, std::span<const std::string> parameters)
      : text_(text), parameters_(parameters) {}

  Result<Formula> run() {
    sum();
    skip_blanks();
    if (!failed_ && at_ < text_.size()) {
      fail("found '" + std::string(1, text_[at_]) + "' where an operator or the end was expected");
    }
    if (failed_) {
      return error_;
    }
    return std::move(formula_);
  }

 private:
  void sum() {
    product();
    while (!failed_) {
      if (accept('+')) {
        product();
        push_operator(Op::add);
      } else if (accept('-')) {
        product();
        push_operator(Op::subtract);
      } else {
        return;
      }
    }
  }

  void product() {
    factor();
    while (!failed_) {
      if (accept('*')) {
        factor();
        push_operator(Op::multiply);
      } else if (accept('/')) {
        factor();
        push_operator(Op::divide);
      } else {
        return;
      }
    }
  }

  void factor() {
    bool negative = false;
    while (true) {
      if (accept('-')) {
        negative = !negative;
      } else if (!accept('+')) {
        break;
      }
    }
    primary();
    if (negative && !failed_) {
      // A negated number stays one number, so that "-0.2" prints back as it was read.
      if (formula_.back().op == Op::number) {
        formula_.back().value = -formula_.back().value;
      } else {
        push({Op::negate, 0, 0.0}, 0);
      }
    }
  }

  void primary() {
    skip_blanks();
    if (failed_) {
      return;
    }
    if (at_ >= text_.size()) {
      return fail("the expression ends where a number, a name or '(' was expected");
    }
    const char c = text_[at_];
    std::size_t length = 0;
    const double number = leading_number(text_.substr(at_), length);
    if (length > 0) {
      if (!std::isfinite(number)) {
        return fail("the number is too large or too small");
      }
      at_ += length;
      return push({Op::number, 0, number}, 1);
    }
    if (c == '(') {
      return parenthesis();
    }
    if (is_letter(c)) {
      return name();
    }
    fail("found '" + std::string(1, c) + "' where a number, a name or '(' was expected");
  }

  void parenthesis() {
    ++at_;
    if (++nesting_ > static_cast<int>(max_formula_depth)) {
      return fail("the parentheses are nested too deeply");
    }
    sum();
    --nesting_;
    if (!failed_ && !accept(')')) {
      fail("expected ')'");
    }
  }

  void name() {
    const std::size_t start = at_;
    while (at_ < text_.size() && (is_letter(text_[at_]) || is_digit(text_[at_]))) {
      ++at_;
    }
    const std::string_view word = text_.substr(start, at_ - start);
    if (accept('(')) {
      return call(word, start);
    }
    for (std::size_t i = 0; i < parameters_.size(); ++i) {
      if (parameters_[i] == word) {
        return push({Op::parameter, static_cast<std::uint32_t>(i), 0.0}, 1);
      }
    }
    at_ = start;
    fail("'" + std::string(word) + "' is no parameter of this model");
  }

  void call(std::string_view word, std::size_t start) {
    for (const Function& function : functions) {
      if (function.name != word) {
        continue;
      }
      if (++nesting_ > static_cast<int>(max_formula_depth)) {
        return fail("the functions are nested too deeply");
      }
      for (int i = 0; i < function.arguments && !failed_; ++i) {
        if (i > 0 && !accept(',')) {
          return fail("expected ',': " + std::string(word) + " takes " +
                      std::to_string(function.arguments) + " arguments");
        }
        sum();
      }
      --nesting_;
      if (!failed_ && !accept(')')) {
        return fail("expected ')' after the arguments of " + std::string(word));
      }
      return push({function.op, 0, 0.0}, 1 - function.arguments);
    }
    at_ = start;
    fail("unknown function '" + std::string(word) +
         "'; there are sqrt abs sin cos exp pow min max clamp");
  }

  void push_operator(Op op) { push({op, 0, 0.0}, -1); }

  void push(Step step, int growth) {
    if (failed_) {
      return;
    }
    depth_ += growth;
    if (depth_ > static_cast<int>(max_formula_depth) || formula_.size() >= max_formula_steps) {
      return fail("the expression is too long");
    }
    formula_.push_back(step);
  }

  bool accept(char c) {
    skip_blanks();
    if (failed_ || at_ >= text_.size() || text_[at_] != c) {
      return false;
    }
    ++at_;
    return true;
  }

  void skip_blanks() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t')) {
      ++at_;
    }
  }

  void fail(std::string message) {
    if (!failed_) {
      failed_ = true;
      error_ = {std::move(message), 0, static_cast<int>(at_) + 1};
    }
  }

  std::string_view text_;
  std::span<const std::string> parameters_;
  std::size_t at_ = 0;
  int depth_ = 0;
  int nesting_ = 0;
  bool failed_ = false;
  Error error_;
  Formula formula_;
};

}  // namespace

bool parse_number(std::string_view text, double& number) {
  const bool negative = !text.empty() && text[0] == '-';
  if (!text.empty() && (text[0] == '-' || text[0] == '+')) {
    text.remove_prefix(1);
  }
  if (text.empty()) {
    return false;
  }
  std::size_t length = 0;
  const double magnitude = leading_number(text, length);
  if (length != text.size() || !std::isfinite(magnitude)) {
    return false;
  }
  number = negative ? -magnitude : magnitude;
  return true;
}

std::string print_number(double number) {
  char text[32];
  const auto [end, error] = std::to_chars(text, text + sizeof text, number);
  return error == std::errc{} ? std::string(text, end) : std::string("0");
}

Result<Formula> parse_expression(std::string_view text, std::span<const std::string> parameters) {
  return Parser(text, parameters).run();
}

}  // namespace ressort
