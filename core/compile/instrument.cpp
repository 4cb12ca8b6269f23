#include "core/compile/instrument.h"

#include <bit>
#include <charconv>
#include <cmath>
#include <iterator>
#include <numbers>

#include "core/compile/prove.h"
#include "core/compile/tune.h"
#include "core/curve.h"
#include "core/model/preset/fit.h"
#include "core/model/topology.h"
#include "core/ranges.h"

namespace ressort::compile {
namespace {

GestureSettings settings_of(const ControlSetting& setting) {
  return {.low = setting.low,
          .high = setting.high,
          .exponential = setting.exponential,
          .travel = setting.travel,
          .has_level = setting.has_level,
          .low_db = setting.low_db,
          .high_db = setting.high_db,
          .longest_s = setting.longest_ms / 1e3,
          .shortest_s = setting.shortest_ms / 1e3,
          .follows_pitch = setting.follows_pitch,
          .low_hz = setting.low_hz,
          .high_hz = setting.high_hz,
          .roughness = setting.noise};
}

// Returns whether an input pushes a mass that no spring brings back.
bool is_thrown(const Network& network, const Input& input) {
  return input.is_force && network.masses[input.mass].kind == MassKind::mass &&
         std::ranges::none_of(network.links, [&](const Link& link) {
           return (link.a == input.mass || link.b == input.mass) &&
                  linear_part(link).stiffness != no_argument;
         });
}

Source source_of(ControlSource source) {
  static constexpr Source sources[] = {Source::note,   Source::controller, Source::pressure,
                                       Source::custom, Source::audio,      Source::release,
                                       Source::lfo};
  return sources[static_cast<std::size_t>(source)];
}

// The setting must fit the network.
Control make_control(const Network& network, const ControlSetting& setting) {
  Control control;
  control.source = source_of(setting.source);
  control.gesture = setting.gesture;
  control.number = static_cast<std::uint16_t>(
      setting.source == ControlSource::audio ? setting.number - 1 : setting.number);
  control.lowest_key = static_cast<std::uint8_t>(setting.lowest_key);
  control.highest_key = static_cast<std::uint8_t>(setting.highest_key);
  control.turn = static_cast<std::uint8_t>(setting.turn - 1);
  control.turns = static_cast<std::uint8_t>(setting.turns);
  control.settings = settings_of(setting);
  if (control.source == Source::lfo) {
    control.target = setting.target == "pitch" ? Control::pitch
                     : setting.target == "level"
                         ? Control::level
                         : static_cast<std::uint16_t>(Control::first_parameter +
                                                      find_parameter(network, setting.target));
    return control;
  }
  for (const double key : curve_keys(setting)) {
    control.by_key.push_back({key, settings_of(on_key(setting, key))});
  }
  control.target = static_cast<std::uint16_t>(control.gesture == Gesture::parameter
                                                  ? find_parameter(network, setting.target)
                                                  : find_input(network, setting.target));
  control.throws =
      control.gesture == Gesture::impulse && is_thrown(network, network.inputs[control.target]);
  return control;
}

std::vector<Control> make_controls(const Network& network, const Preset& preset) {
  return mapped(preset.controls,
                [&](const ControlSetting& setting) { return make_control(network, setting); });
}

std::vector<PlayedLfo> make_lfos(const Preset& preset) {
  std::vector<PlayedLfo> lfos;
  for (const LfoSetting& setting : preset.lfos) {
    lfos.push_back({.lfo = setting.lfo,
                    .is_scaled = setting.by.has_value(),
                    .by = source_of(setting.by.value_or(ControlSource::pressure)),
                    .number = static_cast<std::uint16_t>(setting.number)});
  }
  return lfos;
}

InputInfo input_info(const Network& network, std::size_t index,
                     const std::vector<Control>& controls) {
  const Input& input = network.inputs[index];
  InputInfo info{.number = input.number, .is_force = input.is_force};
  if (input.is_force) {
    info.attached_to = network.masses[input.mass].name;
  }
  for (const Link& link : network.links) {
    if (!input.is_force && (link.a == input.mass || link.b == input.mass)) {
      info.attached_to = network.masses[link.a == input.mass ? link.b : link.a].name;
      break;
    }
  }
  for (const Control& control : controls) {
    if (control.target == index && control.gesture != Gesture::parameter) {
      info.gestures.push_back(control.gesture);
    }
  }
  return info;
}

// Returns the highest audio channel that a control or a parameter listens to.
int audio_input_count(const Network& network, const Preset& preset) {
  int count = 0;
  for (const ControlSetting& setting : preset.controls) {
    count = std::max(count, setting.source == ControlSource::audio ? setting.number : 0);
  }
  for (const Parameter& parameter : network.parameters) {
    count = std::max(count, parameter.audio_input);
  }
  return count;
}

// Returns the force of a hard strike: the preset's largest impulse or, without one, the impulse
// that brings the output of all masses, moving together at this frequency, to half of full scale.
double find_blow(const Network& network, const std::vector<Control>& controls, double frequency_hz,
                 double gain) {
  double blow = 0.0;
  for (const Control& control : controls) {
    if (control.gesture == Gesture::impulse && network.inputs[control.target].is_force) {
      blow = std::max({blow, std::fabs(control.settings.low), std::fabs(control.settings.high)});
    }
  }
  if (blow > 0.0) {
    return blow;
  }
  const std::vector<double> parameters = parameter_values(network);
  double mass = 0.0;
  double modal_mass = 0.0;  // mass of each mode of a body
  for (const Mass& of : network.masses) {
    const double here = moves(of) ? argument_value(network, of.mass, parameters) : 0.0;
    modal_mass = of.is_mode ? std::max(modal_mass, here) : modal_mass;
    mass += of.is_mode ? 0.0 : here;
  }
  mass += modal_mass;
  for (const Macro& guide : network.waveguides) {  // impedance R per sample of the length
    mass += argument_value(network, guide.impedance, parameters) * Network::reference_rate_hz /
            2.0 / std::max(1.0, argument_value(network, guide.frequency_hz, parameters));
  }
  const double turn = 2.0 * std::numbers::pi * frequency_hz / Network::reference_rate_hz;
  return gain > 0.0 ? 0.5 * mass * turn / gain : mass * turn;
}

// Returns a coordinate with a decimal point, unlike the number of a node.
std::string coordinate_text(double value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value, std::chars_format::general, 4);
  const std::string digits(text, end.ptr);
  return digits.find_first_of(".e") == std::string::npos ? digits + ".0" : digits;
}

}  // namespace

