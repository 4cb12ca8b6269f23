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

namespace ressort::session {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t longest_source = 160;  // of a line that is shown

// Goes through a text once, for lines whose numbers never fall.
class Lines {
 public:
  explicit Lines(std::string_view text) : rest_(text) {}

  // Line `number`, from 1.
  std::string at(int number) {
    for (; line_ < number && !rest_.empty(); ++line_) {
      const std::size_t end = std::min(rest_.find_first_of("\r\n"), rest_.size());
      const bool pair = end + 1 < rest_.size() && rest_[end] == '\r' && rest_[end + 1] == '\n';
      rest_.remove_prefix(std::min(rest_.size(), end + (pair ? 2 : 1)));
    }
    return std::string(rest_.substr(0, std::min(rest_.find_first_of("\r\n"), longest_source)));
  }

 private:
  std::string_view rest_;
  int line_ = 1;
};

// How many lines end in a text, as Lines counts them.
int lines_of(std::string_view text) {
  int lines = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool pair = text[i] == '\r' && i + 1 < text.size() && text[i + 1] == '\n';
    lines += text[i] == '\n' || (text[i] == '\r' && !pair) ? 1 : 0;
  }
  return lines;
}

// Which file a line of the model's whole text comes from.
ModelText text_at(const Scene& scene, int line) {
  ModelText found{scene.model_path, 1};
  for (const ModelText& text : scene.texts) {
    if (text.first_line <= line) {
      found = text;
    }
  }
  return found;
}

// The texts that a scene is read from: those on the disk, or others by the same paths.
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
    const auto found = std::find_if(given_->begin(), given_->end(),
                                    [&](const SceneFile& file) { return file.path == path; });
    return found != given_->end() ? &*found : nullptr;
  }

  const std::vector<SceneFile>* given_;
  std::vector<SceneFile> seen_;
};

// As read_tuning() says.
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
  KeyboardMap map;
  if (read(scale_path, parse_scale, scale) && read(map_path, parse_keyboard_map, map)) {
    auto keys = key_frequencies(scale, map);
    if (keys) {
      out.keys_hz = *std::move(keys);
    } else {
      out.failure = finding_of("", "", Error{map_path + ": " + keys.error().message});
    }
  }
  return out;
}

class SceneReader {
 public:
  explicit SceneReader(const SceneOptions& options) : options_(options), files_(options.files) {}

  Reading read(const std::string& name) {
    read_all(name);
    out_.files = files_.take();
    return std::move(out_);
  }

 private:
  void read_all(const std::string& name) {
    // Where a stop of a morph is has been found within reach already.
    auto path = files_.find(name, options_.is_stop ? Reach::any_file : options_.reach);
    if (!path) {
      fail("", "", path.error());
      return;
    }
    scene_.path = *path;
    scene_.name = fs::path(*path).stem().string();
    const bool is_read =
        path->ends_with(".toml")
            ? read_preset()
            : read_model({*path}, {.third = options_.third, .progress = options_.progress});
    if (tune() && is_read) {
      out_.scene = std::move(scene_);
    }
  }

  bool fail(const std::string& file, std::string_view text, const Error& error) {
    out_.findings.push_back(finding_of(file, text, error));
    return false;
  }

  void warn(Finding finding) {
    finding.diagnostic.severity = Severity::warning;
    scene_.warnings.push_back(to_string(finding));
    out_.findings.push_back(std::move(finding));
  }

  bool read_preset() {
    auto text = files_.read(scene_.path, max_preset_bytes);
    if (!text) {
      return fail("", "", text.error());
    }
    ParsedPreset read = parse_preset(*text, control::is_reserved);
    for (const Error& error : read.errors) {
      fail(scene_.path, *text, error);
    }
    scene_.preset = std::move(read.preset);
    scene_.preset_text = *text;
    scene_.has_preset = true;
    if (scene_.preset.model.empty()) {
      return false;
    }
    std::vector<std::string> names = scene_.preset.with;
    names.insert(names.begin(), scene_.preset.model);
    std::vector<std::string> paths;
    for (const std::string& name : names) {
      const auto model = find_beside("models", name);
      if (!model) {
        const std::string missing =
            options_.reach == Reach::own_folders
                ? "its model is none of the program's own, and OSC loads no others"
                : "the model '" + name + "' is neither beside the preset nor in '" +
                      models_folder() + "'";
        return fail(
            scene_.path, *text,
            {missing, scene_.preset.model_location.line, scene_.preset.model_location.column});
      }
      paths.push_back(*model);
    }
    const bool is_read =
        options_.third ? read_model(paths, {.third = options_.third, .progress = options_.progress})
                       : read_model(paths, {.third = scene_.preset.third,
                                            .third_by = "the preset says",
                                            .progress = options_.progress});
    if (!is_read || !morph(*text)) {
      return false;
    }
    const std::vector<Error> unfit = find_preset_errors(scene_.network, scene_.preset);
    for (const Error& error : unfit) {
      fail(scene_.path, *text, error);
    }
    if (scene_.preset.controls.empty() && !scene_.network.inputs.empty()) {
      const SourceLocation at = scene_.preset.model_location;
      warn(finding_of(scene_.path, *text,
                      {"no [[control]] follows, so neither keys nor sound play this model", at.line,
                       at.column}));
    }
    return read.errors.empty() && unfit.empty();
  }

