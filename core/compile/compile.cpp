#include "core/compile/compile.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <tuple>

#include "core/analysis/stability.h"
#include "core/compile/cull.h"
#include "core/compile/machine.h"
#include "core/compile/memory.h"
#include "core/compile/merge.h"
#include "core/compile/rest_bound.h"
#include "core/kernels/passive.h"
#include "core/model/preset/fit.h"
#include "core/model/topology.h"

namespace ressort {
namespace {

constexpr double to_spare = 0.98;  // of the stiffness that keys may use: higher, modes hardly decay
// What may sleep whatever else sounds: -120 dBFS.
constexpr double inaudible_level = 1e-6;

// Of what fits the network.
Control make_control(const Network& network, const ControlSetting& setting) {
  static constexpr Source sources[] = {Source::note, Source::controller, Source::pressure,
                                       Source::custom, Source::audio};
  Control control;
  control.source = sources[static_cast<std::size_t>(setting.source)];
  control.gesture = setting.gesture;
  control.number = static_cast<std::uint16_t>(
      setting.source == ControlSource::audio ? setting.number - 1 : setting.number);
  control.lowest_key = static_cast<std::uint8_t>(setting.lowest_key);
  control.highest_key = static_cast<std::uint8_t>(setting.highest_key);
  control.low = setting.low;
  control.high = setting.high;
  control.exponential = setting.exponential;
  control.travel = setting.travel;
  control.target = static_cast<std::uint16_t>(control.gesture == Gesture::parameter
                                                  ? find_parameter(network, setting.target)
                                                  : find_input(network, setting.target));
  return control;
}

// What the parameters may be turned to: the preset's ranges; without one, a generous one. The bare
// network is research: there anything goes.
std::vector<ParameterInfo> parameter_infos(const Network& network, const Preset& preset,
                                           bool bare) {
  std::vector<ParameterInfo> infos;
  for (const Parameter& parameter : network.parameters) {
    const double reach = bare                     ? std::numeric_limits<double>::max()
                         : parameter.value == 0.0 ? 1.0
                                                  : 4.0 * std::fabs(parameter.value);
    const double least = bare || parameter.value < 0.0 ? -reach : 0.0;
    infos.push_back({.name = parameter.name,
                     .value = parameter.value,
                     .minimum = least,
                     .maximum = reach,
                     .audio_input = parameter.audio_input});
  }
  if (bare) {
    return infos;
  }
  for (const Mass& mass : network.masses) {
    if (mass.mass != no_argument && network.arguments[mass.mass].size() == 1 &&
        network.arguments[mass.mass][0].op == Op::parameter) {
      ParameterInfo& info = infos[network.arguments[mass.mass][0].index];
      info.minimum = 0.25 * info.value;  // nothing may become weightless
    }
  }
  for (const ParameterSetting& setting : preset.parameters) {
    ParameterInfo& info = infos[static_cast<std::size_t>(find_parameter(network, setting.name))];
    info.value = setting.value;
    info.minimum = setting.minimum;
    info.maximum = setting.maximum;
  }
  return infos;
}

std::vector<double> start_values(const Network& network, const Preset& preset,
                                 const CompileOptions& options) {
  std::vector<double> values = parameter_values(network);
  const auto set = [&](std::string_view name, double value) {
    if (const int index = find_parameter(network, name); index >= 0) {
      values[static_cast<std::size_t>(index)] = value;
    }
  };
  if (!options.bare) {
    for (const ParameterSetting& setting : preset.parameters) {
      set(setting.name, setting.value);
    }
    return values;
  }
  for (const Setting& setting : options.settings) {
    set(setting.parameter, setting.value);
  }
  return values;
}

// The frequency at which a mode's stiffness has grown by `factor`.
double frequency_of(const Mode& mode, double factor, double rate_ratio, double rate_hz) {
  const double k = mode.stiffness * rate_ratio * rate_ratio * factor;
  const double z = std::clamp(mode.damping * rate_ratio, 0.0, 0.999);
  const double cosine = (2.0 - k - z) / (2.0 * std::sqrt(1.0 - z));
  return rate_hz / (2.0 * std::numbers::pi) * std::acos(std::clamp(cosine, -1.0, 1.0));
}

InputInfo input_info(const Network& network, std::size_t index, const Playing& playing) {
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
  for (const Control& control : playing.controls) {
    if (control.target == index && control.gesture != Gesture::parameter) {
      info.gestures.push_back(control.gesture);
    }
  }
  return info;
}

// The gain at which a forte note peaks at -6 dBFS, found by playing one: what a model that comes
// without a preset is played with. 1 where notes excite nothing. Bounded to about 4 million steps
// of a mass; nothing where even the beginning of a note might take seconds.
std::optional<double> comfortable_gain(const Machine& machine, const Playing& playing,
                                       const CompileOptions& options) {
  constexpr double forte = 0.8;
  constexpr double wanted_peak = 0.5;
  constexpr double most_steps = 4e6;
  constexpr double most_steps_at_worst = 1e9;
  constexpr double most_steps_of_block = 4e6;
  constexpr double steps_of_shared_link = 200.0;  // passive ones are solved together, by Newton
  Playing plain = playing;
  plain.gain = 1.0;
  plain.voices = 1;
  double steps = 1.0;  // of a sample
  double at_worst = 1.0;
  for (const Program& program : machine.parts) {
    at_worst += worst_steps(program);
    steps += program.moving;
    for (const PassiveLink& link : passive_links(program)) {
      steps += link.is_shared ? steps_of_shared_link : 1.0;
    }
  }
  const double least = 0.05 * options.rate_hz;
  const double most = std::min(options.rate_hz, most_steps_at_worst / at_worst);
  if (most < least) {
    return std::nullopt;
  }
  Engine engine(machine, plain, options.precision, options.isa, options.progress);
  const auto frames = static_cast<std::size_t>(std::clamp(most_steps / steps, least, most));
  const auto block =
      static_cast<std::size_t>(std::clamp(most_steps_of_block / at_worst, 1.0, 256.0));
  std::vector<std::vector<double>> channels(machine.channels, std::vector<double>(block));
  std::vector<double*> outputs;
  for (std::vector<double>& channel : channels) {
    outputs.push_back(channel.data());
  }
  const Event note{.kind = EventKind::note_on, .index = 60, .value = forte};
  double peak = 0.0;
  for (std::size_t at = 0; at < frames; at += block) {
    options.progress.spend(static_cast<std::size_t>(static_cast<double>(block) * at_worst));
    engine.process({&note, at == 0 ? std::size_t{1} : std::size_t{0}}, {}, outputs, block);
    for (const std::vector<double>& channel : channels) {
      for (const double sample : channel) {
        peak = std::max(peak, std::fabs(sample));
      }
    }
  }
  return peak > 1e-12 ? wanted_peak / peak : 1.0;
}

std::string in_bytes(std::uint64_t bytes) {
  char text[32];
  const double mega = static_cast<double>(bytes) / 1e6;
  std::snprintf(text, sizeof text, mega < 1e3 ? "%.0f MB" : "%.1f GB",
                mega < 1e3 ? mega : mega / 1e3);
  return text;
}

// Said before the memory is taken: afterwards it would be too late.
std::optional<Error> shortage(const Machine& machine, int voices, const CompileOptions& options) {
  const auto bytes_of = [&](int count) { return engine_bytes(machine, count, options.precision); };
  if (bytes_of(voices) <= options.most_bytes) {
    return std::nullopt;
  }
  int fitting = voices;
  while (fitting > 0 && bytes_of(fitting) > options.most_bytes) {
    --fitting;
  }
  std::size_t masses = 0;
  for (const Program& program : machine.parts) {
    masses += program.moving;
  }
  return Error{std::to_string(voices) + (voices == 1 ? " voice" : " voices") + " of " +
               std::to_string(masses) + " masses would take " + in_bytes(bytes_of(voices)) +
               " of memory, and there are " + in_bytes(options.most_bytes) + "; " +
               (fitting > 0 ? "lower the voices to " + std::to_string(fitting)
                            : std::string("use a smaller model"))};
}

// The bare network is computed as it is written, unless somebody says how far off it may be.
bool may_merge(const CompileOptions& options, const Budget& budget) {
  return !options.bare || budget != Budget{};
}

// The lowest mode, by which keys find their pitch.
void find_mode(const Network& network, const Preset& preset, const Progress& progress,
               Instrument& instrument) {
  instrument.masses =
      static_cast<std::size_t>(std::count_if(network.masses.begin(), network.masses.end(), moves));
  if (preset.keyboard && instrument.masses <= most_tuned_masses) {
    std::vector<double> values;
    for (const ParameterInfo& info : instrument.parameters) {
      values.push_back(info.value);
    }
    progress.stage("finding its lowest mode");
    instrument.mode = lowest_mode(network, values, progress);
  }
}

// By what the parameters may be turned to, and by the stiffness of the highest key there is.
Schemes schemes_of(const Network& network, const Preset& preset, const CompileOptions& options,
                   const Budget& budget, const Instrument& instrument) {
  constexpr double highest_key_hz = 4186.0;
  const Budget unasked{.passive = Passivity::never};
  const bool is_asked = options.budget || !options.bare;
  Conditions conditions{
      .box = {},
      .rate_ratio = options.rescale ? Network::reference_rate_hz / options.rate_hz : 1.0};
  for (const ParameterInfo& info : instrument.parameters) {
    conditions.box.lowest.push_back(options.bare ? info.value : info.minimum);
    conditions.box.highest.push_back(options.bare ? info.value : info.maximum);
  }
  if (instrument.mode && !options.bare) {
    const double octaves = highest_key_hz / instrument.mode->frequency_hz;
    const double most = highest_stiffness_factor(network, preset_box(instrument.parameters, preset),
                                                 conditions.rate_ratio);
    conditions.stiffness_factor =
        std::max(1.0, std::min(most, octaves * octaves * std::exp2(preset.transpose / 6.0)));
  }
  return choose_schemes(network, preset, conditions, is_asked ? budget : unasked,
                        options.passive_links, options.progress);
}

}  // namespace

ParameterBox preset_box(const std::vector<ParameterInfo>& parameters, const Preset& preset) {
  ParameterBox box;
  for (const ParameterInfo& info : parameters) {
    const auto given =
        std::find_if(preset.parameters.begin(), preset.parameters.end(),
                     [&](const ParameterSetting& setting) { return setting.name == info.name; });
    const bool is_given = given != preset.parameters.end();
    box.lowest.push_back(is_given ? given->minimum : info.value);
    box.highest.push_back(is_given ? given->maximum : info.value);
  }
  return box;
}

namespace {

// The same with what was narrowed.
ParameterBox proved_box(const std::vector<ParameterInfo>& parameters, const Preset& preset) {
  ParameterBox box = preset_box(parameters, preset);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    box.lowest[i] = std::max(box.lowest[i], parameters[i].minimum);
    box.highest[i] = std::min(box.highest[i], parameters[i].maximum);
  }
  return box;
}

// Finds factors up to which all that there is stays stable, plucks, bows and contacts as if always
// felt: exactly where that is quick.
class Margins {
 public:
  Margins(const Network& network, double rate_ratio, const Progress& progress)
      : network_(network), rate_ratio_(rate_ratio), progress_(progress) {
    if (network.masses.size() <= most_quick_masses) {
      stability_.emplace(network, rate_ratio, most_quick_masses, progress);
    }
  }
  double at(const ParameterBox& box) {
    progress_.spend(4 * network_.links.size());
    const double bound = highest_stiffness_factor(network_, box, rate_ratio_);
    return bound >= most_bounded || !stability_
               ? bound
               : std::min(most_bounded, stability_->stiffness_factor(box));
  }
  // The same with something to spare, which the bound has by itself.
  double for_keys(const ParameterBox& box) {
    return std::max(highest_stiffness_factor(network_, box, rate_ratio_), to_spare * at(box));
  }