std::string struck_name(const Network& network, std::uint32_t mass) {
  if (mass >= network.masses.size()) {
    const std::vector<std::uint32_t> starts = macro_starts(network);
    const auto macro = std::ranges::upper_bound(starts, mass) - starts.begin() - 1;
    return network.macros[static_cast<std::size_t>(macro)].name + ":" +
           std::to_string(mass - starts[static_cast<std::size_t>(macro)] + 1);
  }
  if (network.masses[mass].kind != MassKind::point) {
    return std::string(network.masses[mass].name.text());
  }
  const Tap& tap = network.taps[network.masses[mass].tap];
  const Macro& macro = network.macros[tap.macro];
  if (is_bridge(network, tap)) {
    return macro.name + ":bridge";
  }
  const std::vector<double> parameters = parameter_values(network);
  const double u = std::clamp(argument_value(network, tap.u, parameters), 0.0, 1.0);
  const double place = u * (static_cast<double>(macro.places.size()) - 1.0);
  const double nearest = std::rint(place);
  if (!macro.places.empty() && std::fabs(place - nearest) < 1e-9) {
    return macro.name + ":" + macro.places[static_cast<std::size_t>(nearest)];
  }
  return macro.name + ":" + coordinate_text(u) +
         (is_mesh(macro.kind) ? ":" + coordinate_text(std::clamp(
                                          argument_value(network, tap.v, parameters), 0.0, 1.0))
                              : "");
}

