#include "app/loader.h"

#include <algorithm>
#include <filesystem>

#include "app/files.h"

namespace ressort {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t longest_source = 160;  // of a line that is shown

// Line `number` of a text, from 1.
std::string line_of(std::string_view text, int number) {
  for (int line = 1; line < number && !text.empty(); ++line) {
    const std::size_t end = std::min(text.find_first_of("\r\n"), text.size());
    const bool pair = end + 1 < text.size() && text[end] == '\r' && text[end + 1] == '\n';
    text.remove_prefix(std::min(text.size(), end + (pair ? 2 : 1)));
  }
  return std::string(text.substr(0, std::min(text.find_first_of("\r\n"), longest_source)));
}

class SceneReader {
 public:
  explicit SceneReader(const SceneOptions& options) : options_(options) {}

  Reading read(const std::string& name) {
    auto path = find_scene(name);
    if (!path) {
      fail("", "", path.error());
      return std::move(out_);
    }
    scene_.path = *path;
    scene_.name = fs::path(*path).stem().string();
    if (path->ends_with(".toml") ? read_preset() : read_model(*path, {.third = options_.third})) {
      if (!scene_.has_preset) {
        scene_.preset = default_preset(scene_.network, options_.bare);
      }
      out_.scene = std::move(scene_);
    }
    return std::move(out_);
  }

 private:
  bool fail(const std::string& file, std::string_view text, const Error& error) {
    out_.findings.push_back(finding_of(file, text, error));
    return false;
  }

  bool read_preset() {
    auto text = read_text(scene_.path, max_preset_bytes);
    if (!text) {
      return fail("", "", text.error());
    }
    auto preset = parse_preset(*text);
    if (!preset) {
      return fail(scene_.path, *text, preset.error());
    }
    scene_.preset = *std::move(preset);
    scene_.has_preset = true;
    const auto model = find_model(scene_.preset.model);
    if (!model) {
      return fail(scene_.path, *text,
                  {"the model '" + scene_.preset.model + "' is neither beside the preset nor in '" +
                       models_folder() + "'",
                   1, 1});
    }
    return options_.third
               ? read_model(*model, {.third = options_.third})
               : read_model(*model, {.third = scene_.preset.third, .third_by = "the preset says"});
  }

  bool read_model(const std::string& path, const ReadOptions& options) {
    auto text = read_text(path, max_model_bytes);
    if (!text) {
      return fail("", "", text.error());
    }
    ParsedNetwork parsed = parse_network(*text, options);
    for (const Diagnostic& diagnostic : parsed.diagnostics) {
      out_.findings.push_back({path, diagnostic, line_of(*text, diagnostic.line)});
      if (diagnostic.severity == Severity::warning) {
        scene_.warnings.push_back(to_string(out_.findings.back()));
      }
    }
    scene_.model_path = path;
    scene_.motion = std::move(parsed.motion);
    const bool ok = parsed.ok();
    scene_.network = std::move(parsed.network);
    return ok;
  }

  // A preset's model is beside the preset, or among the program's own.
  std::optional<std::string> find_model(const std::string& model) const {
    std::error_code error;
    const fs::path folder = fs::path(scene_.path).parent_path();
    for (const fs::path& path :
         {folder / model, folder / ".." / "models" / model, fs::path(models_folder()) / model}) {
      if (fs::is_regular_file(path, error)) {
        return path.lexically_normal().string();
      }
    }
    return std::nullopt;
  }

  const SceneOptions options_;
  Scene scene_;
  Reading out_;
};

}  // namespace

Finding finding_of(const std::string& file, std::string_view text, const Error& error) {
  Finding finding;
  finding.file = file;
  finding.diagnostic.line = error.line;
  finding.diagnostic.column = error.column;
  finding.diagnostic.message = error.message;
  finding.source = error.line > 0 ? line_of(text, error.line) : "";
  return finding;
}

std::string to_string(const Finding& finding) {
  return finding.diagnostic.line > 0 ? to_string(finding.diagnostic, finding.file)
                                     : finding.diagnostic.message;
}

std::string with_source(const Finding& finding) {
  std::string text = to_string(finding);
  if (finding.source.empty()) {
    return text;
  }
  std::string shown;
  std::string mark;
  const auto first = static_cast<std::size_t>(std::max(1, finding.diagnostic.column)) - 1;
  const auto length = static_cast<std::size_t>(std::max(1, finding.diagnostic.length));
  for (std::size_t i = 0; i < finding.source.size(); ++i) {
    const auto c = static_cast<unsigned char>(finding.source[i]);
    shown += c == '\t' || (c >= 0x20 && c != 0x7f) ? finding.source[i] : '?';
    const bool continues = (c & 0xc0) == 0x80;  // a letter of several bytes is one place wide
    if (i < first + length && !continues) {
      mark += i < first ? (c == '\t' ? '\t' : ' ') : i == first ? '^' : '~';
    }
  }
  if (first >= finding.source.size()) {
    mark += '^';
  }
  return text + "\n    " + shown + "\n    " + mark;
}

Reading read_scene(const std::string& name, const SceneOptions& options) {
  return SceneReader(options).read(name);
}

Result<Scene> load_scene(const std::string& name, const SceneOptions& options) {
  Reading reading = read_scene(name, options);
  if (reading.scene) {
    return *std::move(reading.scene);
  }
  std::string all;
  for (const Finding& finding : reading.findings) {  // a warning may explain an error
    all += (all.empty() ? "" : "\n") + to_string(finding);
  }
  return Error{std::move(all)};
}

}  // namespace ressort
