#include "app/session/timbre/shape.h"

#include <algorithm>
#include <cmath>

#include "app/session/modes/known_modes.h"
#include "app/session/timbre/timbre_figures.h"
#include "app/text.h"
#include "core/analysis/modes/scaling.h"
#include "core/engine/playing.h"
#include "core/format.h"
#include "core/gesture.h"
#include "core/laws/law.h"
#include "core/model/language/expression.h"
#include "core/model/preset/fit.h"
#include "core/model/topology.h"

namespace ressort::session {
namespace {

constexpr double missed_by = 0.1;  // deviation in JND; a smaller one counts as reached

// Returns the suffix of a figure's name from its '_' on, or an empty string.
std::string_view unit_of(TargetFigure figure) {
  const std::string_view name = row_of(figure).name;
  for (const std::string_view unit : {"_hz", "_ms", "_s"}) {
    if (name.ends_with(unit)) {
      return unit;
    }
  }
  return {};
}

std::string figure_text(TargetFigure figure, double value) {
  const std::string_view ending = unit_of(figure);
  const std::string unit = ending.empty()    ? ""
                           : ending == "_hz" ? " Hz"
                                             : " " + std::string(ending.substr(1));
  const double size = std::fabs(value);
  const int digits = size >= 1000.0  ? 0
                     : size >= 100.0 ? 1
                     : size >= 1.0   ? 2
                     : size >= 1e-3  ? 4
                                     : 7;
  return (size >= 1e9                 ? print_number(value)
          : size > 0.0 && size < 1e-5 ? formatted("%.4g", value)
                                      : with_commas(value, digits)) +
         unit;
}

// Returns an error that names the first line where a parameter could replace a number.
Error nothing_to_turn(const Scene& scene) {
  const Network& network = scene.network;
  if (!network.parameters.empty()) {
    return {
        "there is no parameter to adjust: each one belongs to an input or has only one value; "
        "give one a wider range in the preset's [parameters]"};
  }
  const std::string how =
      " is a fixed number; put '@K param VALUE' above this line and K in its "
      "place";
  const auto lines = spring_lines(network);
  if (!lines || lines->empty()) {
    return {"there is no parameter to adjust: the model has no 'param'"};
  }
  const SpringLine& line = lines->front();
  const SourceLocation place =
      line.kind == SpringLine::Kind::macro  ? network.macros[line.index].location
      : line.kind == SpringLine::Kind::link ? network.links[line.index].location
                                            : network.masses[line.index].location;
  const Finding finding = finding_in_model(
      scene,
      {"there is no parameter to adjust: the stiffness here" + how, place.line, place.column});
  return {to_string(finding)};
}

std::optional<Error> not_linear(const Scene& scene) {
  const std::string so = ", so its timbre depends on how it is played and cannot be adjusted";
  if (has_waveguide(scene.network)) {
    return Error{scene.name + " has a waveguide, which has no modes of this kind" + so};
  }
  for (const Link& link : scene.network.links) {
    if (!is_linear(link.law)) {
      const std::string what = "a " + std::string(facts_of(link.law).one);
      return Error{
          to_string(finding_in_model(scene, {scene.name + " is not linear: here is " + what + so,
                                             link.location.line, link.location.column}))};
    }
  }
  return std::nullopt;
}

// Returns the preset's strikes for this key at velocity 100, or one sample at the first input.
std::vector<StrikePulse> blows_of(const ShapeRequest& request) {
  constexpr double usual_velocity = 100.0 / 127.0;
  const Scene& scene = request.scene;
  const Preset& preset = scene.preset;
  const VelocityCurve velocity{.points = preset.velocity_points,
                               .exponent = std::exp2(-2.0 * preset.velocity)};
  std::vector<StrikePulse> blows;
  for (const ControlSetting& setting : preset.controls) {
    const ControlSetting control = on_key(setting, request.key);
    const int input = find_input(scene.network, control.target);
    if (!request.has_keys || control.source != ControlSource::note || control.turn != 1 ||
        input < 0 || request.key < control.lowest_key || control.highest_key < request.key ||
        control.gesture != Gesture::impulse) {
      continue;
    }
    constexpr double to_a_microsecond = 1e6;
    const Stroke stroke{.amount = velocity(usual_velocity),
                        .has_control = true,
                        .settings = {.low = control.low,
                                     .high = control.high,
                                     .exponential = control.exponential,
                                     .longest_s = control.longest_ms / 1e3,
                                     .shortest_s = control.shortest_ms / 1e3},
                        .rate_hz = to_a_microsecond};
    blows.push_back({.input = static_cast<std::size_t>(input),
                     .strength = stroke.mapped(),
                     .length_s = static_cast<double>(stroke.pulse_frames()) / to_a_microsecond,
                     .follows_pitch = control.follows_pitch});
  }
  return blows.empty() ? std::vector<StrikePulse>{{}} : blows;
}

// Returns "a strike of 0.3 ms at in1", or "strikes at in1 and 5 more".
std::string describe_strikes(const std::vector<StrikePulse>& blows, const Network& network) {
  const std::string first = " at in" + std::to_string(network.inputs[blows[0].input].number);
  if (blows.size() > 1) {
    return "strikes" + first + " and " + std::to_string(blows.size() - 1) + " more";
  }
  const double ms = 1e3 * blows[0].length_s;
  return "a strike" + (ms > 0.0 ? " of " + fixed(ms, 2) + " ms" : "") + first;
}

double key_hz(const Preset& preset, int key) {
  const auto index = static_cast<std::size_t>(key);
  const double ratio = std::exp2(preset.transpose / 12.0);
  return index < preset.keys_hz.size() ? preset.a4_hz / usual_a4_hz * ratio * preset.keys_hz[index]
                                       : preset.a4_hz * ratio * std::exp2((key - 69) / 12.0);
}

}  // namespace

std::string short_name(TargetFigure figure) {
  const std::string_view name = row_of(figure).name;
  return std::string(name.substr(0, name.size() - unit_of(figure).size()));
}

Result<TargetFigure> parse_target_figure(const std::string& word) {
  std::vector<std::string> known;
  for (const TargetFigureRow& row : target_figure_rows()) {
    known.push_back(short_name(row.figure));
    if (word == row.name || word == known.back()) {
      return row.figure;
    }
  }
  return Error{"unknown figure '" + word + "'; there are " + joined(known, ", ") +
               did_you_mean(word, known)};
}

Result<Shaped> shape_timbre(const ShapeRequest& request, std::vector<TimbreTarget> targets) {
  const Scene& scene = request.scene;
  const Preset& preset = scene.preset;
  if (auto error = not_linear(scene)) {
    return *error;
  }
  if (!preset.bodies.empty()) {
    return Error{scene.name + " plays through " + preset.through.front() +
                 ", whose part of the timbre is unknown here; shape a preset without 'through'"};
  }
  if (scene.network.inputs.empty() || scene.network.outputs.empty()) {
    return Error{scene.name + " has no " +
                 (scene.network.inputs.empty() ? "input to strike" : "output to listen to")};
  }
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const auto same = [&](const TimbreTarget& other) { return other.figure == targets[i].figure; };
    if (std::ranges::count_if(targets, same) > 1) {
      return Error{short_name(targets[i].figure) + " is given twice"};
    }
    if (request.has_keys && targets[i].figure == TargetFigure::f0) {
      return Error{"keys set the pitch of " + scene.name + "; use another key instead"};
    }
  }
  std::vector<FreeParameter> free;
  Shaped shaped;
  for (std::size_t i = 0; i < request.parameters.size(); ++i) {
    const ParameterInfo& info = request.parameters[i];
    shaped.names.push_back(info.name);
    if (info.audio_input == 0 && info.minimum < info.maximum) {
      free.push_back({i, info.minimum, info.maximum});
    }
  }
  if (free.empty()) {
    return nothing_to_turn(scene);
  }
  StrikeOptions options{
      .rate_hz = request.rate_hz,
      .blows = blows_of(request),
      .has_attack = std::ranges::any_of(
          targets,
          [](const TimbreTarget& target) { return target.figure == TargetFigure::attack; }),
      .progress = request.progress};
  shaped.of = scene.name;
  if (request.has_keys) {
    options.key_hz = key_hz(preset, request.key);
    shaped.of += ", key " + std::to_string(request.key) + " (" + note_name(*options.key_hz) + ")";
  }
  shaped.of += ", " + describe_strikes(options.blows, scene.network) + ", heard at all outputs";
  const Network network = with_fixed(scene.network, preset);
  StruckModel model(network, options);
  shaped.targets = targets;
  auto found = find_timbre(timbre_model(model, StruckAs::lines), request.values, free, targets,
                           {.exactly = timbre_model(model, StruckAs::samples),
                            .on_progress = request.on_progress,
                            .progress = request.progress});
  if (!found) {
    return found.error().message == stopped ? found.error()
                                            : Error{scene.name + ": " + found.error().message};
  }
  shaped.found = *std::move(found);
  if (!options.has_attack) {  // printed even if it is not a target
    const auto attack = static_cast<std::size_t>(TargetFigure::attack);
    shaped.found.before[attack] = model.attack_ms(request.values);
    shaped.found.reached[attack] = model.attack_ms(shaped.found.values);
  }
  return shaped;
}

