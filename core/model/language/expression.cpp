#include "core/model/language/expression.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/model/language/tokens.h"

namespace ressort::model {
namespace {

struct Function {
  std::string_view name;
  Op op;
};

constexpr Function functions[] = {
    {"sqrt", Op::sqrt},   {"abs", Op::abs},     {"sin", Op::sin},
    {"cos", Op::cos},     {"exp", Op::exp},     {"pow", Op::power},
    {"min", Op::minimum}, {"max", Op::maximum}, {"clamp", Op::clamp},
};

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}
bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}

// Returns the number that `text` starts with, or infinity if it is out of a double's range. Sets
// `length` to 0 if the text does not start with a number.
double leading_number(std::string_view text, std::size_t& length) {
  double number = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  length = error != std::errc::invalid_argument && (is_digit(text[0]) || text[0] == '.')
               ? static_cast<std::size_t>(end - text.data())
               : 0;
  return error == std::errc{} ? number : HUGE_VAL;
}

// A recursive-descent parser that writes postfix steps and tracks the depth of their stack.
class Parser {
 public:
  Parser(std::string_view text, std::span<const std::string> parameters)
      : text_(text), parameters_(parameters) {}

  Result<Formula> run() {
    sum();
    skip_blanks();
    if (!failed_ && at_ < text_.size()) {
      fail("found " + letter() + " where an operator or the end was expected");
    }
    if (failed_) {
      return error_;
    }
    return std::move(formula_);
  }

 private:
  void sum() { joined('+', Op::add, '-', Op::subtract, &Parser::product); }
  void product() { joined('*', Op::multiply, '/', Op::divide, &Parser::factor); }

  // Parses operands with one of two operators between them, from left to right.
  void joined(char one, Op first, char other, Op second, void (Parser::*operand)()) {
    (this->*operand)();
    while (!failed_) {
      const bool is_first = accept(one);
      if (!is_first && !accept(other)) {
        return;
      }
      (this->*operand)();
      push({is_first ? first : second, 0, 0.0}, -1);
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
      // A negated number becomes one number, so that "-0.2" is printed as it was read.
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
    fail("found " + letter() + " where a number, a name or '(' was expected");
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
    fail(quoted(word) + " is not a parameter of this model");
  }

  void call(std::string_view word, std::size_t start) {
    for (const Function& function : functions) {
      if (function.name != word) {
        continue;
      }
      if (++nesting_ > static_cast<int>(max_formula_depth)) {
        return fail("the functions are nested too deeply");
      }
      const auto arguments = static_cast<int>(operands(function.op));
      for (int i = 0; i < arguments && !failed_; ++i) {
        if (i > 0 && !accept(',')) {
          return fail("expected ',': " + std::string(word) + " takes " + std::to_string(arguments) +
                      " arguments");
        }
        sum();
      }
      --nesting_;
      if (!failed_ && !accept(')')) {
        return fail("expected ')' after the arguments of " + std::string(word));
      }
      return push({function.op, 0, 0.0}, 1 - arguments);
    }
    at_ = start;
    fail("unknown function " + quoted(word) +
         "; known functions: sqrt abs sin cos exp pow min max clamp");
  }

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

  // Returns the character at the current position, quoted.
  std::string letter() const {
    std::size_t length = 0;
    return quoted(first_letter(text_.substr(at_), length));
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

// Precedence of the outermost operator of a text, lowest first.
enum class Binding { sum, product, sign, primary };

struct Piece {
  std::string text;
  Binding binding = Binding::primary;
};

std::string held(const Piece& piece, Binding least) {
  return piece.binding < least ? "(" + piece.text + ")" : piece.text;
}

Piece infix(const Piece& left, char sign, const Piece& right, Binding binding) {
  // Operators associate to the left, so only the right operand needs parentheses at equal
  // precedence.
  const auto tighter = static_cast<Binding>(static_cast<int>(binding) + 1);
  return {held(left, binding) + sign + held(right, tighter), binding};
}

const Function* function_of(Op op) {
  const auto* const found = std::ranges::find(functions, op, &Function::op);
  return found == std::end(functions) ? nullptr : found;
}

Piece piece(const Step& step, std::span<const Piece> of, std::span<const std::string> parameters) {
  switch (step.op) {
    case Op::number:
      return {print_number(step.value),
              std::signbit(step.value) ? Binding::sign : Binding::primary};
    case Op::parameter:
      return {parameters[step.index], Binding::primary};
    case Op::negate:
      return {"-" + held(of[0], Binding::primary), Binding::sign};
    case Op::add:
      return infix(of[0], '+', of[1], Binding::sum);
    case Op::subtract:
      return infix(of[0], '-', of[1], Binding::sum);
    case Op::multiply:
      return infix(of[0], '*', of[1], Binding::product);
    case Op::divide:
      return infix(of[0], '/', of[1], Binding::product);
    default:
      break;
  }
  std::string text(function_of(step.op)->name);
  for (std::size_t i = 0; i < of.size(); ++i) {
    text += (i == 0 ? "(" : ",") + of[i].text;
  }
  return {text + ")", Binding::primary};
}

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
  // Chooses between the two shortest forms: 0.0005 reads better than 5e-04, and 1e-20 than its
  // zeros.
  const double size = std::fabs(number);
  const bool is_usual = number == 0.0 || (size >= 1e-7 && size < 1e15);
  char text[32];
  const auto [end, error] =
      std::to_chars(text, text + sizeof text, number,
                    is_usual ? std::chars_format::fixed : std::chars_format::scientific);
  std::string printed = error == std::errc{} ? std::string(text, end) : std::string("0");
  std::erase(printed, '+');  // MIMS4Max splits arguments at a '+', and an exponent needs none
  return printed;
}

std::string print_expression(const Formula& formula, std::span<const std::string> parameters) {
  std::vector<Piece> stack;
  for (const Step& step : formula) {
    const std::size_t first = stack.size() - operands(step.op);
    Piece made = piece(step, std::span(stack).subspan(first), parameters);
    stack.resize(first);
    stack.push_back(std::move(made));
  }
  return stack.empty() ? "0" : stack.front().text;
}

Result<Formula> parse_expression(std::string_view text, std::span<const std::string> parameters) {
  return Parser(text, parameters).run();
}

}  // namespace ressort::model