 private:
  const Network& network_;
  double rate_ratio_;
  Progress progress_;
  std::optional<Stability> stability_;
};

// What keys may use of the stiffness while parameters go from where the preset has them to where
// they may go at all; where nothing limits them, that does not depend on them.
void leave_to_keys(Margins& margins, const ParameterBox& box, Playing& playing) {
  constexpr int steps = 8;
  ParameterBox far = box;
  bool may_leave = false;
  for (std::size_t i = 0; i < box.lowest.size(); ++i) {
    const Limits& limits = playing.limits[i];
    far.lowest[i] =
        std::isfinite(limits.lowest) ? std::min(limits.lowest, box.lowest[i]) : box.lowest[i];
    far.highest[i] =
        std::isfinite(limits.highest) ? std::max(limits.highest, box.highest[i]) : box.highest[i];
    may_leave |= far.lowest[i] < box.lowest[i] || far.highest[i] > box.highest[i];
    Limits home;
    home.lowest = far.lowest[i] < box.lowest[i] ? box.lowest[i] : home.lowest;
    home.highest = far.highest[i] > box.highest[i] ? box.highest[i] : home.highest;
    playing.home.push_back(home);
  }
  for (int step = 1; may_leave && step <= steps; ++step) {
    const double way = static_cast<double>(step) / steps;
    ParameterBox between = box;
    for (std::size_t i = 0; i < box.lowest.size(); ++i) {
      between.lowest[i] = std::lerp(box.lowest[i], far.lowest[i], way);
      between.highest[i] = std::lerp(box.highest[i], far.highest[i], way);
    }
    playing.away.push_back(margins.for_keys(between));
  }
}

// `written` may still have the macros that `network` has no more.
Result<Compiled> compile_expanded(const Network& written, const Network& network,
                                  const Preset& preset, const CompileOptions& options,
                                  const Budget& budget) {
  Compiled compiled;
  Instrument& instrument = compiled.instrument;
  instrument.parameters = parameter_infos(network, preset, options.bare);
  const Progress& progress = options.progress;
  find_mode(network, preset, progress, instrument);
  progress.stage("dividing it into parts");
  Schemes schemes = schemes_of(network, preset, options, budget, instrument);
  Machine machine =
      make_machine(network, options.rate_hz, options.rescale, schemes.links, progress);
  for (std::size_t i = 0; i < instrument.parameters.size(); ++i) {
    machine.parameters[i] = instrument.parameters[i].value;
  }

  Playing playing;
  for (const ControlSetting& setting : preset.controls) {
    if (setting.source == ControlSource::osc) {
      instrument.custom.push_back({setting.address, static_cast<int>(playing.controls.size())});
    }
    if (setting.source == ControlSource::audio) {
      instrument.audio_inputs = std::max(instrument.audio_inputs, setting.number);
    }
    playing.controls.push_back(make_control(network, setting));
  }
  for (const Parameter& parameter : network.parameters) {
    instrument.audio_inputs = std::max(instrument.audio_inputs, parameter.audio_input);
  }
  playing.voices = options.voices > 0 ? options.voices : preset.voices;
  playing.gain = preset.gain;
  playing.bare = options.bare;
  playing.release_s = preset.release_s;
  playing.noise = preset.noise;
  playing.transpose = preset.transpose;
  progress.stage("proving that it is stable");
  compiled.stability = check_stability({.written = written,
                                        .expanded = network,
                                        .preset = preset,
                                        .rate_hz = machine.rate_hz,
                                        .rate_ratio = machine.rate_ratio,
                                        .bare = options.bare,
                                        .is_open = options.force,
                                        .settings = options.settings,
                                        .reach = options.reach,
                                        .progress = progress},
                                       instrument.parameters);
  instrument.verdict = compiled.stability.verdict;
  for (const Range& limit : compiled.stability.limits) {
    playing.limits.push_back({limit.lowest, limit.highest});
  }
  const ParameterBox proved = proved_box(instrument.parameters, preset);
  const bool is_plain = all_plain(schemes.links);
  const Network felt = is_plain ? Network{} : always_felt(network, schemes.links);
  Margins margins(is_plain ? network : felt, machine.rate_ratio, progress);
  instrument.stiffness_margin = margins.at(proved);
  playing.highest_factor = margins.for_keys(proved);
  if (!options.bare) {
    leave_to_keys(margins, proved, playing);
  }
  if (!options.bare && playing.highest_factor >= 1.0) {
    playing.rest_bounds = make_rest_bounds(network, machine, proved, progress);
  }
  if (instrument.mode) {
    playing.tuning = Tuning::keyboard;
    playing.mode_stiffness = instrument.mode->stiffness * machine.rate_ratio * machine.rate_ratio;
    playing.mode_damping = instrument.mode->damping * machine.rate_ratio;
    instrument.is_tuned = true;
    instrument.transpose = preset.transpose;
    instrument.highest_frequency_hz =
        frequency_of(*instrument.mode, std::max(1.0, playing.highest_factor), machine.rate_ratio,
                     machine.rate_hz);
  }
  for (std::size_t i = 0; i < network.inputs.size(); ++i) {
    instrument.inputs.push_back(input_info(network, i, playing));
  }
  instrument.outputs = output_count(network);
  instrument.voices = playing.voices;
  instrument.links = network.links.size();
  const bool is_published = options.bare && !options.method && !budget.is_physical() &&
                            budget.silence_db == -Budget::unlimited;
  progress.stage("finding the fastest way to compute it");
  compiled.plan = make_plan(
      machine,
      {.is_double = options.precision == Precision::float64,
       .is_compensated = options.precision == Precision::compensated32,
       .isa = options.isa,
       .voices = playing.voices,
       .highest_factor =
           playing.tuning == Tuning::keyboard ? std::max(1.0, playing.highest_factor) : 1.0,
       .executor = options.executor},
      is_published ? Method::direct : options.method, options.most_modes, budget, progress);
  compiled.plan.notes = std::move(schemes.notes);
  if (const std::string left_out = describe(cull(network)); !left_out.empty()) {
    compiled.plan.notes.push_back("left out: " + left_out);
  }
  compiled.schemes = std::move(schemes.links);
  if (compiled.stability.is_together) {
    compiled.plan.notes.push_back(
        "the limits of so many parameters of so many links were not found one by one: all ranges "
        "were narrowed alike");
  }
  if (preset.keyboard && !instrument.mode && instrument.masses > most_quick_masses) {
    compiled.plan.notes.push_back(
        "keys do not set the pitch: the lowest mode of so many masses was not found in time");
  }
  if (const auto error = shortage(machine, playing.voices, options)) {
    return *error;
  }
  if (options.find_gain) {
    progress.stage("finding its gain");
    if (const auto gain = comfortable_gain(machine, playing, options)) {
      playing.gain *= *gain;
    } else {
      compiled.plan.notes.push_back(
          "its gain was not looked for, as a note of so large a network takes too long to try; -g "
          "sets it");
    }
  }
  instrument.gain = playing.gain;
  for (Program& program : machine.parts) {
    if (Modes* const modes = std::get_if<Modes>(&program.form)) {
      modes->quiet = inaudible_level / std::max(1e-30, playing.gain);
    }
  }
  progress.stage("making its voices");
  compiled.engine = std::make_unique<Engine>(std::move(machine), std::move(playing),
                                             options.precision, options.isa, progress);
  return compiled;
}

Result<Compiled> compile_whole(const Network& network, const Preset& preset,
                               const CompileOptions& options) {
  options.progress.stage("putting it together");
  if (auto wrong = misfits(network, preset); !wrong.empty()) {
    return std::move(wrong.front());
  }
  const double rate_ratio = options.rescale ? Network::reference_rate_hz / options.rate_hz : 1.0;
  if (auto error = no_number(network, start_values(network, preset, options), rate_ratio)) {
    return *std::move(error);
  }
  const std::optional<Network> expanded =
      network.macros.empty() ? std::nullopt
                             : std::optional(expand_macros(network, options.progress));
  const Network& whole = expanded ? *expanded : network;
  options.progress.spend(8 * whole.links.size());
  const Budget budget = options.budget.value_or(preset.budget);
  const auto merged =
      may_merge(options, budget) ? merge(whole, budget, options.progress) : std::nullopt;
  if (!merged) {
    return compile_expanded(network, whole, preset, options, budget);
  }
  auto compiled = compile_expanded(merged->network, merged->network, preset, options, budget);
  if (compiled) {
    compiled->plan.notes.push_back("merged: " + describe(*merged));
  }
  return compiled;
}

}  // namespace

Result<Compiled> compile(const Network& network, const Preset& preset,
                         const CompileOptions& options) {
  try {
    return compile_whole(network, preset, options);
  } catch (const Stopped&) {
    return Error{stopped};
  }
}

}  // namespace ressort