std::vector<ShapedParameter> changed(const Shaped& shaped, std::span<const double> before) {
  std::vector<ShapedParameter> all;
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (shaped.found.values[i] != before[i]) {
      all.push_back({shaped.names[i], shaped.found.values[i]});
    }
  }
  return all;
}

std::vector<std::string> missed(const Shaped& shaped) {
  std::vector<std::string> held;
  for (const FoundTimbre::Held& bound : shaped.found.held) {
    held.push_back(shaped.names[bound.index] + " is at its " +
                   (bound.is_highest ? "highest" : "lowest"));
  }
  const std::string why =
      !shaped.found.has_influence ? "no parameter changes it"
      : held.empty()
          ? shaped.targets.size() > 1 ? "the targets conflict" : "the parameters allow no more"
          : joined(held, ", ");
  std::vector<std::string> lines;
  for (std::size_t t = 0; t < shaped.targets.size(); ++t) {
    const double noticed = shaped.found.noticed[t];
    if (std::fabs(noticed) <= missed_by) {
      continue;
    }
    const TargetFigure figure = shaped.targets[t].figure;
    const double reached = *shaped.found.reached[static_cast<std::size_t>(figure)];
    const std::string word(noticed < 0.0 ? row_of(figure).more : row_of(figure).less);
    lines.push_back(figure_text(figure, reached) + " is as " + word + " as it gets" +
                    (shaped.targets.size() > 1 ? " with the other targets" : "") + ": " + why);
  }
  return lines;
}

std::string to_text(const Shaped& shaped) {
  std::vector<std::vector<std::string>> rows{{"figure", "before", "target", "reached", "error"}};
  const auto value = [](TargetFigure figure, const TargetValues& values) {
    const auto one = values[static_cast<std::size_t>(figure)];
    return one ? figure_text(figure, *one) : std::string("-");
  };
  for (const TargetFigureRow& row : target_figure_rows()) {
    std::vector<std::string> cells{short_name(row.figure), value(row.figure, shaped.found.before),
                                   "", value(row.figure, shaped.found.reached), ""};
    for (std::size_t t = 0; t < shaped.targets.size(); ++t) {
      if (shaped.targets[t].figure == row.figure) {
        cells[2] = figure_text(row.figure, shaped.targets[t].value);
        cells[4] = fixed(std::fabs(shaped.found.noticed[t]), 2) + " JND";
      }
    }
    rows.push_back(std::move(cells));
  }
  std::string text = shaped.of + "\n" + table(rows);
  for (const std::string& line : missed(shaped)) {
    text += "\n" + line;
  }
  return text;
}

}  // namespace ressort::session
