#include "core/analysis/interval.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <numbers>

namespace ressort::analysis {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr Range everything{-infinity, infinity};
constexpr int curved = 2;  // Stands for any degree above 1.
// Number of pieces that a range is divided into when its parameter occurs more than once.
constexpr int pieces = 64;

bool is_point(Range range) {
  return range.lowest == range.highest;
}

Range hull(std::initializer_list<double> values) {
  Range range{infinity, -infinity};
  for (const double value : values) {
    if (std::isnan(value)) {
      return everything;
    }
    range.lowest = std::min(range.lowest, value);
    range.highest = std::max(range.highest, value);
  }
  return range;
}

// Returns the range of a sine: its ends, and 1 or -1 if a crest or trough lies within.
Range sine(Range x, double (*function)(double), double first_crest) {
  if (!(std::isfinite(x.lowest) && std::isfinite(x.highest))) {
    return {-1.0, 1.0};
  }
  const auto meets = [&](double first) {
    constexpr double turn = 2.0 * std::numbers::pi;
    return first + turn * std::ceil((x.lowest - first) / turn) <= x.highest;
  };
  Range range = hull({function(x.lowest), function(x.highest)});
  if (!is_point(x)) {
    range.highest = meets(first_crest) ? 1.0 : range.highest;
    range.lowest = meets(first_crest + std::numbers::pi) ? -1.0 : range.lowest;
  }
  return range;
}

// x^y is monotone in both for positive x; for other x only integer powers are defined.
Range power(Range x, Range y) {
  const Range corners = hull({std::pow(x.lowest, y.lowest), std::pow(x.lowest, y.highest),
                              std::pow(x.highest, y.lowest), std::pow(x.highest, y.highest)});
  if (x.lowest > 0.0 || (is_point(x) && is_point(y))) {
    return corners;
  }
  if (!is_point(y) || y.lowest < 0.0 || (x.lowest < 0.0 && y.lowest != std::floor(y.lowest))) {
    return everything;
  }
  return y.lowest > 0.0 && x.highest > 0.0 ? hull({corners.lowest, 0.0, corners.highest}) : corners;
}

Range apply(Op op, Range x) {
  switch (op) {
    case Op::negate:
      return {-x.highest, -x.lowest};
    case Op::sqrt:
      return hull({std::sqrt(x.lowest), std::sqrt(x.highest)});
    case Op::abs:
      return x.lowest < 0.0 && x.highest > 0.0 ? Range{0.0, std::max(-x.lowest, x.highest)}
                                               : hull({std::fabs(x.lowest), std::fabs(x.highest)});
    case Op::sin:
      return sine(
          x, [](double a) { return std::sin(a); }, std::numbers::pi / 2.0);
    case Op::cos:
      return sine(
          x, [](double a) { return std::cos(a); }, 0.0);
    default:
      return {std::exp(x.lowest), std::exp(x.highest)};
  }
}

Range apply(Op op, Range x, Range y) {
  switch (op) {
    case Op::add:
      return hull({x.lowest + y.lowest, x.highest + y.highest});
    case Op::subtract:
      return hull({x.lowest - y.highest, x.highest - y.lowest});
    case Op::multiply:
      return hull(
          {x.lowest * y.lowest, x.lowest * y.highest, x.highest * y.lowest, x.highest * y.highest});
    case Op::divide:
      return y.lowest <= 0.0 && y.highest >= 0.0
                 ? everything
                 : hull({x.lowest / y.lowest, x.lowest / y.highest, x.highest / y.lowest,
                         x.highest / y.highest});
    case Op::power:
      return power(x, y);
    case Op::minimum:
      return {std::min(x.lowest, y.lowest), std::min(x.highest, y.highest)};
    default:
      return {std::max(x.lowest, y.lowest), std::max(x.highest, y.highest)};
  }
}

bool is_unary(Op op) {
  return op == Op::negate || op == Op::sqrt || op == Op::abs || op == Op::sin || op == Op::cos ||
         op == Op::exp;
}

// Evaluates the formula on a stack of any type, as evaluate() does on numbers.
template <class Value, class Number, class Parameter, class One, class Two>
Value run(std::span<const Step> formula, Number number, Parameter parameter, One one, Two two) {
  std::array<Value, formula_stack> stack{};
  std::size_t top = 0;
  for (const Step& step : formula) {
    if (step.op == Op::number) {
      stack[top++] = number(step.value);
    } else if (step.op == Op::parameter) {
      stack[top++] = parameter(step.index);
    } else if (is_unary(step.op)) {
      stack[top - 1] = one(step.op, stack[top - 1]);
    } else if (step.op == Op::clamp) {
      top -= 2;
      stack[top - 1] =
          two(Op::minimum, two(Op::maximum, stack[top - 1], stack[top]), stack[top + 1]);
    } else {
      --top;
      stack[top - 1] = two(step.op, stack[top - 1], stack[top]);
    }
  }
  return top == 0 ? number(0.0) : stack[0];
}

Range range_of(std::span<const Step> formula, std::span<const double> lowest,
               std::span<const double> highest) {
  return run<Range>(
      formula,
      [](double value) {
        return Range{value, value};
      },
      [&](std::uint32_t index) {
        return Range{lowest[index], highest[index]};
      },
      [](Op op, Range x) { return apply(op, x); },
      [](Op op, Range x, Range y) { return apply(op, x, y); });
}

// Returns a parameter that occurs more than once, which makes interval arithmetic too wide; -1 for
// none.
int repeated(std::span<const Step> formula, const ParameterBox& box) {
  for (std::size_t i = 0; i < formula.size(); ++i) {
    const std::uint32_t index = formula[i].index;
    if (formula[i].op == Op::parameter && box.lowest[index] < box.highest[index] &&
        std::find(formula.begin() + static_cast<std::ptrdiff_t>(i) + 1, formula.end(),
                  formula[i]) != formula.end()) {
      return static_cast<int>(index);
    }
  }
  return -1;
}

// Direction in which a value moves when one parameter grows.
enum class Trend { none, rising, falling, unknown };

Trend reversed(Trend trend) {
  return trend == Trend::rising ? Trend::falling : trend == Trend::falling ? Trend::rising : trend;
}

// Returns the trend of a value that rises with both of two values.
Trend both(Trend a, Trend b) {
  return a == b || b == Trend::none ? a : a == Trend::none ? b : Trend::unknown;
}

struct Trended {
  Range range;
  Trend trend = Trend::none;
};

Trend trend_of(Op op, const Trended& x) {
  switch (op) {
    case Op::negate:
      return reversed(x.trend);
    case Op::sqrt:
    case Op::exp:
      return x.trend;
    default:
      return x.trend == Trend::none ? Trend::none : Trend::unknown;
  }
}

Trend trend_of(Op op, const Trended& x, const Trended& y) {
  if (x.trend == Trend::none && y.trend == Trend::none) {
    return Trend::none;
  }
  const bool are_positive = x.range.lowest >= 0.0 && y.range.lowest >= 0.0;
  switch (op) {
    case Op::add:
    case Op::minimum:
    case Op::maximum:
      return both(x.trend, y.trend);
    case Op::subtract:
      return both(x.trend, reversed(y.trend));
    case Op::multiply:
      return are_positive ? both(x.trend, y.trend) : Trend::unknown;
    case Op::divide:
      return are_positive && y.range.lowest > 0.0 ? both(x.trend, reversed(y.trend))
                                                  : Trend::unknown;
    case Op::power:
      return are_positive && y.trend == Trend::none ? x.trend : Trend::unknown;
    default:
      return Trend::unknown;
  }
}

// Returns whether the formula only rises or only falls with the parameter, anywhere in the box.
bool is_monotone(std::span<const Step> formula, const ParameterBox& box, std::uint32_t parameter) {
  const Trend trend = run<Trended>(
                          formula,
                          [](double value) {
                            return Trended{{value, value}, Trend::none};
                          },
                          [&](std::uint32_t index) {
                            return Trended{{box.lowest[index], box.highest[index]},
                                           index == parameter ? Trend::rising : Trend::none};
                          },
                          [](Op op, const Trended& x) {
                            return Trended{apply(op, x.range), trend_of(op, x)};
                          },
                          [](Op op, const Trended& x, const Trended& y) {
                            return Trended{apply(op, x.range, y.range), trend_of(op, x, y)};
                          })
                          .trend;
  return trend != Trend::unknown;
}

Range joined(Range a, Range b) {
  return {std::min(a.lowest, b.lowest), std::max(a.highest, b.highest)};
}

}  // namespace

