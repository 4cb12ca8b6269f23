// app/session: compiles what was read, and decides in one place whether it may sound.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/session/loader.h"
#include "core/compile/compile.h"

namespace ressort::session {

// What came of a scene, for whoever plays, renders or checks it.
struct Admission {
  std::optional<Compiled> compiled;  // whatever the findings say; nothing if it cannot be compiled
  std::vector<Finding> findings;     // an error among them: it shall not sound
  bool is_granted() const;
};

// Refuses, with file, line and column, what cannot be compiled, and what is not stable as
// it starts unless the options say to force it. Tells what is narrowed, forced or not proved, and
// what `is_strict` refuses: a bow that is too strong for its steps, and what a budget promises and
// is not kept, but not while a better form is yet to be looked for. [any thread but audio]
Admission ask_to_play(const Scene& scene, const CompileOptions& options, bool is_strict = false);

// The same for who wants to play or nothing: warnings are added to `warnings`, an error's message
// is all errors, one a line.
Result<Compiled> admit(const Scene& scene, const CompileOptions& options,
                       std::vector<std::string>& warnings, bool is_strict = false);

// A warning, where the scene runs away at these parameters, for who looks at it without playing it.
// [any thread but audio]
std::optional<Finding> instability(const Scene& scene, const std::vector<double>& parameters,
                                   double rate_hz, const Progress& progress);

}  // namespace ressort::session
