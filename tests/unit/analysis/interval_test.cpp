// Bounds of formulas over a box of parameters, compared with their values at many points.
#include <algorithm>
#include <string>
#include <vector>

#include "core/analysis/interval.h"
#include "core/model/language/expression.h"
#include "tests/support/catch.h"

namespace ressort::interval_test {
namespace {

using analysis::formula_range;
using analysis::ParameterBox;
using analysis::Range;

const std::vector<std::string> names = {"p", "q"};
const ParameterBox box{{0.25, 1.0}, {3.0, 2.0}};

Formula formula_of(const std::string& text) {
  auto formula = model::parse_expression(text, names);
  REQUIRE(formula);
  return *formula;
}

// Returns the lowest and the highest value on a grid that includes the corners.
Range values_of(const Formula& formula) {
  constexpr int steps = 60;
  Range range{1e300, -1e300};
  for (int i = 0; i <= steps; ++i) {
    for (int k = 0; k <= steps; ++k) {
      const auto at = [&](std::size_t parameter, int step) {
        return box.lowest[parameter] +
               (box.highest[parameter] - box.lowest[parameter]) * step / steps;
      };
      const double value = evaluate(formula, std::vector<double>{at(0, i), at(1, k)});
      range = {std::min(range.lowest, value), std::max(range.highest, value)};
    }
  }
  return range;
}

}  // namespace

TEST_CASE("the bounds of a monotone formula are its values at the corners", "[interval]") {
  for (const char* const text :
       {"q/p+3/p+0.5", "p+p*p*q", "sqrt(p+q)*p*q", "5-p-p*q", "pow(p,2)+pow(q/2,2)*p",
        "max(p,p*q)+min(2,p)", "exp(0-p)-p", "1/(p+1)-p*q", "(q/p)*(q/p)"}) {
    const Formula formula = formula_of(text);
    const Range bounds = formula_range(formula, box);
    const Range values = values_of(formula);
    INFO(text);
    CHECK(bounds.lowest == Approx(values.lowest).epsilon(1e-12));
    CHECK(bounds.highest == Approx(values.highest).epsilon(1e-12));
  }
}

// All of these turn within the box, so their values at the corners are no bounds.
TEST_CASE("the bounds of a formula that turns contain it", "[interval]") {
  for (const char* const text :
       {"p*(3-p)", "p/(1+p*p)", "p*exp(0-p)", "p*exp(-p)", "p+1/p", "abs(p-1)+0*p", "(p-1)*(p-2)",
        "sin(p)*p*q", "(0-p)*(p-2)", "min(p,2-p)", "pow(p,0-1)+p", "pow(2,p)*(4-p)*(4-p)"}) {
    const Formula formula = formula_of(text);
    const Range bounds = formula_range(formula, box);
    const Range values = values_of(formula);
    const double swing = values.highest - values.lowest;
    INFO(text);
    CHECK(bounds.lowest <= values.lowest);
    CHECK(bounds.highest >= values.highest);
    // Each of the 64 pieces is too wide by no more than the formula moves within it.
    CHECK(bounds.lowest >= values.lowest - 0.5 * swing);
    CHECK(bounds.highest <= values.highest + 0.5 * swing);
  }
}

}  // namespace ressort::interval_test
