// app/session: tuned models in the user's cache.
#pragma once

#include <string>

#include "app/session/files.h"
#include "core/result.h"

namespace ressort::session {

struct TunedFiles {
  std::string model;
  std::string preset;
};

// Returns paths in a cache folder for this text, and creates the folder.
Result<TunedFiles> tuned_files(const std::string& name, const std::string& model_text);

// Returns true if the model is in that cache.
bool is_tuned(const std::string& model);

// Copies a tuned model to the user's models as NAME.mdl, and returns its path.
Result<std::string> keep_tuned(const std::string& model, const std::string& name,
                               Existing existing);

// Returns a content hash of a text.
std::string digest(const std::string& text);

}  // namespace ressort::session
