// core: arithmetic expressions as a list of steps for a small stack machine. The model room
// compiles them (expression.h), and the engine evaluates them. Neither needs to know the other.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace ressort {

enum class Op : std::uint8_t {
  number,     // push `value`
  parameter,  // push the parameter `index`
  negate,
  add,
  subtract,
  multiply,
  divide,
  sqrt,
  abs,
  sin,
  cos,
  exp,
  power,
  minimum,
  maximum,
  clamp,
};

struct Step {
  Op op = Op::number;
  std::uint32_t index = 0;  // operand of Op::parameter
  double value = 0.0;       // operand of Op::number
  bool operator==(const Step&) const = default;
};

using Formula = std::vector<Step>;

// Returns the number of operands that a step pops. It then pushes one result.
constexpr std::size_t operands(Op op) {
  switch (op) {
    case Op::number:
    case Op::parameter:
      return 0;
    case Op::negate:
    case Op::sqrt:
    case Op::abs:
    case Op::sin:
    case Op::cos:
    case Op::exp:
      return 1;
    case Op::add:
    case Op::subtract:
    case Op::multiply:
    case Op::divide:
    case Op::power:
    case Op::minimum:
    case Op::maximum:
      return 2;
    case Op::clamp:
      return 3;
  }
  return 0;
}

// Stack limit of a formula in a model; the parser rejects a deeper one. Combinations of several
// formulas need a little more.
inline constexpr std::size_t max_formula_depth = 32;
inline constexpr std::size_t formula_stack = max_formula_depth + 4;
inline constexpr std::size_t max_formula_steps = 256;

// Returns the formula's value. Wait-free, O(steps). [any thread]
inline double evaluate(std::span<const Step> formula, std::span<const double> parameters) {
  std::array<double, formula_stack> stack{};
  std::size_t top = 0;
  for (const Step& step : formula) {
    switch (step.op) {
      case Op::number:
        stack[top++] = step.value;
        continue;
      case Op::parameter:
        stack[top++] = parameters[step.index];
        continue;
      case Op::negate:
        stack[top - 1] = -stack[top - 1];
        continue;
      case Op::sqrt:
        stack[top - 1] = std::sqrt(stack[top - 1]);
        continue;
      case Op::abs:
        stack[top - 1] = std::fabs(stack[top - 1]);
        continue;
      case Op::sin:
        stack[top - 1] = std::sin(stack[top - 1]);
        continue;
      case Op::cos:
        stack[top - 1] = std::cos(stack[top - 1]);
        continue;
      case Op::exp:
        stack[top - 1] = std::exp(stack[top - 1]);
        continue;
      case Op::clamp:
        top -= 2;
        stack[top - 1] = std::min(std::max(stack[top - 1], stack[top]), stack[top + 1]);
        continue;
      default:
        break;
    }
    const double right = stack[--top];
    double& left = stack[top - 1];
    switch (step.op) {
      case Op::add:
        left += right;
        break;
      case Op::subtract:
        left -= right;
        break;
      case Op::multiply:
        left *= right;
        break;
      case Op::divide:
        left /= right;
        break;
      case Op::power:
        left = right == 2.0 ? left * left : std::pow(left, right);
        break;
      case Op::minimum:
        left = std::min(left, right);
        break;
      default:
        left = std::max(left, right);
        break;
    }
  }
  return top == 0 ? 0.0 : stack[0];
}

// Returns the greatest stack depth.
inline std::size_t stack_depth(std::span<const Step> formula) {
  std::size_t depth = 0;
  std::size_t most = 0;
  for (const Step& step : formula) {
    depth = depth + 1 - operands(step.op);
    most = std::max(most, depth);
  }
  return most;
}

// Returns whether the value does not depend on parameters.
inline bool is_constant(std::span<const Step> formula) {
  return std::none_of(formula.begin(), formula.end(),
                      [](const Step& step) { return step.op == Op::parameter; });
}

// Replaces a constant formula by its value.
inline Formula folded(Formula formula) {
  return is_constant(formula) ? Formula{{Op::number, 0, evaluate(formula, {})}} : formula;
}

}  // namespace ressort
