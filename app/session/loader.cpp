#include "app/session/loader.h"

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "app/control/registry.h"
#include "core/analysis/modes/morph_decay.h"
#include "core/model/language/tokens.h"
#include "core/model/morph.h"
#include "core/model/preset/fit.h"
#include "core/model/tuning/scala.h"
#include "core/ranges.h"

namespace ressort::session {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t longest_source = 160;  // characters of a printed line

// The lines of a text, read in ascending order in one pass.
class Lines {
 public:
  explicit Lines(std::string_view text) : text_(text), rest_(text) {}

  // Returns line `number`, from 1.
  std::string at(int number) {
    if (number < line_) {
      *this = Lines(text_);
    }
    for (; line_ < number && !rest_.empty(); ++line_) {
      const std::size_t end = std::min(rest_.find_first_of("\r\n"), rest_.size());
      const bool pair = end + 1 < rest_.size() && rest_[end] == '\r' && rest_[end + 1] == '\n';
      rest_.remove_prefix(std::min(rest_.size(), end + (pair ? 2 : 1)));
    }
    return std::string(rest_.substr(0, std::min(rest_.find_first_of("\r\n"), longest_source)));
  }

 private:
  std::string_view text_;
  std::string_view rest_;
  int line_ = 1;
};

// Returns the number of line ends in a text, counted like Lines does.
int lines_of(std::string_view text) {
  int lines = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool pair = text[i] == '\r' && i + 1 < text.size() && text[i + 1] == '\n';
    lines += text[i] == '\n' || (text[i] == '\r' && !pair) ? 1 : 0;
  }
  return lines;
}

// Returns the file that a line of the joined text comes from.
ModelText text_at(const std::vector<ModelText>& texts, int line) {
  ModelText found;
  for (const ModelText& text : texts) {
    if (text.first_line <= line || found.path.empty()) {
      found = text;
    }
  }
  return found;
}

// The files of a scene, on the disk or given by their paths. Records every access.
class SceneFiles {
 public:
  explicit SceneFiles(const std::vector<SceneFile>* given) : given_(given) {}

  Result<std::string> find(const std::string& name, Reach reach) const {
    return given_ != nullptr ? Result<std::string>(name) : find_scene(name, reach);
  }
  bool is_there(const std::string& path) {
    std::error_code error;
    const bool is_there =
        given_ != nullptr ? find_given(path) != nullptr : fs::is_regular_file(path, error);
    if (!is_there) {
      seen_.push_back({path, "", false});
    }
    return is_there;
  }
  Result<std::string> read(const std::string& path, std::size_t max_bytes) {
    if (given_ != nullptr) {
      const SceneFile* const file = find_given(path);
      return file != nullptr ? Result<std::string>(file->text)
                             : Error{"the text of '" + path + "' is missing"};
    }
    auto text = read_text(path, max_bytes);
    seen_.push_back({path, text ? *text : "", static_cast<bool>(text)});
    return text;
  }
  void add(const std::vector<SceneFile>& more) {
    seen_.insert(seen_.end(), more.begin(), more.end());
  }
  std::vector<SceneFile> take() { return std::move(seen_); }

 private:
  const SceneFile* find_given(const std::string& path) const {
    const auto found = std::ranges::find(*given_, path, &SceneFile::path);
    return found != given_->end() ? &*found : nullptr;
  }

  const std::vector<SceneFile>* given_;
  std::vector<SceneFile> seen_;
};

// See read_tuning().
TuningReading tuning_of(const std::string& scale_path, const std::string& map_path,
                        SceneFiles& files) {
  TuningReading out;
  const auto read = [&](const std::string& path, auto parse, auto& target) {
    if (path.empty()) {
      return true;
    }
    const auto text = files.read(path, max_tuning_bytes);
    if (!text) {
      out.failure = finding_of("", "", text.error());
      return false;
    }
    auto parsed = parse(*text);
    if (!parsed) {
      out.failure = finding_of(path, *text, parsed.error());
      return false;
    }
    target = *std::move(parsed);
    return true;
  };
  Scale scale;
  for (int step = 1; step <= 12; ++step) {
    scale.cents.push_back(100.0 * step);
  }
  std::optional<KeyboardMap> map;
  if (read(scale_path, parse_scale, scale) && read(map_path, parse_keyboard_map, map)) {
    auto keys = key_frequencies(scale, map ? *map : usual_map(scale));
    if (keys) {
      out.keys_hz = *std::move(keys);
    } else {
      out.failure = finding_of("", "", Error{map_path + ": " + keys.error().message});
    }
  }
  return out;
}

