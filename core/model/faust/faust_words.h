// core/model: prints names, numbers, sums, formulas and definitions in FAUST, for faust.cpp.
#pragma once

#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/formula.h"
#include "core/laws/law.h"
#include "core/model/network.h"
#include "core/model/preset/preset.h"

namespace ressort::model {

// Converts labels to unique FAUST identifiers. A prefix before each of them avoids clashes with
// keywords, primitives and our own names.
class FaustNames {
 public:
  std::string add(std::string_view label);

 private:
  std::set<std::string> taken_;
};

// Prints a real number; a negative one in parentheses.
std::string faust_number(double number);

// The lowest precedence that the surrounding text accepts without parentheses.
enum class Tightness { sum, product, atom };

// Prints a formula; `parameters` are the names of its parameters.
std::string faust_formula(std::span<const Step> formula, std::span<const std::string> parameters,
                          Tightness tightness = Tightness::sum);

// Converts the text of a coefficient to the sample rate of the program.
std::string faust_scaled(const std::string& value, Unit unit);

// Prints a sum of terms that each start with "+ " or "- "; "0.0" for none.
std::string faust_sum(std::vector<std::string> terms);

// Joins words with `between`, and breaks lines, which start with `indent` blanks.
std::string flow(std::span<const std::string> words, std::string_view between, std::size_t indent);

// Replaces the characters that a comment or a string must not contain.
std::string plain(std::string_view text);

// Prints a slider, or a number if the setting has no range.
std::string faust_slider(const ParameterSetting& setting);

// Returns the definitions of these names, and of all names that they use: laws, driven masses,
// waveguides.
std::string faust_laws(const std::set<std::string>& used, std::span<const LawFacts> laws);

// Returns the definitions that every program starts with.
std::string faust_prelude(bool rescale);

}  // namespace ressort::model
