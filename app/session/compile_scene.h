// app/session: compiles a scene and decides whether it may be played.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/session/loader.h"
#include "core/compile/compile.h"

namespace ressort::session {

// The result of compiling a scene.
struct CompiledScene {
  std::optional<Compiled> compiled;  // set even if errors reject it; empty if compilation failed
  std::vector<Finding> findings;     // an error among them rejects the scene
  bool is_accepted() const;
};

// Compiles a scene. Reports errors with file, line and column: compilation errors, and instability
// at the start values unless the options force it. Warns about narrowed ranges, forced scenes and
// missing stability proofs. With `is_strict`, two warnings are errors: a bow too strong for the
// step size, and an exceeded budget of pitch or decay, unless a better form may still be found.
// [any thread but audio]
CompiledScene compile_to_play(const Scene& scene, const CompileOptions& options,
                              bool is_strict = false);

// The same, for callers that only need the compiled scene. Appends warnings to `warnings`; the
// error's message has all errors, one a line.
Result<Compiled> compile_scene(const Scene& scene, const CompileOptions& options,
                               std::vector<std::string>& warnings, bool is_strict = false);

// Returns a warning if the scene is unstable at these parameters, for callers that do not play it.
// [any thread but audio]
std::optional<Finding> instability(const Scene& scene, const std::vector<double>& parameters,
                                   double rate_hz, const Progress& progress);

}  // namespace ressort::session