// The result of one stage of reading. Without a value, a finding is an error.
template <class T>
struct Stage {
  std::optional<T> value;
  std::vector<Finding> findings;
};

template <class T>
Stage<T> failed(Finding finding) {
  return {std::nullopt, {std::move(finding)}};
}

// A preset's file.
struct PresetFile {
  std::string path;
  std::string text;
  Preset preset;
  bool is_valid = true;

  Finding error(const std::string& message, SourceLocation at) const {
    return finding_of(path, text, {message, at.line, at.column});
  }
};

// Reads one scene. Each stage returns a value that later stages do not change.
class SceneReader {
 public:
  explicit SceneReader(const SceneOptions& options) : options_(options), files_(options.files) {}

  Reading read(const std::string& name) {
    Reading out;
    // The path of a morph's stop was already checked.
    const auto path = files_.find(name, options_.is_stop ? Reach::any_file : options_.reach);
    if (path) {
      Stage<Scene> scene = path->ends_with(".toml") ? read_with_preset(*path) : read_alone(*path);
      out.findings = std::move(scene.findings);
      out.scene = std::move(scene.value);
    } else {
      out.findings.push_back(finding_of("", "", path.error()));
    }
    out.files = files_.take();
    return out;
  }

 private:
  Stage<Scene> read_alone(const std::string& path) {
    Stage<Scene> scene = read_model({path}, path, {.third = options_.third}, true);
    const Preset preset = scene.value ? scene.value->preset : Preset();
    return complete(path, std::move(scene), preset);
  }

  Stage<Scene> read_with_preset(const std::string& path) {
    const Stage<PresetFile> preset = read_preset(path);
    Stage<Scene> scene;
    if (preset.value && !preset.value->preset.model.empty()) {
      scene = read_scene_of(*preset.value);
    }
    scene.findings.insert(scene.findings.begin(), preset.findings.begin(), preset.findings.end());
    return complete(path, std::move(scene), preset.value ? preset.value->preset : Preset());
  }

  // Adds the tuning and the warnings.
  Stage<Scene> complete(const std::string& path, Stage<Scene> scene, const Preset& preset) {
    Stage<std::vector<double>> keys = read_keys(path, preset);
    std::move(keys.findings.begin(), keys.findings.end(), std::back_inserter(scene.findings));
    if (!keys.value) {
      scene.value.reset();
    }
    if (scene.value) {
      Preset& tuned = scene.value->preset;
      tuned.keys_hz = *std::move(keys.value);
      tuned.a4_hz = options_.keys.a4_hz.value_or(tuned.a4_hz);
      tuned.transpose += options_.keys.transpose;
      tuned.channels = options_.keys.channels.value_or(tuned.channels);
      for (const Finding& finding : scene.findings) {
        if (finding.diagnostic.severity == Severity::warning) {
          scene.value->warnings.push_back(to_string(finding));
        }
      }
    }
    return scene;
  }

  Stage<PresetFile> read_preset(const std::string& path) {
    const auto text = files_.read(path, max_preset_bytes);
    if (!text) {
      return failed<PresetFile>(finding_of("", "", text.error()));
    }
    ParsedPreset read = parse_preset(*text, control::is_reserved);
    Stage<PresetFile> file{PresetFile{path, *text, std::move(read.preset), read.errors.empty()},
                           {}};
    for (const Error& error : read.errors) {
      file.findings.push_back(finding_of(path, *text, error));
    }
    return file;
  }

  // The model, the morph, and the preset's fit to them.
  Stage<Scene> read_scene_of(const PresetFile& file) {
    const auto paths = find_models(file);
    if (!paths) {
      return failed<Scene>(file.error(paths.error().message, file.preset.model_location));
    }
    Stage<Scene> scene = read_model(*paths, file.path, read_options(file), false);
    if (!scene.value) {
      return scene;
    }
    scene.value->preset = file.preset;
    scene.value->preset_text = file.text;
    scene.value->has_preset = true;
    if (!file.preset.morph.empty()) {
      Stage<Scene> morph = read_morph(file, *scene.value);
      std::move(morph.findings.begin(), morph.findings.end(), std::back_inserter(scene.findings));
      scene.value = std::move(morph.value);
      if (!scene.value) {
        return scene;
      }
    }
    if (!file.preset.through.empty()) {
      Stage<std::vector<BodyModel>> bodies = read_bodies(file);
      std::move(bodies.findings.begin(), bodies.findings.end(), std::back_inserter(scene.findings));
      if (!bodies.value) {
        scene.value.reset();
        return scene;
      }
      scene.value->preset.bodies = *std::move(bodies.value);
    }
    scene.value->network =
        with_preset_parameters(std::move(scene.value->network), scene.value->preset);
    const std::vector<Error> unfit = find_preset_errors(scene.value->network, scene.value->preset);
    for (const Error& error : unfit) {
      scene.findings.push_back(finding_of(file.path, file.text, error));
    }
    if (file.preset.controls.empty() && !scene.value->network.inputs.empty()) {
      scene.findings.push_back(
          file.error("there is no [[control]], so neither keys nor sound play this model",
                     file.preset.model_location));
      scene.findings.back().diagnostic.severity = Severity::warning;
    }
    if (!file.is_valid || !unfit.empty()) {
      scene.value.reset();
    }
    return scene;
  }

