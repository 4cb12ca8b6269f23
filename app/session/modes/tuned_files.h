// app/session: where tuned models are until somebody saves them.
#pragma once

#include <string>

#include "app/session/files.h"
#include "core/result.h"

namespace ressort::session {

struct TunedFiles {
  std::string model;
  std::string preset;
};

// In a folder of the user's cache that no other text has, which is made: of this name.
Result<TunedFiles> tuned_files(const std::string& name, const std::string& model_text);

// Whether a model is one of these.
bool is_tuned(const std::string& model);

// Copies it among the user's own models, where it is NAME.mdl; its path.
Result<std::string> keep_tuned(const std::string& model, const std::string& name,
                               Existing existing);

// Digits that tell one text from another.
std::string digest(const std::string& text);

}  // namespace ressort::session
