// core/model: arithmetic expressions of a model's parameters, such as `0.1*p` or `sqrt(k/3)`.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "core/formula.h"
#include "core/result.h"
#include "core/rooms.h"

namespace ressort::model {

// Parses a number, independently of the locale: "1.", ".1", "-0.2" and "1e-3" are numbers; "",
// "1x", "nan" and "inf" are not. [any thread]
bool parse_number(std::string_view text, double& number);

// Prints the shortest text that reads back as the same number, without a '+'.
std::string print_number(double number);

// Parses infix + - * / ( ), unary signs, numbers, parameter names and the functions sqrt abs sin
// cos exp pow min max clamp. The column of an error counts from 1 within `text`.
Result<Formula> parse_expression(std::string_view text, std::span<const std::string> parameters);

// Prints infix text without blanks and with the fewest parentheses; parse_expression returns the
// same steps.
std::string print_expression(const Formula& formula, std::span<const std::string> parameters);

}  // namespace ressort::model
