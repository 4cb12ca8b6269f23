// core/model: translates Synth-A-Modeler's .mdl files to our own language.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/model/language/mdl.h"

namespace ressort::model {

// Source of a line of the translation, counted from 1.
struct Origin {
  int line = 0;
  int column = 0;
  int length = 1;
};

struct Translation {
  std::string text;             // complete only without errors
  std::vector<Origin> origins;  // [line of text - 1]
  std::vector<Diagnostic> diagnostics;
};

// Returns true if the first statement is one of Synth-A-Modeler's elements, `faustcode:` or
// `audioout,`.
bool is_synth_a_modeler(std::string_view text);

// Translates a text. SI units become units per sample at 44 100 Hz; FAUST code is reported as an
// error. Throws only what `progress` throws; the memory is bounded. [any thread but audio]
Translation translate_synth_a_modeler(std::string_view text, const Progress& progress);

}  // namespace ressort::model
