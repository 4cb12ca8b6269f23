#include "core/compile/compile.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "core/compile/accuracy/grip.h"
#include "core/compile/accuracy/loaded_waveguide.h"
#include "core/compile/accuracy/pitches.h"
#include "core/compile/accuracy/waveguide_pitch.h"
#include "core/compile/cull.h"
#include "core/compile/make_engine.h"
#include "core/compile/merge.h"
#include "core/compile/rest_bound.h"
#include "core/kernels/domains/executor.h"
#include "core/model/language/expression.h"
#include "core/model/number_check.h"
#include "core/model/preset/fit.h"
#include "core/model/topology.h"

namespace ressort::compile {
namespace {

// What is asked for, throughout.
struct Request {
  const Network& written;
  const Preset& preset;
  const CompileOptions& options;
  Budget budget = options.budget.value_or(preset.budget);
  double rate_ratio = rate_ratio_of(options.rate_hz, options.rescale);
  int voices = options.voices > 0 ? options.voices : preset.voices;
};

struct Reduced {
  Network network;     // without macros
  std::string merged;  // what was merged, in words; empty: nothing
  double cents = 0.0;  // that partials are off for that, at most
};

// Unless something is asked for, the bare network is the published scheme to the bit.
bool is_published(const Request& request) {
  const CompileOptions& options = request.options;
  return options.bare && (!options.method || *options.method == Method::direct) &&
         !request.budget.is_physical() && request.budget.silence_db == -Budget::unlimited;
}

// The bare network is computed as it is written, unless somebody says how far off it may be. O(n).
Reduced reduce(const Request& request) {
  const CompileOptions& options = request.options;
  Network whole = expand_macros(request.written, options.progress);
  options.progress.spend(8 * whole.links.size());
  if (!options.bare || request.budget != Budget{}) {
    if (auto merged = merge(whole, request.budget, options.progress)) {
      return {std::move(merged->network), describe(*merged), merged->cents};
    }
  }
  return {std::move(whole), {}};
}

// The lowest mode, or which the preset names, by which keys find their pitch; nothing where they
// are not to.
std::optional<LowestShapes> find_shapes(const Request& request, const Network& network,
                                        std::span<const double> values) {
  if (!request.preset.keyboard || moving_count(network) > most_tuned_masses) {
    return std::nullopt;
  }
  request.options.progress.stage("finding its lowest mode");
  if (!network.waveguides.empty()) {
    return waveguide_shapes(network, values);
  }
  return lowest_shapes(network, values, request.options.progress, request.preset.pitch_mode);
}

// Where it is stable: at the start, in all ranges, for keys; and what of it comes to rest.
Analysis prove(const Request& request, const Reduced& reduced, const Machine& machine,
               const Schemes& schemes, const std::vector<ParameterInfo>& asked,
               std::span<const double> start, const std::optional<Mode>& mode) {
  const CompileOptions& options = request.options;
  const Network& network = reduced.network;
  options.progress.stage("proving that it is stable");
  StabilityCheck stability =
      check_stability({.written = reduced.merged.empty() ? request.written : network,
                       .expanded = network,
                       .preset = request.preset,
                       .parameters = asked,
                       .schemes = schemes.links,
                       .start = start,
                       .rate_hz = options.rate_hz,
                       .rate_ratio = request.rate_ratio,
                       .bare = options.bare,
                       .is_open = options.force,
                       .reach = options.reach,
                       .progress = options.progress});
  const ParameterBox box = proved_box(stability, request.preset);
  Margins margins = find_margins(network, schemes.links, box,
                                 options.bare ? std::span<const Limits>() : stability.limits,
                                 request.rate_ratio, options.progress);
  margins.keys = std::min(margins.keys, highest_waveguide_factor(network, box, options.rate_hz));
  for (double& factor : margins.away) {
    factor = std::min(factor, margins.keys);
  }
  auto rest_bounds = !options.bare && margins.keys >= 1.0 && network.waveguides.empty()
                         ? make_rest_bounds(network, machine, box, options.progress)
                         : std::vector<std::optional<RestBound>>();
  return {mode, {}, {}, std::move(stability), std::move(margins), std::move(rest_bounds)};
}

// How far merging has brought partials off: by their poles, or where there are too many masses as
// merge() says, of a decay as of a pitch by the share of mass that a neighbour lacks.
Accuracy spent_on_merging(const Request& request, const Reduced& reduced, const Machine& machine) {
  if (!(reduced.cents > 0.0)) {
    return {};
  }
  const CompileOptions& options = request.options;
  const Network whole = expand_macros(request.written, options.progress);
  const Machine written = tabulate(whole, cull(whole, options.progress), {}, machine.parameters,
                                   options.rate_hz, options.rescale, options.progress);
  const Accuracy found = merging_accuracy(written, machine, options.most_modes, options.progress);
  return found.is_known ? found
                        : Accuracy{.cents = reduced.cents,
                                   .t60_percent = 100.0 * (std::exp2(reduced.cents / 600.0) - 1.0),
                                   .is_bound = true};
}

// A budget of pitch and decay holds in the ranges of the parameters and for every key; of the bare
// network, at the values that parameters are to get.
Promise make_promise(const Request& request, const Reduced& reduced, const Machine& machine,
                     const Analysis& analysis, std::span<const double> start) {
  if (!request.budget.is_physical()) {
    return {};
  }
  Promise promise{.highest_factor = analysis.mode ? std::max(1.0, analysis.margins.keys) : 1.0,
                  .merged = spent_on_merging(request, reduced, machine)};
  for (std::size_t i = 0; i < start.size(); ++i) {
    const ParameterInfo& info = analysis.stability.parameters[i];
    promise.lowest.push_back(request.options.bare ? start[i] : info.minimum);
    promise.highest.push_back(request.options.bare ? start[i] : info.maximum);
    for (const Setting& setting : request.options.reach) {
      if (request.options.bare && setting.parameter == info.name) {
        promise.lowest[i] = std::min(promise.lowest[i], setting.value);
        promise.highest[i] = std::max(promise.highest[i], setting.value);
      }
    }
  }
  return promise;
}

// By how much keys would have every stiffness grow: as exact modes need it, if the published scheme
// cannot do the highest of them; else what that bears.
double wanted_factor(const Request& request, const Analysis& analysis, bool has_waveguides) {
  constexpr int highest_of_a_piano = 108;
  constexpr double highest_share = 0.45;  // of the rate: what is higher is no tone any more
  const double borne = analysis.mode ? std::max(1.0, analysis.margins.keys) : 1.0;
  if (!analysis.mode || request.options.bare || analysis.margins.keys <= 0.0 || has_waveguides) {
    return borne;
  }
  int highest = 0;
  for (const ControlSetting& control : request.preset.controls) {
    if (control.source == ControlSource::note) {
      highest = std::max(highest, std::min(control.highest_key, highest_of_a_piano));
    }
  }
  const double hz =
      request.preset.a4_hz * std::exp2((highest + request.preset.transpose - 69) / 12.0);
  const double angle =
      2.0 * std::numbers::pi * std::min(hz / request.options.rate_hz, highest_share);
  const double stiffness = analysis.mode->stiffness * request.rate_ratio * request.rate_ratio;
  const double swing = 2.0 * std::sin(0.5 * angle);
  return swing * swing / stiffness <= borne ? borne : angle * angle / stiffness;
}

Workload workload_of(const Request& request) {
  const CompileOptions& options = request.options;
  return {.is_double = options.precision == Precision::float64,
          .isa = options.isa,
          .voices = request.voices,
          .is_untuned = options.bare,
          .executor = options.executor};
}

Planned find_forms(const Request& request, Machine machine, const Analysis& analysis,
                   const Promise& promise) {
  const CompileOptions& options = request.options;
  const bool has_waveguides =
      std::any_of(machine.parts.begin(), machine.parts.end(),
                  [](const Program& program) { return !program.waveguides.empty(); });
  options.progress.stage("finding the fastest way to compute it");
  Workload load = workload_of(request);
  load.highest_factor = analysis.mode ? std::max(1.0, analysis.margins.keys) : 1.0;
  load.wanted_factor = wanted_factor(request, analysis, has_waveguides);
  return make_plan(std::move(machine), load,
                   is_published(request) ? Method::direct : options.method, options.most_modes,
                   request.budget, options.progress, promise);
}

Pitches find_pitches(const Request& request, const Network& network, const Machine& machine,
                     const LowestShapes& shapes, std::vector<std::string>& notes) {
  if (network.waveguides.empty()) {
    return make_pitches(shapes, stepping_of_lowest(machine, shapes), request.options.rate_hz,
                        request.rate_ratio);
  }
  if (auto loaded =
          loaded_waveguide_pitches(machine, machine.parameters, request.options.progress)) {
    return *std::move(loaded);
  }
  notes.push_back(
      "keys tune the waveguide as if nothing held it: it hangs together with more than " +
      std::to_string(most_loading_springs) + " springs");
  return make_pitches(shapes, {.scheme = Stepping::Scheme::exact}, request.options.rate_hz,
                      request.rate_ratio);
}

// With what the sound is flat of its lowest mode made up for.
Pitches sharpened(const Pitches& pitches, const Preset& preset) {
  if (preset.flattening_cents.empty()) {
    return pitches;
  }
  Pitches sharp = pitches;
  for (std::size_t i = 0; i < sharp.factors.size(); ++i) {
    const double hz = pitches.lowest_hz * std::exp2(static_cast<double>(i) / 12.0);
    const double key = 69.0 + 12.0 * std::log2(hz / usual_a4_hz) - preset.transpose;
    sharp.factors[i] =
        pitches.factor_at(hz * std::exp2(value_at(preset.flattening_cents, key) / 1200.0));
  }
  return sharp;
}

// Along which parameter keys are to stay in tune, and how far that goes; without pitches.
std::optional<PitchesAlong> tuned_along(const Request& request, const Network& network) {
  const Preset& preset = request.preset;
  const std::string& name = preset.morph.empty() ? preset.tuned_along : preset.morph_parameter;
  const int parameter = find_parameter(network, name);
  if (parameter < 0 || request.options.bare) {
    return std::nullopt;
  }
  PitchesAlong along{.parameter = static_cast<std::size_t>(parameter)};
  for (const ParameterSetting& setting : preset.parameters) {
    if (setting.name == name && preset.morph.empty()) {
      along.lowest = setting.minimum;
      along.highest = setting.maximum;
      along.by_ratios = is_wide(setting.minimum, setting.maximum);
    }
  }
  if (!preset.morph.empty()) {
    along.legs = preset.morph.size() - 1;
    along.highest = static_cast<double>(preset.morph.size());
  }
  return along.lowest < along.highest ? std::optional(along) : std::nullopt;
}

// In as many steps as cubics need to hit the pitches between them, or the most.
PitchesAlong find_pitches_along(const Request& request, const Network& network, Machine& machine) {
  constexpr double in_tune = 1e-5;  // of a logarithm: 0.01 cents
  constexpr std::size_t most_steps = 64;
  std::optional<PitchesAlong> along = tuned_along(request, network);
  if (!along) {
    return {};
  }
  request.options.progress.stage("tuning it wherever " + network.parameters[along->parameter].name +
                                 " is");
  const std::vector<double> start = machine.parameters;
  std::vector<std::string> notes;
  bool is_found = true;
  const auto add = [&](PitchesAlong& to) {
    machine.parameters[to.parameter] = to.value_at(to.at.size());
    const auto shapes = find_shapes(request, network, machine.parameters);
    is_found = is_found && shapes;
    to.at.push_back(
        shapes ? sharpened(find_pitches(request, network, machine, *shapes, notes), request.preset)
               : Pitches());
  };
  while (along->at.size() <= along->legs * along->steps) {
    add(*along);
  }
  for (bool is_near = false; is_found && !is_near && along->steps < most_steps;) {
    PitchesAlong finer = *along;
    finer.steps *= 2;
    finer.at.clear();
    is_near = true;
    for (std::size_t i = 0; i <= finer.legs * finer.steps; ++i) {
      if (i % 2 == 0) {
        finer.at.push_back(along->at[i / 2]);
        continue;
      }
      add(finer);
      for (const double hz : {27.5, 261.6, 2093.0}) {
        const double off =
            std::log(finer.at.back().factor_at(hz) / along->factor_at(hz, finer.value_at(i)));
        is_near = is_near && std::fabs(off) < in_tune;
      }
    }
    along = std::move(finer);
  }
  machine.parameters = start;
  return is_found ? *std::move(along) : PitchesAlong();
}

// What keys may use of the stiffness, once it is known what plays them: what rings above 0.456 of
// the rate is no tone any more.
void reach(Analysis& analysis, double more, double rate_hz) {
  if (more > 1.0) {
    const double highest = analysis.pitches.factor_at(0.456 * rate_hz);
    analysis.margins.keys = std::min(more * analysis.margins.keys, highest);
    for (double& factor : analysis.margins.away) {
      factor = std::min(more * factor, highest);
    }
  }
}

// Why keys that are to set the pitch do not; empty where that is no surprise.
std::string missed_mode(const Network& network, const Preset& preset) {
  const std::size_t masses = moving_count(network);
  if (masses > most_quick_masses) {
    return "the lowest mode of so many masses was not found in time";
  }
  if (!network.waveguides.empty()) {
    return "every waveguide is fixed";
  }
  return preset.pitch_mode > 1 ? "there is no mode " + std::to_string(preset.pitch_mode) : "";
}

// Which bow is too strong as it starts; and from which pitch on the strongest is, anywhere in its
// ranges.
struct Grip {
  std::optional<Error> strong;
  std::string note;
};
Grip find_grip(const Request& request, const Network& network, const Schemes& schemes,
               const Machine& machine, const Analysis& analysis, std::span<const double> start) {
  const std::vector<double> values(start.begin(), start.end());
  const auto strongest_in = [&](const ParameterBox& box) {
    return strongest_bow(network, schemes.links, box, start, request.rate_ratio);
  };
  Grip grip;
  const double steps = steps_of_bows(machine);
  if (const auto bow = strongest_in({values, values})) {
    grip.strong = too_strong(*bow, steps, request.options.rate_hz);
  }
  const auto bow = grip.strong || !analysis.mode
                       ? std::nullopt
                       : strongest_in(proved_box(analysis.stability, request.preset));
  const double factor = bow ? too_strong_from(*bow, steps) : Budget::unlimited;
  if (factor < analysis.margins.keys) {
    const double hz = analysis.pitches.frequency_at(factor);
    grip.note = "at its strongest the bow '" + bow->name + "' lets go a little early in notes " +
                "above " + print_number(std::floor(hz)) + " Hz";
  }
  return grip;
}

// What a person should know of how it is computed, beside how its parts are.
std::vector<std::string> make_notes(const Schemes& schemes, const Culled& culled,
                                    const Analysis& analysis, const std::string& missed_mode,
                                    bool misses_gain, const std::string& merged) {
  std::vector<std::string> notes = schemes.notes;
  if (const std::string left_out = describe(culled); !left_out.empty()) {
    notes.push_back("left out: " + left_out);
  }
  if (analysis.stability.is_together) {
    notes.emplace_back(
        "the limits of so many parameters of so many links were not found one by one: all ranges "
        "were narrowed alike");
  }
  if (!missed_mode.empty()) {
    notes.push_back("keys do not set the pitch: " + missed_mode);
  }
  if (misses_gain) {
    notes.emplace_back(
        "its gain was not looked for, as a note of so large a network takes too long to try; -g "
        "sets it");
  }
  if (!merged.empty()) {
    notes.push_back("merged: " + merged);
  }
  return notes;
}

Result<Compiled> compile_by_stages(const Request& request) {
  const Network& written = request.written;
  const Preset& preset = request.preset;
  const CompileOptions& options = request.options;
  const double rate_ratio = request.rate_ratio;
  const int voices = request.voices;
  const Progress& progress = options.progress;
  progress.stage("putting it together");
  if (auto wrong = misfits(written, preset); !wrong.empty()) {
    return std::move(wrong.front());
  }
  const Reduced reduced = reduce(request);
  const Network& network = reduced.network;
  const std::vector<ParameterInfo> asked = asked_ranges(network, preset, options.bare);
  const std::vector<double> values = start_values(asked, {}, options.bare);
  const std::vector<double> start = start_values(asked, options.settings, options.bare);
  if (auto error = no_number(written, start, rate_ratio)) {
    return *std::move(error);
  }
  if (auto error = waveguide_too_high(network, start, options.rate_hz)) {
    return *std::move(error);
  }
  const std::optional<LowestShapes> shapes = find_shapes(request, network, values);
  const std::optional<Mode> mode = shapes ? std::optional(shapes->mode) : std::nullopt;
  progress.stage("dividing it into parts");
  // The bare network is the published scheme, unless somebody asks.
  const bool is_as_published = options.bare && !options.budget;
  const Schemes schemes = choose_schemes(
      network, is_as_published ? Budget{.passive = Passivity::never} : request.budget, progress);
  const Culled culled = cull(network, progress);
  Machine machine =
      tabulate(network, culled, schemes.links, values, options.rate_hz, options.rescale, progress);
  Analysis analysis = prove(request, reduced, machine, schemes, asked, start, mode);
  const Promise promise = make_promise(request, reduced, machine, analysis, start);
  Planned planned = find_forms(request, std::move(machine), analysis, promise);
  std::vector<std::string> pitch_notes;
  if (shapes) {
    analysis.pitches =
        sharpened(find_pitches(request, network, planned.machine, *shapes, pitch_notes), preset);
    analysis.along = find_pitches_along(request, network, planned.machine);
    reach(analysis, planned.more, options.rate_hz);
  }
  if (auto error = shortage(planned.machine, voices, options.precision, options.executor,
                            options.most_bytes)) {
    return *std::move(error);
  }
  const auto played_by = [&](int count, double gain) {
    Playing playing = make_playing(network, preset, analysis, options.bare, count, gain);
    playing.share = options.share;
    return playing;
  };
  std::optional<double> factor = 1.0;
  if (options.find_gain) {
    progress.stage("finding its gain");
    factor =
        find_gain(planned.machine, played_by(1, 1.0), options.precision, options.isa, progress);
  }
  const double gain = preset.gain * factor.value_or(1.0);
  std::vector<std::string> notes = make_notes(
      schemes, culled, analysis, preset.keyboard && !mode ? missed_mode(network, preset) : "",
      !factor, reduced.merged);
  notes.insert(notes.end(), pitch_notes.begin(), pitch_notes.end());
  Grip grip = find_grip(request, network, schemes, planned.machine, analysis, start);
  if (!grip.note.empty()) {
    notes.push_back(std::move(grip.note));
  }
  progress.stage("making its voices");
  Instrument instrument = make_instrument(network, preset, analysis, voices, gain);
  instrument.struck = find_struck(request.written, planned.machine);
  return Compiled{.engine = make_engine(std::move(planned.machine), played_by(voices, gain),
                                        options.precision, options.isa, progress, options.executor),
                  .instrument = std::move(instrument),
                  .plan = {.parts = planned.parts,
                           .budget = request.budget,
                           .accuracy = accuracy_of(planned.parts),
                           .notes = std::move(notes)},
                  .stability = std::move(analysis.stability),
                  .schemes = schemes,
                  .strong_bow = std::move(grip.strong)};
}

}  // namespace

Result<Compiled> compile_network(const Network& network, const Preset& preset,
                                 const CompileOptions& options) {
  try {
    const Network marked = preset.fixed.empty() ? Network() : with_fixed(network, preset);
    const Network& written = preset.fixed.empty() ? network : marked;
    const Network touched = has_swings(preset) ? heard_where_touched(written, preset) : Network();
    if (touched.outputs.empty()) {
      return compile_by_stages({written, preset, options});
    }
    CompileOptions one = options;
    one.voices = 1;
    one.find_gain = true;
    const auto measured = compile_by_stages({touched, without_swings(preset), one});
    if (!measured) {
      return measured.error();
    }
    const double swing = found_gain_peak / measured->instrument.gain;
    return compile_by_stages({written, in_positions(preset, written, swing), options});
  } catch (const Stopped&) {
    return Error{stopped};
  }
}

}  // namespace ressort::compile
