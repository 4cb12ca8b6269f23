#include "app/session/modes/known_modes.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "app/session/files.h"
#include "app/session/modes/tuned_files.h"
#include "app/text.h"
#include "app/version.h"
#include "core/model/language/expression.h"
#include "core/model/language/print.h"

namespace ressort::session {
namespace {

using nlohmann::json;

constexpr double worth_keeping_s = 0.2;
constexpr std::size_t most_kept_bytes = std::size_t{64} << 20;
constexpr double endless = std::numeric_limits<double>::infinity();

// Returns the cache file for the modes of this network; empty without a cache folder.
std::string cache_path(const Scene& scene, const std::vector<double>& parameters,
                       const ModeOptions& options) {
  const std::string folder = cache_folder();
  if (folder.empty()) {
    return "";
  }
  std::string key = std::string(version) + " " + commit + " " + print_number(options.rate_hz) +
                    (options.scheme == ModeScheme::published ? " published " : " continuous ") +
                    std::to_string(options.count);
  for (const double value : parameters) {
    key += " " + print_number(value);
  }
  return folder + "/modes/" + digest(key + "\n" + print_network(scene.network)) + ".json";
}

json json_of(const KnownModes& modes) {
  json list = json::array();
  for (const KnownMode& mode : modes.modes) {
    list.push_back({{"frequency_hz", mode.frequency_hz},
                    {"t60_s", std::isfinite(mode.t60_s) ? json(mode.t60_s) : json()},
                    {"levels", mode.levels}});
  }
  return {{"modes", list},
          {"inputs", modes.inputs},
          {"outputs", modes.outputs},
          {"masses", modes.masses},
          {"all", modes.is_all},
          {"linear", modes.is_linear},
          {"of", modes.scheme == ModeScheme::published ? "published scheme" : "continuous network"},
          {"rate_hz", modes.rate_hz},
          {"residual", modes.residual}};
}

// Returns nothing if the file is incomplete or not ours.
std::optional<KnownModes> read_cache(const std::string& path, const ModeOptions& options) {
  const auto text = read_text(path, most_kept_bytes);
  if (!text) {
    return std::nullopt;
  }
  const json read = json::parse(*text, nullptr, false);
  if (read.is_discarded()) {
    return std::nullopt;
  }
  try {
    KnownModes modes{.modes = {},
                     .inputs = read.at("inputs"),
                     .outputs = read.at("outputs"),
                     .masses = read.at("masses"),
                     .is_all = read.at("all"),
                     .is_linear = read.at("linear"),
                     .scheme = options.scheme,
                     .rate_hz = read.at("rate_hz"),
                     .residual = read.at("residual")};
    for (const json& mode : read.at("modes")) {
      const json& t60_s = mode.at("t60_s");
      modes.modes.push_back({.frequency_hz = mode.at("frequency_hz"),
                             .t60_s = t60_s.is_null() ? endless : t60_s.get<double>(),
                             .levels = mode.at("levels")});
    }
    return modes;
  } catch (const json::exception&) {
    return std::nullopt;
  }
}

void write_cache(const std::string& path, const KnownModes& modes) {
  std::error_code error;
  std::filesystem::create_directories(std::filesystem::path(path).parent_path(), error);
  static_cast<void>(write_text(path, json_of(modes).dump(), Existing::replace));
}

}  // namespace

std::vector<double> start_values(const Scene& scene) {
  std::vector<double> values = parameter_values(scene.network);
  for (std::size_t i = 0; i < values.size(); ++i) {
    for (const ParameterSetting& setting : scene.preset.parameters) {
      if (setting.name == scene.network.parameters[i].name) {
        values[i] = setting.value;
      }
    }
  }
  return values;
}

KnownModes known_modes(const NetworkModes& found) {
  KnownModes modes{.modes = {},
                   .inputs = {},
                   .outputs = {},
                   .masses = found.system.size(),
                   .is_all = found.is_all,
                   .is_linear = found.is_linear(),
                   .scheme = found.scheme,
                   .rate_hz = found.rate_hz,
                   .residual = found.residual};
  for (const Input& input : found.network.inputs) {
    modes.inputs.push_back("in" + std::to_string(input.number));
  }
  for (const Output& output : found.network.outputs) {
    const std::string name = "out" + std::to_string(output.number);
    if (modes.outputs.empty() || modes.outputs.back() != name) {
      modes.outputs.push_back(name);
    }
  }
  for (const NetworkMode& mode : found.modes) {
    KnownMode& known = modes.modes.emplace_back(KnownMode{mode.frequency_hz, mode.t60_s, {}});
    for (std::size_t input = 0; input < found.inputs; ++input) {
      const auto first = mode.levels.begin() + static_cast<std::ptrdiff_t>(input * found.outputs);
      known.levels.emplace_back(first, first + static_cast<std::ptrdiff_t>(found.outputs));
    }
  }
  return modes;
}

Result<KnownModes> known_modes(const Scene& scene, const std::vector<double>& parameters,
                               const ModeOptions& options) {
  const std::string path = cache_path(scene, parameters, options);
  if (!path.empty()) {
    if (auto modes = read_cache(path, options)) {
      return *std::move(modes);
    }
  }
  const auto start = std::chrono::steady_clock::now();
  const auto found = find_modes(scene.network, parameters, options);
  if (!found) {
    return found.error();
  }
  KnownModes modes = known_modes(*found);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  if (!path.empty() && took.count() > worth_keeping_s) {
    write_cache(path, modes);
  }
  return modes;
}

std::string to_json(const KnownModes& modes) {
  return json_of(modes).dump(2, ' ', false, json::error_handler_t::replace);
}

std::string note_name(double frequency_hz) {
  constexpr const char* names[] = {"C", "C#", "D", "D#", "E", "F", "F#", "G", "G#", "A", "A#", "B"};
  if (!(frequency_hz > 1.0)) {
    return "-";
  }
  const double key = 69.0 + 12.0 * std::log2(frequency_hz / 440.0);
  const auto nearest = static_cast<int>(std::lround(key));
  const auto cents = static_cast<int>(std::lround(100.0 * (key - nearest)));
  return std::string(names[(nearest % 12 + 12) % 12]) + std::to_string(nearest / 12 - 1) +
         (cents < 0 ? " -" : " +") + std::to_string(std::abs(cents));
}

std::optional<double> frequency_of(const std::string& text) {
  constexpr std::string_view letters = "C D EF G A B";  // position is the semitone
  double hertz = 0.0;
  if (parse_number(text, hertz)) {
    return hertz > 0.0 ? std::optional(hertz) : std::nullopt;
  }
  const std::size_t letter =
      text.empty() || text[0] == ' ' ? std::string_view::npos : letters.find(text[0] & ~0x20);
  std::size_t at = 1;
  double semitone = static_cast<double>(letter);
  for (; at < text.size() && (text[at] == '#' || text[at] == 'b'); ++at) {
    semitone += text[at] == '#' ? 1.0 : -1.0;
  }
  double octave = 0.0;
  if (letter == std::string_view::npos || !parse_number(text.substr(at), octave) ||
      octave != std::rint(octave)) {
    return std::nullopt;
  }
  return 440.0 * std::exp2((semitone - 9.0) / 12.0 + octave - 4.0);
}

std::string to_table(const KnownModes& modes) {
  constexpr std::size_t most_columns = 6;
  constexpr double least_db = -200.0;
  std::vector<std::vector<std::string>> rows{{"mode", "Hz", "note", "T60 s"}};
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < modes.inputs.size(); ++i) {
    for (std::size_t o = 0; o < modes.outputs.size() && pairs.size() < most_columns; ++o) {
      pairs.emplace_back(i, o);
      rows[0].push_back(modes.inputs[i] + ">" + modes.outputs[o] + " dB");
    }
  }
  std::vector<double> loudest(pairs.size(), 0.0);
  for (const KnownMode& mode : modes.modes) {
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      loudest[p] = std::max(loudest[p], mode.levels[pairs[p].first][pairs[p].second]);
    }
  }
  for (std::size_t m = 0; m < modes.modes.size(); ++m) {
    const KnownMode& mode = modes.modes[m];
    std::vector<std::string>& row = rows.emplace_back(std::vector<std::string>{
        std::to_string(m + 1), fixed(mode.frequency_hz, 3), note_name(mode.frequency_hz),
        std::isfinite(mode.t60_s) ? fixed(mode.t60_s, 3) : "endless"});
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      const double level = mode.levels[pairs[p].first][pairs[p].second];
      const double db = 20.0 * std::log10(level / loudest[p]);
      row.push_back(db > least_db ? fixed(db, 1) : "-");
    }
  }
  return table(rows);
}

}  // namespace ressort::session
