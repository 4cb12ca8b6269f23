#include "app/commands/timbre/describe_text.h"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

#include "app/text.h"
#include "core/format.h"

namespace ressort::commands {
namespace {

using json = nlohmann::ordered_json;

constexpr const char* window_names[] = {"hann", "hamming", "blackman", "none"};

json number(std::optional<double> value) {
  return value && std::isfinite(*value) ? json(*value) : json();
}

// Figures of equal names, such as the tristimulus, form an array. Missing figures are null.
void put_figures(json& object, const FigureValues& values) {
  const auto figures = timbre_figures();
  for (std::size_t i = 0; i < figures.size(); ++i) {
    const std::string name(figures[i].name);
    const bool is_one_of_several = (i > 0 && figures[i - 1].name == name) ||
                                   (i + 1 < figures.size() && figures[i + 1].name == name);
    if (!is_one_of_several) {
      object[name] = number(values[i]);
    } else if (!values[i]) {
      object[name] = json();
    } else {
      object[name].push_back(number(values[i]));
    }
  }
}

std::string dumped(const json& object) {
  return object.dump(-1, ' ', false, json::error_handler_t::replace);
}

std::string significant(std::optional<double> value) {
  if (!value) {
    return "-";
  }
  return formatted("%.6g", *value);
}

double seconds_at(const Description& description, std::size_t sample) {
  return static_cast<double>(sample) / description.rate_hz;
}

}  // namespace

void print_json(const Description& description, const DescriptionOptions& options) {
  const bool is_one_frame = options.at.has_value();
  json head{{"of", description.of},
            {"rate_hz", description.rate_hz},
            {"channels", description.channels},
            {"samples", description.samples},
            {"frame", options.frame},
            {"hop", options.hop},
            {"window", window_names[static_cast<std::size_t>(options.window)]},
            {"spectrum", options.kind == SpectrumKind::magnitude ? "magnitude" : "power"},
            {"closed_form", description.channels == 0},
            {"at", is_one_frame ? json(*options.at) : json()},
            {"f0_hz", number(description.f0_hz)}};
  const FigureStatistics statistics = statistics_of(description);
  put_figures(head, is_one_frame ? description.frames.at(0).values : statistics.median);
  for (const TemporalFigure& figure : temporal_figures()) {
    head[std::string(figure.name)] =
        description.temporal ? number(figure.of(*description.temporal)) : json();
  }
  if (!description.modes.empty()) {
    json modes = json::array();
    for (const DescribedMode& mode : description.modes) {
      modes.push_back({{"frequency_hz", mode.frequency_hz}, {"t60_s", number(mode.t60_s)}});
    }
    head["modes"] = std::move(modes);
  }
  if (is_one_frame) {
    std::printf("%s\n", dumped(head).c_str());
    return;
  }
  json spread = json::object();
  put_figures(spread, statistics.interquartile_range);
  head["interquartile_range"] = std::move(spread);
  std::string text = dumped(head);
  text.pop_back();  // the closing brace, before the frames
  std::printf("%s,\"frames\":[", text.c_str());
  const char* between = "\n";
  for (const DescribedFrame& frame : description.frames) {
    json row{{"time_s", seconds_at(description, frame.at)}, {"at", frame.at}};
    put_figures(row, frame.values);
    std::printf("%s%s", between, dumped(row).c_str());
    between = ",\n";
  }
  std::printf("\n]}\n");
}

std::string to_text(const Description& description, const DescriptionOptions& options) {
  const FigureStatistics statistics = statistics_of(description);
  const bool is_one_frame = options.at.has_value();
  const FigureValues& values = is_one_frame ? description.frames.at(0).values : statistics.median;
  std::string text = description.of + ": " +
                     fixed(static_cast<double>(description.samples) / description.rate_hz, 2) +
                     " s at " + fixed(description.rate_hz, 0) + " Hz";
  if (description.channels > 1) {
    text += ", the mean of its " + std::to_string(description.channels) + " channels";
  }
  text +=
      description.f0_hz ? ", f0 " + fixed(*description.f0_hz, 2) + " Hz\n" : ", without a pitch\n";
  for (const std::string& line : timbre_words(values, description.temporal)) {
    text += line + "\n";
  }
  std::vector<std::vector<std::string>> rows;
  rows.push_back(is_one_frame
                     ? std::vector<std::string>{"figure", "at " + std::to_string(*options.at)}
                     : std::vector<std::string>{"figure", "median", "interquartile range"});
  for (std::size_t i = 0; i < timbre_figures().size(); ++i) {
    rows.push_back({std::string(timbre_figures()[i].name), significant(values[i])});
    if (!is_one_frame) {
      rows.back().push_back(significant(statistics.interquartile_range[i]));
    }
  }
  for (const TemporalFigure& figure : temporal_figures()) {
    if (description.temporal) {
      rows.push_back({std::string(figure.name), significant(figure.of(*description.temporal))});
      rows.back().resize(rows.front().size());
    }
  }
  text += table(rows);
  if (!description.modes.empty()) {
    rows = {{"mode Hz", "T60 s"}};
    for (const DescribedMode& mode : description.modes) {
      rows.push_back({fixed(mode.frequency_hz, 2),
                      std::isfinite(mode.t60_s) ? fixed(mode.t60_s, 3) : "endless"});
    }
    text += "\n" + table(rows);
  }
  return text;
}

}  // namespace ressort::commands
