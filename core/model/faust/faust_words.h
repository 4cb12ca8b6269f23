// core/model: the words of FAUST: numbers, names, sums, formulas, and the laws as definitions. All
// pure text, for faust.cpp.
#pragma once

#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/formula.h"
#include "core/model/network.h"
#include "core/model/preset/preset.h"

namespace ressort::model {

// Turns labels into different FAUST identifiers, to be used after a prefix: so no label is a
// keyword, a primitive or a name of ours.
class FaustNames {
 public:
  std::string add(std::string_view label);

 private:
  std::set<std::string> taken_;
};

// A real number; a negative one in parentheses.
std::string faust_number(double number);

// How tightly a formula's text must hold together where it is put.
enum class Tightness { sum, product, atom };

// The formula with `parameters` as the names of its parameters.
std::string faust_formula(std::span<const Step> formula, std::span<const std::string> parameters,
                          Tightness tightness = Tightness::sum);

// Terms that each start with "+ " or "- "; "0.0" for none.
std::string faust_sum(std::vector<std::string> terms);

// Words with `between`, broken into lines that start with `indent` blanks.
std::string flow(std::span<const std::string> words, std::string_view between, std::size_t indent);

// Fit for a comment and for a string.
std::string plain(std::string_view text);

// The slider; a number where the setting leaves it no range.
std::string faust_slider(const ParameterSetting& setting);

// What a program holds only if it uses it: the laws, how a driven mass moves, what waveguides need.
// Of those that are used by name, and of what they stand on.
std::string faust_laws(const std::set<std::string>& used);

// What every program starts with.
std::string faust_prelude(bool rescale);

}  // namespace ressort::model