  // The network that the preset's morph makes of its model, and a knob for it.
  bool morph(const std::string& text) {
    Preset& preset = scene_.preset;
    if (preset.morph.empty()) {
      return true;
    }
    if (options_.is_stop) {
      return fail(scene_.path, text, {"a morph cannot go through another morph"});
    }
    std::vector<Scene> others(preset.morph.size());
    std::vector<MorphStop> stops;
    for (std::size_t i = 0; i < preset.morph.size(); ++i) {
      const MorphSetting& setting = preset.morph[i];
      const auto refuse = [&](SourceLocation at, const std::string& message) {
        return fail(scene_.path, text, {message, at.line, at.column});
      };
      if (!setting.preset.empty()) {
        auto other = read_other(setting.preset);
        if (!other) {
          return refuse(setting.location, other.error().message);
        }
        others[i] = *std::move(other);
      }
      const bool is_preset = !setting.preset.empty();
      const Network& network = is_preset ? others[i].network : scene_.network;
      MorphStop stop{.name = is_preset ? setting.preset : "stop " + std::to_string(i + 1),
                     .network = &network,
                     .values = parameter_values(network),
                     .gain = is_preset ? others[i].preset.gain : setting.gain};
      for (const ParameterSetting& value :
           is_preset ? others[i].preset.parameters : setting.values) {
        const int index = find_parameter(network, value.name);
        if (index < 0) {
          return refuse(value.location, no_parameter(network, value.name));
        }
        stop.values[static_cast<std::size_t>(index)] = value.value;
      }
      stops.push_back(std::move(stop));
    }
    std::vector<std::string> knobs;
    for (const ParameterSetting& knob : preset.parameters) {
      knobs.push_back(knob.name);
    }
    auto network = morphed(scene_.network, stops, preset.morph_parameter, knobs);
    if (!network && network.error().line == 0) {
      const SourceLocation at = preset.morph.front().location;
      return fail(scene_.path, text, {network.error().message, at.line, at.column});
    }
    if (!network) {
      out_.findings.push_back(finding_in_model(scene_, network.error()));
      return false;
    }
    std::vector<double> values = parameter_values(*network);
    for (const ParameterSetting& knob : preset.parameters) {
      if (const int index = find_parameter(*network, knob.name); index >= 0) {
        values[static_cast<std::size_t>(index)] = knob.value;
      }
    }
    const int position = find_parameter(*network, preset.morph_parameter);
    try {
      scene_.network =
          with_even_decay(*std::move(network), {.parameter = static_cast<std::size_t>(position),
                                                .stops = stops.size(),
                                                .pitch_mode = preset.pitch_mode,
                                                .values = values,
                                                .progress = options_.progress});
    } catch (const Stopped&) {
      return fail("", "", Error{stopped});
    }
    if (std::find(knobs.begin(), knobs.end(), preset.morph_parameter) == knobs.end()) {
      preset.parameters.push_back({.name = preset.morph_parameter,
                                   .value = 1.0,
                                   .minimum = 1.0,
                                   .maximum = static_cast<double>(stops.size())});
    }
    return true;
  }

  Result<Scene> read_other(const std::string& name) {
    const auto path = find_beside("presets", name + ".toml");
    if (!path) {
      return Error{"the preset " + model::quoted(name) +
                   " is neither beside this one nor among the "
                   "program's own"};
    }
    if (*path == scene_.path) {
      return Error{"a morph cannot go through itself"};
    }
    SceneOptions options = options_;
    options.is_stop = true;
    options.bare = false;
    Reading reading = read_scene(*path, options);
    files_.add(reading.files);
    return scene_of(std::move(reading));
  }