std::vector<StruckInfo> find_struck(const Network& network, const Machine& machine) {
  const std::vector<std::uint32_t> starts = macro_starts(network);
  std::vector<bool> is_played(starts.empty() ? network.masses.size()
                                             : starts.back() + node_count(network.macros.back()));
  for (const Program& program : machine.parts) {
    for (std::uint32_t node = 0; node < program.moving; ++node) {
      is_played[program.masses[node]] = true;
    }
    for (const TapSlot& tap : program.taps) {
      const std::uint32_t place = program.masses[tap.node];
      is_played[place] = place < network.masses.size();  // not the bridge of a modal string
    }
  }
  std::vector<StruckInfo> struck;
  for (std::uint32_t i = 0; i < network.masses.size(); ++i) {
    // The places of an expanded network have lost the macros that name them.
    if (is_played[i] && (network.masses[i].kind != MassKind::point || !network.macros.empty())) {
      struck.push_back({.name = struck_name(network, i), .first = i});
    }
  }
  for (std::size_t i = 0; i < network.macros.size(); ++i) {
    const Macro& macro = network.macros[i];
    const std::uint64_t count = node_count(macro);
    const auto first = is_played.begin() + starts[i];
    const auto end = first + static_cast<std::ptrdiff_t>(count);
    if (std::find(first, end, true) != end) {
      struck.push_back({macro.name, starts[i], {first, end}});
    }
  }
  const auto is_before = [](const StruckInfo& a, const StruckInfo& b) { return a.name < b.name; };
  std::ranges::stable_sort(struck, is_before);
  // Several links may end at one place.
  const auto same = [](const StruckInfo& a, const StruckInfo& b) { return a.name == b.name; };
  struck.erase(std::unique(struck.begin(), struck.end(), same), struck.end());
  return struck;
}

bool has_swings(const Preset& preset) {
  return std::ranges::any_of(preset.controls, &ControlSetting::in_swings);
}

Preset without_swings(Preset preset) {
  std::erase_if(preset.controls, [](const ControlSetting& control) { return control.in_swings; });
  for (ControlSetting& control : preset.controls) {
    control.has_level = false;  // a level scales the sound only
  }
  preset.gain = 1.0;
  preset.bodies.clear();
  return preset;
}

Preset in_positions(Preset preset, const Network& network, double swing) {
  for (ControlSetting& control : preset.controls) {
    const int input = control.in_swings ? find_input(network, control.target) : -1;
    const auto touch =
        input >= 0 ? touch_of(network, static_cast<std::size_t>(input)) : std::nullopt;
    if (touch) {
      control.low = touch->position + touch->inwards * swing * control.low;
      control.high = touch->position + touch->inwards * swing * control.high;
      control.in_swings = false;
    }
  }
  return preset;
}

KeyFrequencies key_frequencies(const Preset& preset) {
  KeyFrequencies keys = equal_temperament(preset.a4_hz, preset.transpose);
  const double ratio = preset.a4_hz / usual_a4_hz * std::exp2(preset.transpose / 12.0);
  for (std::size_t key = 0; key < std::min(keys.size(), preset.keys_hz.size()); ++key) {
    keys[key] = ratio * preset.keys_hz[key];
  }
  return keys;
}

std::vector<std::optional<VoiceCurve>> voice_curves(const Network& network, const Preset& preset,
                                                    const StabilityCheck& stability) {
  std::vector<std::optional<VoiceCurve>> curves;
  const auto add = [&](const ParameterSetting& setting) {
    const int found = find_parameter(network, setting.name);
    if (found >= 0) {
      const auto index = static_cast<std::size_t>(found);
      const ParameterInfo& info = stability.parameters[index];
      curves.resize(network.parameters.size());
      curves[index] = {.keys = setting.keys,
                       .velocity = setting.velocity,
                       .keys_at = setting.keys_at.value_or(setting.value),
                       .lowest = info.minimum,
                       .highest = info.maximum};
    }
  };
  for (const ControlSetting& control : preset.controls) {
    if (control.source == ControlSource::lfo) {
      add({.name = control.target});
    }
  }
  for (const ParameterSetting& setting : preset.parameters) {
    if (setting.has_curve()) {
      add(setting);
    }
  }
  return curves;
}

