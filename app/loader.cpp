#include "app/loader.h"

#include <filesystem>

#include "app/files.h"

namespace ressort {
namespace {

namespace fs = std::filesystem;

std::string at(const std::string& path, const Error& error) {
  return path + ":" + std::to_string(error.line) + ":" + std::to_string(error.column) +
         ": error: " + error.message;
}

Result<Done> read_model(const std::string& path, Scene& scene) {
  auto text = read_text(path, max_model_bytes);
  if (!text) {
    return text.error();
  }
  ParsedNetwork parsed = parse_network(*text);
  std::string all;
  for (const Diagnostic& diagnostic : parsed.diagnostics) {
    const std::string text_of = to_string(diagnostic, path);
    all += (all.empty() ? "" : "\n") + text_of;
    if (diagnostic.severity == Severity::warning) {
      scene.warnings.push_back(text_of);
    }
  }
  if (!parsed.ok()) {
    return Error{std::move(all)};  // a warning may explain an error
  }
  scene.model_path = path;
  scene.network = std::move(parsed.network);
  return Done{};
}

// A preset's model is beside the preset, or among the program's own.
Result<std::string> find_model(const std::string& preset_path, const std::string& model) {
  std::error_code error;
  const fs::path folder = fs::path(preset_path).parent_path();
  for (const fs::path& path :
       {folder / model, folder / ".." / "models" / model, fs::path(models_folder()) / model}) {
    if (fs::is_regular_file(path, error)) {
      return path.lexically_normal().string();
    }
  }
  return Error{
      "the model '" + model + "' is neither beside the preset nor in '" + models_folder() + "'", 1,
      1};
}

}  // namespace

Result<Scene> load_scene(const std::string& name, bool bare) {
  auto path = find_scene(name);
  if (!path) {
    return path.error();
  }
  Scene scene;
  scene.path = *path;
  scene.name = fs::path(*path).stem().string();
  if (!path->ends_with(".toml")) {
    if (auto read = read_model(*path, scene); !read) {
      return read.error();
    }
    scene.preset = default_preset(scene.network, bare);
    return scene;
  }
  auto text = read_text(*path, max_preset_bytes);
  if (!text) {
    return text.error();
  }
  auto preset = parse_preset(*text);
  if (!preset) {
    return Error{at(*path, preset.error())};
  }
  scene.preset = *std::move(preset);
  scene.has_preset = true;
  auto model = find_model(*path, scene.preset.model);
  if (!model) {
    return Error{at(*path, model.error())};
  }
  if (auto read = read_model(*model, scene); !read) {
    return read.error();
  }
  return scene;
}

}  // namespace ressort
