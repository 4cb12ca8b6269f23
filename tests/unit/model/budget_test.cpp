// Budgets as text.
#include "core/model/preset/budget.h"
#include "core/model/preset/preset.h"
#include "tests/support/catch.h"
#include "tests/support/rooms.h"

namespace ressort::budget_test {

TEST_CASE("a printed budget reads back unchanged", "[budget]") {
  const auto budget = parse_budget("  silence=-60 cents=3  t60=2.5 passive=always ");
  REQUIRE(budget);
  CHECK(budget->cents == 3.0);
  CHECK(budget->t60_percent == 2.5);
  CHECK(budget->silence_db == -60.0);
  CHECK(budget->passive == Passivity::always);
  CHECK(budget->is_physical());
  CHECK(print_budget(*budget) == "cents=3 t60=2.5 silence=-60");
  CHECK(*parse_budget(print_budget(*budget)) == *budget);
  CHECK(*parse_budget("") == Budget{});
  CHECK(print_budget({}) == "");
  CHECK_FALSE(Budget{}.is_physical());
}

TEST_CASE("errors in a budget have a column", "[budget]") {
  struct Case {
    const char* text;
    int column;
    const char* message;
  };
  for (const Case& c :
       {Case{"cents=3 loudness=2", 9,
             "expected cents=, t60=, silence= or passive=, found 'loudness=2'"},
        Case{"cents=x", 1, "'cents' must be above 0, up to 1200, found 'x'"},
        Case{"cents", 1, "'cents' must be above 0, up to 1200, found ''"},
        Case{"t60=0", 1, "'t60' must be above 0, up to 100 (%), found '0'"},
        Case{"t60=nan", 1, "'t60' must be above 0, up to 100 (%), found 'nan'"},
        Case{"silence=-10", 1, "'silence' must be -200 to -20 (dB), found '-10'"},
        Case{"passive=yes", 1, "'passive' must be auto, always or never, found 'yes'"},
        Case{"t60=1 t60=2", 7, "'t60=' is given twice"}}) {
    const auto budget = parse_budget(c.text);
    REQUIRE_FALSE(budget);
    CHECK(budget.error().message == c.message);
    CHECK(budget.error().column == c.column);
  }
  const auto preset = parse_preset("model = \"x.mdl\"\nbudget = \"cents=-1\"\n");
  REQUIRE(preset.errors.size() == 1);
  CHECK(preset.errors[0].line == 2);
  CHECK(preset.errors[0].message == "'budget': 'cents' must be above 0, up to 1200, found '-1'");
}

}  // namespace ressort::budget_test
