// core/model: error budgets for faster computation.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "core/result.h"
#include "core/rooms.h"

namespace ressort::model {

// Selects the links that are made passive because they could create energy in the published scheme.
enum class Passivity {
  always,  // all that are not linear, which no stability theorem covers as published
  never,   // none
};

// Without any figure, linear parts follow the published scheme sample by sample. With one, they
// follow the continuous network within that error.
struct Budget {
  static constexpr double unlimited = std::numeric_limits<double>::infinity();

  double cents = unlimited;  // largest error of a partial's pitch, against the continuous network
  double t60_percent = unlimited;  // largest error of a decay time
  double silence_db = -unlimited;  // parts below this level may be omitted, relative to the peak of
                                   // the complete output over its whole duration
  Passivity passive = Passivity::always;

  bool is_physical() const { return cents < unlimited || t60_percent < unlimited; }
  bool operator==(const Budget&) const = default;
};

// Parses "cents=3 t60=5 silence=-60 passive=always", in any order, each at most once. The column of
// an error is relative to the text. [any thread but audio]
Result<Budget> parse_budget(std::string_view text);

// Prints a budget; "" for the default.
std::string print_budget(const Budget& budget);

}  // namespace ressort::model