// If the formula is monotone in a parameter that occurs more than once, its values at both ends of
// the range bound all others. Otherwise the range is divided into pieces.
Range formula_range(std::span<const Step> formula, const ParameterBox& box) {
  const int cut = repeated(formula, box);
  if (cut < 0) {
    return range_of(formula, box.lowest, box.highest);
  }
  const auto at = static_cast<std::size_t>(cut);
  if (is_monotone(formula, box, static_cast<std::uint32_t>(cut))) {
    ParameterBox low = box;
    ParameterBox high = box;
    low.highest[at] = box.lowest[at];
    high.lowest[at] = box.highest[at];
    return joined(formula_range(formula, low), formula_range(formula, high));
  }
  std::vector<double> low = box.lowest;
  std::vector<double> high = box.highest;
  const double width = (box.highest[at] - box.lowest[at]) / pieces;
  Range whole{infinity, -infinity};
  for (int i = 0; i < pieces; ++i) {
    low[at] = box.lowest[at] + i * width;
    high[at] = i + 1 == pieces ? box.highest[at] : box.lowest[at] + (i + 1) * width;
    whole = joined(whole, range_of(formula, low, high));
  }
  return whole;
}

bool is_affine(std::span<const Step> formula, std::uint32_t parameter) {
  const int degree = run<int>(
      formula, [](double) { return 0; },
      [&](std::uint32_t index) { return index == parameter ? 1 : 0; },
      [](Op op, int x) { return x == 0 || op == Op::negate ? x : curved; },
      [](Op op, int x, int y) {
        switch (op) {
          case Op::add:
          case Op::subtract:
            return std::max(x, y);
          case Op::multiply:
            return std::min(x + y, curved);
          case Op::divide:
            return y == 0 ? x : curved;
          default:
            return x + y == 0 ? 0 : curved;
        }
      });
  return degree < curved;
}

}  // namespace ressort::analysis