  Result<std::vector<std::string>> find_models(const PresetFile& file) {
    std::vector<std::string> names = file.preset.with;
    names.insert(names.begin(), file.preset.model);
    std::vector<std::string> paths;
    for (const std::string& name : names) {
      auto model = find_model(file, name);
      if (!model) {
        return model.error();
      }
      paths.push_back(*std::move(model));
    }
    return paths;
  }

  Result<std::string> find_model(const PresetFile& file, const std::string& name) {
    if (auto model = find_beside(file.path, "models", name)) {
      return *std::move(model);
    }
    return Error{options_.reach == Reach::own_folders
                     ? "its model is outside the program's folders, so OSC cannot load it"
                     : "the model '" + name + "' is neither beside the preset nor in '" +
                           models_folder() + "'"};
  }

  // Reads the models of the preset's `through`.
  Stage<std::vector<BodyModel>> read_bodies(const PresetFile& file) {
    Stage<std::vector<BodyModel>> bodies{std::vector<BodyModel>(), {}};
    for (const std::string& name : file.preset.through) {
      const auto path = find_model(file, name);
      if (!path) {
        bodies.findings.push_back(file.error(path.error().message, file.preset.through_location));
        bodies.value.reset();
        continue;
      }
      Stage<Scene> body = read_model({*path}, *path, read_options(file), false);
      std::move(body.findings.begin(), body.findings.end(), std::back_inserter(bodies.findings));
      if (!body.value) {
        bodies.value.reset();
      } else if (bodies.value) {
        bodies.value->push_back({*path, std::move(body.value->network)});
      }
    }
    return bodies;
  }

  // Returns how a preset reads its models.
  ReadOptions read_options(const PresetFile& file) const {
    return options_.third ? ReadOptions{.third = options_.third}
                          : ReadOptions{.third = file.preset.third, .third_by = "the preset says"};
  }

  // Joins the model's files and parses them. A model alone gets a generated preset.
  Stage<Scene> read_model(const std::vector<std::string>& paths, const std::string& scene_path,
                          ReadOptions options, bool is_alone) {
    std::string text;
    std::vector<ModelText> texts;
    for (const std::string& path : paths) {
      const auto more = files_.read(path, max_model_bytes);
      if (!more) {
        return failed<Scene>(finding_of("", "", more.error()));
      }
      if (!text.empty() && !text.ends_with('\n')) {
        text += '\n';
      }
      texts.push_back({path, 1 + lines_of(text)});
      text += *more;
    }
    options.most_nodes = options_.most_nodes;
    options.progress = options_.progress;
    ParsedNetwork parsed = parse_network(text, options);
    Preset preset;
    if (parsed.ok() && is_alone) {
      preset = default_preset(parsed.network, options_.bare);
      if (const auto idle = idle_keys(parsed.network, preset); idle && !options_.bare) {
        parsed.diagnostics.push_back(
            {Severity::warning, idle->line, idle->column, 1, idle->message});
      }
    }
    Stage<Scene> scene;
    Lines lines(text);
    for (Diagnostic& diagnostic : parsed.diagnostics) {
      const std::string source = lines.at(diagnostic.line);
      const ModelText file = text_at(texts, diagnostic.line);
      diagnostic.line -= file.first_line - 1;
      scene.findings.push_back({file.path, diagnostic, source});
    }
    if (parsed.ok()) {
      scene.value = Scene{.name = fs::path(scene_path).stem().string(),
                          .path = scene_path,
                          .model_path = paths.front(),
                          .texts = std::move(texts),
                          .network = std::move(parsed.network),
                          .preset = std::move(preset),
                          .third = parsed.third,
                          .motion = std::move(parsed.motion)};
    }
    return scene;
  }