  // The keys: as the options say, else as the preset does.
  bool tune() {
    Preset& preset = scene_.preset;
    const fs::path folder = fs::path(scene_.path).parent_path();
    const auto path_of = [&](const std::string& said, const std::string& name) {
      return !said.empty() || name.empty() ? said : (folder / name).string();
    };
    const std::string scale = path_of(options_.keys.scale, preset.scale);
    const std::string map = path_of(options_.keys.keyboard_map, preset.keyboard_map);
    preset.a4_hz = options_.keys.a4_hz.value_or(preset.a4_hz);
    preset.channels = options_.keys.channels.value_or(preset.channels);
    if (scale.empty() && map.empty()) {
      return true;
    }
    for (const std::string& path : {scale, map}) {
      if (options_.reach == Reach::own_folders && !path.empty() && !own_file(path)) {
        return fail("", "",
                    Error{"its tuning is none of the program's own, and OSC loads no others"});
      }
    }
    TuningReading tuning = tuning_of(scale, map, files_);
    if (tuning.failure) {
      out_.findings.push_back(*std::move(tuning.failure));
      return false;
    }
    preset.keys_hz = std::move(tuning.keys_hz);
    return true;
  }

  // Several files are one text, one behind the other.
  bool read_model(const std::vector<std::string>& paths, ReadOptions options) {
    options.most_nodes = options_.most_nodes;
    std::string text;
    int line = 1;
    for (const std::string& path : paths) {
      auto more = files_.read(path, max_model_bytes);
      if (!more) {
        return fail("", "", more.error());
      }
      if (!text.empty() && !text.ends_with('\n')) {
        text += '\n';
      }
      scene_.texts.push_back({path, line});
      text += *more;
      line = 1 + lines_of(text);
    }
    ParsedNetwork parsed = parse_network(text, options);
    if (parsed.ok() && !scene_.has_preset) {
      scene_.preset = default_preset(parsed.network, options_.bare);
      if (const auto idle = idle_keys(parsed.network, scene_.preset); idle && !options_.bare) {
        parsed.diagnostics.push_back(
            {Severity::warning, idle->line, idle->column, 1, idle->message});
      }
    }
    Lines lines(text);
    for (Diagnostic& diagnostic : parsed.diagnostics) {
      const std::string source = lines.at(diagnostic.line);
      const ModelText file = text_at(scene_, diagnostic.line);
      diagnostic.line -= file.first_line - 1;
      out_.findings.push_back({file.path, diagnostic, source});
      if (diagnostic.severity == Severity::warning) {
        scene_.warnings.push_back(to_string(out_.findings.back()));
      }
    }
    scene_.model_path = paths.front();
    scene_.third = parsed.third;
    scene_.motion = std::move(parsed.motion);
    const bool ok = parsed.ok();
    scene_.network = std::move(parsed.network);
    return ok;
  }

  // What a preset names is beside it, or among the program's own or the player's `kind`.
  std::optional<std::string> find_beside(const std::string& kind, const std::string& name) {
    const fs::path folder = fs::path(scene_.path).parent_path();
    std::vector<fs::path> tried = {folder / name, folder / ".." / kind / name,
                                   fs::path(models_folder()).parent_path() / kind / name};
    if (const std::string user = user_folder(); !user.empty()) {
      tried.insert(tried.end() - 1, fs::path(user) / kind / name);
    }
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
  SceneFiles files_;
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
  finding.source = error.line > 0 ? Lines(text).at(error.line) : "";
  return finding;
}

Finding finding_in_model(const Scene& scene, const Error& error) {
  const ModelText file = text_at(scene, error.line);
  Error there = error;
  there.line -= error.line > 0 ? file.first_line - 1 : 0;
  const auto text = read_text(file.path, max_model_bytes);
  return finding_of(file.path, text ? std::string_view(*text) : "", there);
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

// Every word of a source stands in quotes, or behind the ':', ';' or '?' that follows what is
// wrong.
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
    // A source may have quotes too: from the first that opens to the last that closes.
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
  std::string all;
  for (const Finding& finding : reading.findings) {  // a warning may explain an error
    all += (all.empty() ? "" : "\n") + to_string(finding);
  }
  return Error{std::move(all)};
}

}  // namespace ressort::session
