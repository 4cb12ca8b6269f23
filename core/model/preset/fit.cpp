#include "core/model/preset/fit.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>

#include "core/laws/law.h"
#include "core/model/language/tokens.h"
#include "core/ranges.h"

namespace ressort::model {
namespace {

std::string names(const Network& network) {
  const std::string text = joined(network.parameters, ", ", &Parameter::name);
  return text.empty() ? "none" : text;
}

// Returns the reason why a parameter cannot differ from voice to voice, or "". `what`: what needs
// that.
std::string misfit_in_voices(const Network& network, const Preset& preset, const std::string& name,
                             const std::string& what) {
  const int index = find_parameter(network, name);
  if (index < 0) {
    return no_parameter(network, name);
  }
  if (network.parameters[static_cast<std::size_t>(index)].audio_input > 0) {
    return quoted(name) + " is set by an audio input, so it has no " + what +
           "; remove one of them";
  }
  for (const BodyModel& body : preset.bodies) {
    if (find_parameter(body.network, name) >= 0) {
      return quoted(name) + " is a parameter of " + quoted(body.name()) +
             " in 'through', which all voices share, so it has no " + what + "; rename one of them";
    }
  }
  const auto is_read = [&](const Step& step) {
    return step.op == Op::parameter && step.index == static_cast<std::uint32_t>(index);
  };
  for (const Output& output : network.outputs) {
    const Formula level = output.level == no_argument ? Formula() : network.arguments[output.level];
    if (std::ranges::any_of(level, is_read)) {
      return quoted(name) + " sets the level of an output, which all voices share, so it has no " +
             what + "; use 'keys_db' for a level by key";
    }
  }
  return "";
}

// Returns an error message for the control, or "".
std::string misfit(const Network& network, const Preset& preset, const ControlSetting& control) {
  if (control.source == ControlSource::lfo) {
    return control.target == "pitch" || control.target == "level"
               ? ""
               : misfit_in_voices(network, preset, control.target, "LFO");
  }
  if (control.gesture == Gesture::parameter) {
    return find_parameter(network, control.target) < 0 ? no_parameter(network, control.target)
           : control.source == ControlSource::audio
               ? "an audio channel drives an input, not a parameter"
               : "";
  }
  const int input = find_input(network, control.target);
  if (input < 0) {
    return "the model has no input " + quoted(control.target) + "; it has " +
           std::to_string(network.inputs.size());
  }
  if (control.in_swings && !touch_of(network, static_cast<std::size_t>(input))) {
    return "'" + control.target + "' has no contact or pluck, so its range cannot be in swings";
  }
  return network.inputs[static_cast<std::size_t>(input)].is_force &&
                 row_of(control.gesture).needs_position
             ? "'" + control.target + "' is a force input, but this gesture needs a position input"
             : "";
}

// Returns an error message for the setting of a parameter, or "".
std::string misfit(const Network& network, const Preset& preset, const ParameterSetting& setting) {
  return setting.has_curve() ? misfit_in_voices(network, preset, setting.name, "curve")
         : find_parameter(network, setting.name) < 0 ? no_parameter(network, setting.name)
                                                     : "";
}

// Returns whether an input or a parameter of the network uses this audio channel.
bool hears_channel(const Network& network, int channel) {
  const auto is_input = [&](const Input& input) { return input.number == channel; };
  const auto is_parameter = [&](const Parameter& one) { return one.audio_input == channel; };
  return std::ranges::any_of(network.inputs, is_input) ||
         std::ranges::any_of(network.parameters, is_parameter);
}

// Returns an error message for outputs of the voices or of a body that drive nothing, or "".
std::string misfit_of_bodies(const Network& network, const Preset& preset) {
  const Network* from = &network;
  std::string name = "the model";
  for (const BodyModel& body : preset.bodies) {
    const std::string file = quoted(body.name());
    for (const Output& output : from->outputs) {
      if (!hears_channel(body.network, output.number)) {
        const std::string number = std::to_string(output.number);
        return name + " has an output " + number + ", but " + file + " in 'through' has no input " +
               number + "; add @in" + number + " there, or remove the output";
      }
    }
    if (from->outputs.empty() || body.network.outputs.empty()) {
      return (from->outputs.empty() ? name : file) + " has no output, so 'through' is silent";
    }
    from = &body.network;
    name = file;
  }
  return "";
}

// Marks all elements with a label; returns false if there are none.
bool fix(Network& network, const std::string& label) {
  bool is_there = false;
  const auto mark = [&](auto& elements) {
    for (auto& element : elements) {
      const bool is_meant = std::string_view(element.name) == label;
      element.is_fixed = element.is_fixed || is_meant;
      is_there = is_there || is_meant;
    }
  };
  mark(network.masses);
  mark(network.macros);
  mark(network.links);
  return is_there;
}

}  // namespace

std::string no_parameter(const Network& network, const std::string& name) {
  return "the model has no parameter " + quoted(name) + "; it has " + names(network);
}

int find_input(const Network& network, std::string_view target) {
  int number = 0;
  if (target.starts_with("in")) {
    const char* const end = target.data() + target.size();
    const auto [last, failure] = std::from_chars(target.data() + 2, end, number);
    if (failure == std::errc{} && last == end) {
      for (std::size_t i = 0; i < network.inputs.size(); ++i) {
        if (network.inputs[i].number == number) {
          return static_cast<int>(i);
        }
      }
    }
  }
  return -1;
}

int find_parameter(const Network& network, std::string_view name) {
  for (std::size_t i = 0; i < network.parameters.size(); ++i) {
    if (network.parameters[i].name == name) {
      return static_cast<int>(i);
    }
  }
  return -1;
}

std::optional<Touch> touch_of(const Network& network, std::size_t input) {
  const std::uint32_t hand = network.inputs[input].mass;
  for (const Link& link : network.links) {
    const LawFacts& facts = facts_of(link.law);
    if (network.inputs[input].is_force || !facts.can_detach() ||
        (link.a != hand && link.b != hand)) {
      continue;
    }
    const double reach =
        argument_value(network, link.arguments[facts.slot(Role::reach)], parameter_values(network));
    const std::uint32_t mass = link.a == hand ? link.b : link.a;
    const double rest = network.masses[mass].position;
    // The first end of a contact is the lower one. A pluck is touched from the side of its start.
    const bool is_below =
        facts.is_one_sided() ? link.a == hand : network.masses[hand].position < rest;
    const double inwards = is_below ? 1.0 : -1.0;
    return Touch{.mass = mass, .position = rest - inwards * std::fabs(reach), .inwards = inwards};
  }
  return std::nullopt;
}

Network heard_where_touched(Network network, const Preset& preset) {
  constexpr double far_away = 1e9;
  network.outputs.clear();
  for (const ControlSetting& control : preset.controls) {
    const int input = control.in_swings ? find_input(network, control.target) : -1;
    if (const auto touch =
            input < 0 ? std::nullopt : touch_of(network, static_cast<std::size_t>(input))) {
      network.outputs.push_back(
          {.number = static_cast<int>(network.outputs.size()) + 1, .mass = touch->mass});
      Mass& hand = network.masses[network.inputs[static_cast<std::size_t>(input)].mass];
      hand.position = touch->position - touch->inwards * far_away;
    }
  }
  return network;
}

Network with_preset_parameters(Network network, const Preset& preset) {
  for (const BodyModel& body : preset.bodies) {
    for (const Parameter& parameter : body.network.parameters) {
      if (parameter.audio_input == 0 && find_parameter(network, parameter.name) < 0) {
        network.parameters.push_back(parameter);
      }
    }
  }
  const auto setting =
      std::ranges::find(preset.parameters, preset.hardness, &ParameterSetting::name);
  if (setting != preset.parameters.end() && find_parameter(network, preset.hardness) < 0) {
    network.parameters.push_back({.name = setting->name, .value = setting->value});
  }
  return network;
}

Network with_fixed(Network network, const Preset& preset) {
  for (const std::string& label : preset.fixed) {
    fix(network, label);
  }
  return network;
}

std::vector<Error> find_preset_errors(const Network& network, const Preset& preset) {
  std::vector<Error> found;
  Network marked = preset.fixed.empty() ? Network() : network;
  for (const std::string& label : preset.fixed) {
    if (!fix(marked, label)) {
      found.push_back({"the model has no element " + quoted(label) + " for 'fixed'",
                       preset.model_location.line, preset.model_location.column});
    }
  }
  for (const ParameterSetting& setting : preset.parameters) {
    if (std::string message = misfit(network, preset, setting); !message.empty()) {
      found.push_back({std::move(message), setting.location.line, setting.location.column});
    }
  }
  const auto is_tuned_along = [&](const ParameterSetting& one) {
    return one.name == preset.tuned_along && one.minimum < one.maximum;
  };
  if (!preset.tuned_along.empty() &&
      (!preset.morph.empty() || std::ranges::none_of(preset.parameters, is_tuned_along))) {
    found.push_back({preset.morph.empty()
                         ? "'tuned_along' must name one of [parameters] with a range"
                         : "keys stay in tune along the morph anyway; remove 'tuned_along'",
                     preset.tuned_along_location.line, preset.tuned_along_location.column});
  }
  const auto is_blow = [](const ControlSetting& control) {
    return control.longest_ms > 0.0 && control.gesture != Gesture::noise;
  };
  if (!preset.hardness.empty() && (find_parameter(network, preset.hardness) < 0 ||
                                   std::ranges::none_of(preset.controls, is_blow))) {
    found.push_back({"'hardness' must name one of [parameters], and a blow must have 'length_ms'",
                     preset.hardness_location.line, preset.hardness_location.column});
  }
  for (const ControlSetting& control : preset.controls) {
    if (std::string message = misfit(network, preset, control); !message.empty()) {
      found.push_back({std::move(message), control.location.line, control.location.column});
    }
  }
  if (std::string message = misfit_of_bodies(network, preset); !message.empty()) {
    found.push_back(
        {std::move(message), preset.through_location.line, preset.through_location.column});
  }
  std::ranges::stable_sort(found, {}, &Error::line);
  return found;
}

}  // namespace ressort::model