  // Replaces the model's network by the preset's morph, and adds a parameter for its position.
  Stage<Scene> read_morph(const PresetFile& file, const Scene& model) {
    const Preset& preset = file.preset;
    const SourceLocation first = preset.morph.front().location;
    if (options_.is_stop) {
      return failed<Scene>(
          finding_of(file.path, file.text, {"a morph cannot contain another morph"}));
    }
    std::vector<Scene> others(preset.morph.size());
    std::vector<MorphStop> stops;
    for (std::size_t i = 0; i < preset.morph.size(); ++i) {
      const MorphSetting& setting = preset.morph[i];
      const bool is_preset = !setting.preset.empty();
      if (is_preset) {
        auto other = read_stop(file.path, setting.preset);
        if (!other) {
          return failed<Scene>(file.error(other.error().message, setting.location));
        }
        others[i] = *std::move(other);
      }
      const Network& network = is_preset ? others[i].network : model.network;
      MorphStop stop{.name = is_preset ? setting.preset : "stop " + std::to_string(i + 1),
                     .network = &network,
                     .values = parameter_values(network),
                     .gain = is_preset ? others[i].preset.gain : setting.gain};
      for (const ParameterSetting& value :
           is_preset ? others[i].preset.parameters : setting.values) {
        const int index = find_parameter(network, value.name);
        if (index < 0) {
          return failed<Scene>(file.error(no_parameter(network, value.name), value.location));
        }
        stop.values[static_cast<std::size_t>(index)] = value.value;
      }
      stops.push_back(std::move(stop));
    }
    const auto knobs = mapped(preset.parameters, &ParameterSetting::name);
    auto network = morphed(model.network, stops, preset.morph_parameter, knobs);
    if (!network) {
      return failed<Scene>(network.error().line == 0 ? file.error(network.error().message, first)
                                                     : finding_in_model(model, network.error()));
    }
    std::vector<double> values = parameter_values(*network);
    for (const ParameterSetting& knob : preset.parameters) {
      if (const int index = find_parameter(*network, knob.name); index >= 0) {
        values[static_cast<std::size_t>(index)] = knob.value;
      }
    }
    const int position = find_parameter(*network, preset.morph_parameter);
    Scene scene = model;
    try {
      scene.network =
          with_even_decay(*std::move(network), {.parameter = static_cast<std::size_t>(position),
                                                .stops = stops.size(),
                                                .values = values,
                                                .progress = options_.progress});
    } catch (const Stopped&) {
      return failed<Scene>(finding_of("", "", Error{stopped}));
    }
    if (std::ranges::find(knobs, preset.morph_parameter) == knobs.end()) {
      scene.preset.parameters.push_back({.name = preset.morph_parameter,
                                         .value = 1.0,
                                         .minimum = 1.0,
                                         .maximum = static_cast<double>(stops.size())});
    }
    return {std::move(scene), {}};
  }

  // Reads a preset that is a stop of the morph.
  Result<Scene> read_stop(const std::string& preset_path, const std::string& name) {
    const auto path = find_beside(preset_path, "presets", name + ".toml");
    if (!path) {
      return Error{"the preset " + model::quoted(name) +
                   " is neither beside this one nor in the program's folders"};
    }
    if (*path == preset_path) {
      return Error{"a morph cannot contain its own preset"};
    }
    SceneOptions options = options_;
    options.is_stop = true;
    options.bare = false;
    Reading reading = read_scene(*path, options);
    files_.add(reading.files);
    return scene_of(std::move(reading));
  }

  // Reads the tuning of the options, else the preset's. Empty without a scale and a keyboard map.
  Stage<std::vector<double>> read_keys(const std::string& scene_path, const Preset& preset) {
    using Keys = std::vector<double>;
    const fs::path folder = fs::path(scene_path).parent_path();
    const auto path_of = [&](const std::string& option, const std::string& name) {
      return !option.empty() || name.empty() ? option : (folder / name).string();
    };
    const std::string scale = path_of(options_.keys.scale, preset.scale);
    const std::string map = path_of(options_.keys.keyboard_map, preset.keyboard_map);
    if (scale.empty() && map.empty()) {
      return {Keys(), {}};
    }
    for (const std::string& path : {scale, map}) {
      if (options_.reach == Reach::own_folders && !path.empty() && !own_file(path)) {
        return failed<Keys>(finding_of(
            "", "", {"its tuning is outside the program's folders, so OSC cannot load it"}));
      }
    }
    TuningReading tuning = tuning_of(scale, map, files_);
    return tuning.failure ? failed<Keys>(*std::move(tuning.failure))
                          : Stage<Keys>{std::move(tuning.keys_hz), {}};
  }

