#include "app/commands/body/recording.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "app/text.h"
#include "core/format.h"
#include "core/identification/shapes.h"
#include "core/model/language/expression.h"
#include "core/ranges.h"

namespace ressort::commands {
namespace {

using nlohmann::json;

// Prints the known digits of a number and one more, at most twelve.
std::string known_digits(double value, double deviation) {
  constexpr int most = 12;
  const double share = deviation / std::fabs(value);
  const int digits = share > 0.0 && std::isfinite(share)
                         ? static_cast<int>(std::ceil(1.3 - std::log10(share)))
                         : most;
  char text[64];
  std::snprintf(text, sizeof text, "%.*g", std::clamp(digits, 4, most), value);
  return text;
}

double decibels(double factor) {
  return 20.0 * std::log10(std::max(factor, 1e-20));
}

std::vector<std::string> places_of(std::size_t channels) {
  if (channels == 1) {
    return {"mic"};
  }
  if (channels == 2) {
    return {"left", "right"};
  }
  std::vector<std::string> places;
  for (std::size_t c = 1; c <= channels; ++c) {
    places.push_back("mic" + std::to_string(c));
  }
  return places;
}

std::string one_line(const std::string& text) {
  std::string safe = text;
  std::replace_if(
      safe.begin(), safe.end(), [](char c) { return static_cast<unsigned char>(c) < 32; }, '?');
  return safe;
}

std::string header(const Identification& found, const std::string& source) {
  const std::size_t channels = found.sound.size();
  std::string text =
      "# The modes of " + one_line(source) + ": " + counted(found.modes.size(), "mode", "modes") +
      ", found in " + formatted("%.4g", found.analysed_s) + " s from the blow at " +
      formatted("%.4g", found.onset_s) + " s.\n" + choices_of(found, "# ", "\n") +
      "# Residual without them: " + formatted("%.1f", found.residual_db) + " dB of all";
  const double quiet = -100.0;  // octaves below this level contain nothing to explain
  for (const OctaveResidual& octave : found.octaves) {
    if (octave.level_db > quiet) {
      text += "; " + formatted("%.0f", std::sqrt(octave.low_hz * octave.high_hz)) + " Hz " +
              formatted("%.1f", octave.residual_db);
    }
  }
  text += " dB by octave.\n";
  if (found.fall.cents.value > 0.0) {
    text += "# Its pitch starts " +
            known_digits(found.fall.cents.value, found.fall.cents.deviation) + " +-" +
            formatted("%.1g", found.fall.cents.deviation) +
            " cents higher and falls with a time constant of " +
            known_digits(found.fall.decay_s.value, found.fall.decay_s.deviation) + " +-" +
            formatted("%.1g", found.fall.decay_s.deviation) +
            " s. These are the modes after the fall; a preset (-o NAME.toml) plays both.\n";
  }
  for (const std::string& warning : found.warnings) {
    text += "# Warning: " + one_line(warning) + ".\n";
  }
  text +=
      "# A force of 1 at " + joined(struck_places(found), ", ") +
      ", for one sample, makes the amplitudes of the recording" +
      std::string(channels == 1 ? " at mic" : "") +
      ".\n# Comments of the modes: standard deviations of Hz and T60, the level and its standard\n"
      "# deviation.\n";
  return text;
}

}  // namespace

std::vector<std::string> struck_places(const Identification& found) {
  std::vector<std::string> names;
  for (std::size_t r = 0; r < found.hits.size(); ++r) {
    names.push_back("hit" + std::to_string(r + 1));
  }
  return names.empty() ? std::vector<std::string>{"hit"} : names;
}

double hit_of(const Identification& found, std::size_t recording, std::size_t mode) {
  return found.hits.empty() ? 1.0 : found.hits[recording][mode];
}

std::string choices_of(const Identification& found, const std::string& before,
                       const std::string& after) {
  const std::string text = joined(found.choices, ", ", [](const Unexplained& choice) {
    return std::to_string(choice.modes) + " modes " + formatted("%.1f", choice.residual_db) + " dB";
  });
  return text.empty() ? text
                      : before + "Residual of the best modes (--modes): " + text + "." + after;
}

std::string label_of_file(const std::string& path) {
  std::string label = std::filesystem::path(path).stem().string();
  for (char& c : label) {
    const bool is_plain =
        (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    c = is_plain ? c : '_';
  }
  if (label.find_first_not_of('_') == label.npos) {
    return "body";
  }
  // Labels must not start with a digit, and in and out mark ports.
  return label[0] >= '0' && label[0] <= '9' ? "body_" + label : label;
}

std::string body_model(const Identification& found, const std::string& label,
                       const std::string& source, double mass) {
  const std::vector<std::string> places = places_of(found.sound.size());
  const std::vector<BodyShape> shapes = body_shapes(found.modes, mass);
  const std::vector<std::string> hits = struck_places(found);
  std::string text = header(found, source) + "@" + label + " body " + print_number(mass) + " " +
                     joined(hits, " ") + " " + joined(places, " ") + "\n";
  for (std::size_t k = 0; k < found.modes.size(); ++k) {
    const IdentifiedMode& mode = found.modes[k];
    double square = 0.0;
    double variance = 0.0;
    for (const Measured& amplitude : mode.amplitude) {
      square += amplitude.value * amplitude.value;
      variance += amplitude.deviation * amplitude.deviation * amplitude.value * amplitude.value;
    }
    const double size = std::sqrt(square);
    const double share = std::sqrt(variance) / square;
    text += "@" + label + "_" + std::to_string(k + 1) + " mode @" + label + " " +
            known_digits(mode.frequency_hz.value, mode.frequency_hz.deviation) + " " +
            known_digits(mode.t60_s.value, mode.t60_s.deviation);
    for (std::size_t r = 0; r < hits.size(); ++r) {
      text += " " + known_digits(shapes[k].hit * hit_of(found, r, k), 0.5 * share * shapes[k].hit);
    }
    for (const double heard : shapes[k].heard) {
      text += " " + known_digits(heard, share * std::fabs(shapes[k].hit));
    }
    text += "  # +-" + formatted("%.1g", mode.frequency_hz.deviation) + " Hz, +-" +
            formatted("%.1g", 100.0 * mode.t60_s.deviation / mode.t60_s.value) + " %, " +
            formatted("%.1f", decibels(size)) + " dB +-" +
            formatted("%.1g", decibels(1.0 + share)) + "\n";
  }
  for (std::size_t r = 0; r < hits.size(); ++r) {
    text += "@in" + std::to_string(r + 1) + " frcInput [@" + label + " " + hits[r] + "]\n";
  }
  for (std::size_t c = 0; c < places.size(); ++c) {
    text += "@out" + std::to_string(c + 1) + " posOutput [@" + label + " " + places[c] + "]\n";
  }
  return text;
}

std::string identification_json(const Identification& found, double mass) {
  const std::vector<BodyShape> shapes = body_shapes(found.modes, mass);
  json modes = json::array();
  for (std::size_t k = 0; k < found.modes.size(); ++k) {
    const IdentifiedMode& mode = found.modes[k];
    json channels = json::array();
    for (std::size_t c = 0; c < mode.amplitude.size(); ++c) {
      channels.push_back({{"amplitude", mode.amplitude[c].value},
                          {"amplitude_deviation", mode.amplitude[c].deviation},
                          {"phase_rad", mode.phase_rad[c].value},
                          {"phase_deviation_rad", mode.phase_rad[c].deviation},
                          {"displacement", shapes[k].heard[c]}});
    }
    modes.push_back({{"frequency_hz", mode.frequency_hz.value},
                     {"frequency_deviation_hz", mode.frequency_hz.deviation},
                     {"t60_s", mode.t60_s.value},
                     {"t60_deviation_s", mode.t60_s.deviation},
                     {"hit", shapes[k].hit},
                     {"channels", channels}});
  }
  json octaves = json::array();
  for (const OctaveResidual& octave : found.octaves) {
    octaves.push_back({{"low_hz", octave.low_hz},
                       {"high_hz", octave.high_hz},
                       {"level_db", octave.level_db},
                       {"residual_db", octave.residual_db}});
  }
  json choices = json::array();
  for (const Unexplained& choice : found.choices) {
    choices.push_back({{"modes", choice.modes}, {"residual_db", choice.residual_db}});
  }
  const json out{{"rate_hz", found.rate_hz},
                 {"onset_s", found.onset_s},
                 {"time_zero_s", found.time_zero_s},
                 {"analysed_s", found.analysed_s},
                 {"mass", mass},
                 {"fall",
                  {{"cents", found.fall.cents.value},
                   {"cents_deviation", found.fall.cents.deviation},
                   {"decay_s", found.fall.decay_s.value},
                   {"decay_deviation_s", found.fall.decay_s.deviation}}},
                 {"modes", modes},
                 {"residual_db", found.residual_db},
                 {"choices", choices},
                 {"octaves", octaves},
                 {"warnings", found.warnings}};
  return out.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

}  // namespace ressort::commands