namespace {

// Returns the index of the parameter that the preset adds to the amount of blows.
std::optional<std::size_t> find_hardness(const Network& network, const Preset& preset) {
  const int found = find_parameter(network, preset.hardness);
  return found < 0 ? std::nullopt : std::optional(static_cast<std::size_t>(found));
}

// Marks the curves of parameters on which only links of thrown masses depend. These links must not
// change while the note sounds: a gap that closes on a displaced string adds energy. O(network)
void mark_curves_of_blows(const Network& network, const std::vector<Control>& controls,
                          std::vector<std::optional<VoiceCurve>>& curves) {
  std::vector<bool> is_thrown_mass(network.masses.size());
  for (const Control& control : controls) {
    if (control.throws) {
      is_thrown_mass[network.inputs[control.target].mass] = true;
    }
  }
  if (curves.empty() || std::ranges::find(is_thrown_mass, true) == is_thrown_mass.end()) {
    return;
  }
  Network rest = network;
  std::erase_if(rest.links,
                [&](const Link& link) { return is_thrown_mass[link.a] || is_thrown_mass[link.b]; });
  const std::vector<bool> is_used = used_parameters(canonical(std::move(rest)));
  for (std::size_t i = 0; i < curves.size(); ++i) {
    if (curves[i]) {
      curves[i]->is_of_blow = !is_used[i];
    }
  }
}

}  // namespace

Playing make_playing(const Network& network, const Preset& preset, const Proof& proof,
                     const TunedKeys& keys, bool bare, int voices, double gain) {
  std::vector<Control> controls = make_controls(network, preset);
  auto curves = voice_curves(network, preset, proof.stability);
  mark_curves_of_blows(network, controls, curves);
  // The range of a curve bounds its knob, too, so that no voice leaves the proved box.
  std::vector<Limits> limits = proof.stability.limits;
  for (std::size_t i = 0; i < curves.size(); ++i) {
    if (curves[i]) {
      limits[i] = {curves[i]->lowest, curves[i]->highest};
    }
  }
  return {
      .voices = voices,
      .gain = gain,
      .bare = bare,
      .damper_s = preset.damper_s,
      .damper_keys = preset.damper_keys,
      .keys_db = preset.keys_db,
      .noise = preset.noise,
      .tuning = keys.mode ? Tuning::keyboard : Tuning::fixed,
      .transpose = static_cast<double>(preset.transpose),
      .keys_hz = key_frequencies(preset),
      .velocity = {.points = preset.velocity_points, .exponent = std::exp2(-2.0 * preset.velocity)},
      .channels = static_cast<ChannelMask>(preset.channels),
      .hardness = find_hardness(network, preset),
      .mono = preset.mono,
      .legato = preset.legato,
      .glide_s = preset.glide_s,
      .pitches = keys.pitches,
      .key_pitches = keys.by_key,
      .warp = keys.warp,
      .along = keys.along,
      .highest_factor = keys.highest_factor,
      .home = proof.margins.home,
      .away = keys.away,
      .controls = std::move(controls),
      .lfos = make_lfos(preset),
      .variation = {.strength = preset.varied_strength, .timing_s = preset.varied_ms / 1e3},
      .limits = std::move(limits),
      .curves = curves,
      .rest_bounds = proof.rest_bounds};
}