  // Finds a file that a preset names: beside it, in the user's folder or in the program's.
  std::optional<std::string> find_beside(const std::string& preset_path, const std::string& kind,
                                         const std::string& name) {
    const fs::path folder = fs::path(preset_path).parent_path();
    std::vector<fs::path> tried = {folder / name, folder / ".." / kind / name};
    if (const std::string user = user_folder(); !user.empty()) {
      tried.push_back(fs::path(user) / kind / name);
    }
    tried.push_back(fs::path(models_folder()).parent_path() / kind / name);
    for (const fs::path& path : tried) {
      if (options_.reach == Reach::own_folders) {
        if (const auto own = own_file(path.string())) {
          return own;
        }
      } else if (const std::string normal = path.lexically_normal().string();
                 files_.is_there(normal)) {
        return normal;
      }
    }
    return std::nullopt;
  }

  const SceneOptions options_;
  SceneFiles files_;  // records every file that was read or looked for
};

}  // namespace

Finding finding_of(const std::string& file, std::string_view text, const Error& error) {
  Finding finding;
  finding.file = file;
  finding.diagnostic.line = error.line;
  finding.diagnostic.column = error.column;
  finding.diagnostic.message = error.message;
  finding.source = error.line > 0 ? Lines(text).at(error.line) : "";
  return finding;
}

Finding finding_in_file(const std::string& path, const Error& error) {
  const auto text = read_text(path, max_model_bytes);
  return finding_of(path, text ? std::string_view(*text) : "", error);
}

Finding finding_in_model(const Scene& scene, const Error& error) {
  // A scene made in memory has a path and no texts.
  const ModelText file =
      scene.texts.empty() ? ModelText{scene.model_path, 1} : text_at(scene.texts, error.line);
  Error there = error;
  there.line -= error.line > 0 ? file.first_line - 1 : 0;
  return finding_in_file(file.path, there);
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
    const bool continues = (c & 0xc0) == 0x80;  // a UTF-8 character has one mark
    if (i < first + length && !continues) {
      mark += i < first ? (c == '\t' ? '\t' : ' ') : i == first ? '^' : '~';
    }
  }
  if (first >= finding.source.size()) {
    mark += '^';
  }
  return text + "\n    " + shown + "\n    " + mark;
}

// Source text appears only in quotes, or after the ':', ';' or '?' that ends the problem.
std::string without_source(std::string_view message) {
  const auto is_letter = [](std::string_view text, std::size_t at) {
    return at < text.size() && std::isalnum(static_cast<unsigned char>(text[at])) != 0;
  };
  std::string all;
  for (std::string_view rest = message; !rest.empty();) {
    std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(rest.size(), line.size() + 1));
    constexpr std::string_view sign = ": error: ";
    const std::size_t place_end = line.find(sign);
    if (place_end == line.npos) {
      continue;
    }
    const std::string_view place = line.substr(0, place_end);
    line.remove_prefix(place_end + sign.size());
    // The source may contain quotes: remove from the first opening to the last closing quote.
    std::size_t open = line.find('\'');
    while (open != line.npos && is_letter(line, open - 1)) {
      open = line.find('\'', open + 1);
    }
    std::size_t close = line.rfind('\'');
    while (close != line.npos && is_letter(line, close + 1)) {
      close = close == 0 ? line.npos : line.rfind('\'', close - 1);
    }
    std::string message(line);
    if (open != line.npos && close != line.npos && open < close) {
      message.replace(open, close + 1 - open, "'...'");
    }
    message.resize(std::min(message.find_first_of(":;?"), message.size()));
    all += (all.empty() ? "" : "\n") + std::string(place.substr(place.rfind('/') + 1)) +
           std::string(sign) + message;
  }
  return all.empty() ? std::string(message) : all;
}

TuningReading read_tuning(const std::string& scale, const std::string& keyboard_map) {
  SceneFiles files(nullptr);
  return tuning_of(scale, keyboard_map, files);
}

std::string preset_description(const std::string& name) {
  const auto text = read_text(preset_path(name), max_preset_bytes);
  return text ? parse_preset(*text).preset.description : "";
}

Reading read_scene(const std::string& name, const SceneOptions& options) {
  return SceneReader(options).read(name);
}

Result<Scene> load_scene(const std::string& name, const SceneOptions& options) {
  return scene_of(read_scene(name, options));
}

Result<Scene> scene_of(Reading&& reading) {
  if (reading.scene) {
    return *std::move(reading.scene);
  }
  // Warnings too, as one may explain an error.
  return Error{
      joined(reading.findings, "\n", [](const Finding& finding) { return to_string(finding); })};
}

}  // namespace ressort::session
