#include "app/commands/body/body.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "app/exit_code.h"

namespace ressort {

int body_command(const BodyOptions& options) {
  std::string ending = std::filesystem::path(options.input).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  if (ending == ".stl" || ending == ".obj" || ending == ".mdl") {
    std::fprintf(stderr, "'%s': bodies are made of recordings only, not of a %s\n",
                 options.input.c_str(), ending.c_str());
    return exit_code::wrong_use;
  }
  return recording_body(options);
}

}  // namespace ressort
