// core/model: arithmetic in a model's arguments, `0.1*p`, `sqrt(k/3)`, bound to its parameters.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "core/formula.h"
#include "core/result.h"
#include "core/rooms.h"

namespace ressort::model {

// Numbers are read and written free of the locale.
// "1.", ".1", "-0.2", "1e-3" are numbers; "", "1x", "nan", "inf" are not. [any thread]
bool parse_number(std::string_view text, double& number);

// Digits enough to read back as the same number, and no more; no '+' is among them.
std::string print_number(double number);

// Infix + - * / ( ), unary signs, numbers, parameter names and the functions
// sqrt abs sin cos exp pow min max clamp. The error's column counts from 1 within `text`.
Result<Formula> parse_expression(std::string_view text, std::span<const std::string> parameters);

// Infix without blanks and with the fewest parentheses; parse_expression gives the same steps back.
std::string print_expression(const Formula& formula, std::span<const std::string> parameters);

}  // namespace ressort::model