namespace {

// Returns the named controllers. One that only scales an LFO has the LFO's name. Those with a usual
// meaning come first, in the same order in all presets: brightness, ring, touch, the wheel and
// space. Without any, each parameter is a control of its own name, over its range.
std::vector<KnobInfo> find_knobs(const Network& network, const Preset& preset,
                                 const std::vector<ParameterInfo>& parameters) {
  constexpr int usual[] = {74, 71, 16, 1, 91};
  std::vector<KnobInfo> knobs;
  for (const ControlSetting& named : preset.controls) {
    const auto is_same = [&](const ControlSetting& control) {
      return control.source == ControlSource::controller && control.number == named.number;
    };
    if (named.name.empty() || std::ranges::any_of(knobs, [&](const KnobInfo& knob) {
          return knob.controller == named.number;
        })) {
      continue;
    }
    const auto turns = std::ranges::find_if(preset.controls, [&](const ControlSetting& control) {
      return is_same(control) && control.gesture == Gesture::parameter;
    });
    const ControlSetting& first = turns != preset.controls.end() ? *turns : named;
    KnobInfo knob{.name = named.name,
                  .word = model::word_of(named.name),
                  .help = named.help,
                  .controller = named.number,
                  .range = {first.low, first.high, first.exponential}};
    if (first.gesture == Gesture::parameter) {
      knob.parameter = static_cast<std::size_t>(find_parameter(network, first.target));
    } else if (first.gesture == Gesture::position) {
      const Input& input =
          network.inputs[static_cast<std::size_t>(find_input(network, first.target))];
      knob.rest =
          input.is_force ? 0.0 : knob.range.position_of(network.masses[input.mass].position);
    }
    knobs.push_back(std::move(knob));
  }
  for (const LfoSetting& lfo : preset.lfos) {
    const auto is_same = [&](const KnobInfo& knob) { return knob.controller == lfo.number; };
    if (lfo.by == ControlSource::controller && std::ranges::none_of(knobs, is_same)) {
      knobs.push_back({.name = lfo.name,
                       .word = model::word_of(lfo.name),
                       .help = "Depth of the oscillation",
                       .controller = lfo.number});
    }
  }
  const bool has_names = !knobs.empty();
  for (std::size_t i = 0; !has_names && i < parameters.size(); ++i) {
    const ParameterInfo& info = parameters[i];
    if (info.audio_input == 0) {
      knobs.push_back({.name = info.name,
                       .word = info.name,
                       .help = "Parameter of the model",
                       .controller = -1,
                       .parameter = i,
                       .range = {info.minimum, info.maximum, is_wide(info.minimum, info.maximum)}});
    }
  }
  std::ranges::stable_sort(knobs, {}, [&](const KnobInfo& knob) {
    return std::ranges::find(usual, knob.controller) - std::begin(usual);
  });
  return knobs;
}

}  // namespace

Instrument make_instrument(const Network& network, const Preset& preset, const Proof& proof,
                           const TunedKeys& keys, int voices, double gain) {
  const std::vector<Control> controls = make_controls(network, preset);
  std::vector<InputInfo> inputs;
  for (std::size_t i = 0; i < network.inputs.size(); ++i) {
    inputs.push_back(input_info(network, i, controls));
  }
  std::vector<CustomInfo> custom;
  for (std::size_t i = 0; i < preset.controls.size(); ++i) {
    if (preset.controls[i].source == ControlSource::osc) {
      custom.push_back({preset.controls[i].address, static_cast<int>(i)});
    }
  }
  const std::optional<Mode>& mode = keys.mode;
  return {.parameters = proof.stability.parameters,
          .inputs = std::move(inputs),
          .custom = std::move(custom),
          .knobs = find_knobs(network, preset, proof.stability.parameters),
          .blow = find_blow(network, controls, mode ? mode->frequency_hz : 220.0, gain),
          .outputs = output_count(network),
          .audio_inputs = audio_input_count(network, preset),
          .voices = voices,
          .gain = gain,
          .masses = moving_count(network),
          .links = network.links.size(),
          .transpose = preset.transpose,
          .a4_hz = preset.a4_hz,
          .channel = static_cast<std::uint8_t>(std::countr_zero(preset.channels)),
          .mode = mode,
          .highest_frequency_hz =
              mode ? keys.pitches.frequency_at(std::max(1.0, keys.highest_factor)) : 0.0,
          .stiffness_margin = proof.margins.whole,
          .verdict = proof.stability.verdict};
}

}  // namespace ressort::compile
