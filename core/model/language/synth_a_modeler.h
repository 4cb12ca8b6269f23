// core/model: Synth-A-Modeler's .mdl text, told in our own language.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/model/language/mdl.h"

namespace ressort::model {

// Where a line of a told text comes from; line and column from 1.
struct Origin {
  int line = 0;
  int column = 0;
  int length = 1;
};

struct ToldText {
  std::string text;             // complete only if there is no error
  std::vector<Origin> origins;  // [line of text - 1]
  std::vector<Diagnostic> diagnostics;
};

// Is the first thing that is no comment one of Synth-A-Modeler's elements, `faustcode:` or
// `audioout,`?
bool is_synth_a_modeler(std::string_view text);

// SI units become units per sample at 44 100 Hz; what is FAUST code is refused by line. Never
// throws but what `progress` does; what it takes in memory is bounded. [any thread but audio]
ToldText tell_synth_a_modeler(std::string_view text, const Progress& progress);

}  // namespace ressort::model
