// app: compiles what was read, and says in full why it shall not sound.
#pragma once

#include <string>
#include <vector>

#include "app/loader.h"
#include "core/compile/compile.h"

namespace ressort {

// Fails, with file, line and column, where compile() does, and where the model is not stable as it
// starts unless the options say to force it. What is narrowed, forced or not proved is added to
// `warnings`. [any thread but audio]
Result<Compiled> admit(const Scene& scene, const CompileOptions& options,
                       std::vector<std::string>& warnings);

// Of the preset's ranges that were narrowed.
std::vector<Finding> narrowed_ranges(const Scene& scene, const Gate& gate);

}  // namespace ressort
