// core/model: how much may be lost for speed, and what must not be.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "core/result.h"
#include "core/rooms.h"

namespace ressort::model {

// Whether links that could gain energy from the published scheme are computed by one that cannot.
enum class Passivity {
  always,  // all that no theorem covers as published, which is all that are not linear
  never,   // as published, whatever comes of it
};

// Without any figure the published scheme, sample by sample, for all that is linear. A figure asks
// for the continuous network instead, no nearer than that.
struct Budget {
  static constexpr double unlimited = std::numeric_limits<double>::infinity();

  double cents = unlimited;        // that any partial may be off the continuous network's pitch
  double t60_percent = unlimited;  // that any decay may be off the continuous network's
  double silence_db = -unlimited;  // what is below this may be left out, against the peak of the
                                   // unreduced output over its whole life; 0 dB: everything may
  Passivity passive = Passivity::always;

  bool is_physical() const { return cents < unlimited || t60_percent < unlimited; }
  bool operator==(const Budget&) const = default;
};

// "cents=3 t60=5 silence=-60 passive=always", in any order; each at most once. An error's column
// is that in the text. [any thread but audio]
Result<Budget> parse_budget(std::string_view text);

// The same, back; "" for none.
std::string print_budget(const Budget& budget);

}  // namespace ressort::model
