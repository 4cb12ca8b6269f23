#include "core/compile/compile.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "core/compile/accuracy/bow_limit.h"
#include "core/compile/analyse.h"
#include "core/compile/bodies.h"
#include "core/compile/cull.h"
#include "core/compile/make_engine.h"
#include "core/compile/prove.h"
#include "core/compile/reduce.h"
#include "core/compile/tune.h"
#include "core/model/language/expression.h"
#include "core/model/preset/fit.h"

namespace ressort::compile {
namespace {

// Returns the region where a budget of pitch and decay has to hold: the ranges of the parameters
// and every key or, for a bare network, the values that its parameters will get.
BudgetRegion make_budget_region(const CompileRequest& request, const Analysis& analysis,
                                const Proof& proof) {
  if (!request.budget.is_physical()) {
    return {};
  }
  BudgetRegion region{.highest_factor = analysis.shapes ? std::max(1.0, proof.margins.keys) : 1.0};
  const std::vector<double>& start = analysis.start;
  for (std::size_t i = 0; i < start.size(); ++i) {
    const ParameterInfo& info = proof.stability.parameters[i];
    region.lowest.push_back(request.options.bare ? start[i] : info.minimum);
    region.highest.push_back(request.options.bare ? start[i] : info.maximum);
    for (const Setting& setting : request.options.reach) {
      if (request.options.bare && setting.parameter == info.name) {
        region.lowest[i] = std::min(region.lowest[i], setting.value);
        region.highest[i] = std::max(region.highest[i], setting.value);
      }
    }
  }
  return region;
}

// Returns the factor on every stiffness that the highest key requires: the factor of exact modes if
// the published scheme cannot reach that key, otherwise `stable`, which is the highest stable
// factor.
double wanted_factor(const CompileRequest& request, const Mode& mode, double stable) {
  constexpr int highest_of_a_piano = 108;
  constexpr double highest_share = 0.45;  // fraction of the sample rate
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
  const double stiffness = mode.stiffness * request.rate_ratio * request.rate_ratio;
  // The published scheme plays a mode of K/M = (2 sin(angle / 2))^2 at this angle per sample, and
  // exact modes one of angle^2.
  const double swing = 2.0 * std::sin(0.5 * angle);
  return swing * swing / stiffness <= stable ? stable : angle * angle / stiffness;
}

// Chooses a form for every part of the machine.
Planned plan(const CompileRequest& request, const Analysis& analysis, const Proof& proof,
             Machine machine) {
  const CompileOptions& options = request.options;
  const bool has_waveguides = std::ranges::any_of(
      machine.parts, [](const Program& program) { return !program.waveguides.empty(); });
  options.progress.stage("finding the fastest way to compute it");
  const double stable = analysis.shapes ? std::max(1.0, proof.margins.keys) : 1.0;
  const bool may_reach =
      analysis.shapes && !options.bare && proof.margins.keys > 0.0 && !has_waveguides;
  const Workload load{
      .is_double = request.precision == Precision::float64,
      .isa = options.isa,
      .voices = request.voices,
      .highest_factor = stable,
      .wanted_factor = may_reach ? wanted_factor(request, analysis.shapes->mode, stable) : stable,
      .is_untuned = options.bare};
  return make_plan(std::move(machine), load,
                   request.is_published() ? Method::direct : options.method, options.most_modes,
                   request.budget, options.progress, make_budget_region(request, analysis, proof),
                   {.timings = options.timings, .forms = options.forms});
}

struct BowCheck {
  std::optional<Error> error;  // a bow that is too strong at the start values
  std::string note;            // the pitch above which the strongest bow is too strong
};
BowCheck check_bows(const CompileRequest& request, const Network& network, const Schemes& schemes,
                    const Analysis& analysis, const Proof& proof, const Machine& machine,
                    const TunedKeys& keys) {
  const std::vector<double>& start = analysis.start;
  const auto strongest_in = [&](const ParameterBox& box) {
    return find_strongest_bow(network, schemes.links, box, start, request.rate_ratio);
  };
  BowCheck check;
  const double steps = bow_steps_per_sample(machine);
  if (const auto bow = strongest_in({start, start})) {
    check.error = check_bow(*bow, steps, request.options.rate_hz);
  }
  const auto bow = check.error || !keys.mode
                       ? std::nullopt
                       : strongest_in(proved_box(proof.stability, request.preset));
  const double factor = bow ? highest_bow_factor(*bow, steps) : Budget::unlimited;
  if (factor < keys.highest_factor) {
    const double hz = keys.pitches.frequency_at(factor);
    check.note = "above " + print_number(std::floor(hz)) + " Hz the bow '" + bow->name +
                 "' slips a little early at its strongest";
  }
  return check;
}

// Returns the reason why keys do not set the pitch although the preset has a keyboard; may be
// empty.
std::string reason_without_mode(const Network& network) {
  const std::size_t masses = moving_count(network);
  if (masses > most_quick_masses) {
    return "finding the lowest mode of " + std::to_string(masses) + " masses takes too long";
  }
  if (!network.waveguides.empty()) {
    return "every waveguide is fixed";
  }
  return "";
}

// Returns the notes about the computation of the network that are not about a single part.
std::vector<std::string> make_notes(const CompileRequest& request, const Reduced& reduced,
                                    const Schemes& schemes, const Culled& culled,
                                    const Proof& proof, const TunedKeys& keys, bool misses_gain,
                                    const BowCheck& bows) {
  std::vector<std::string> notes = schemes.notes;
  if (const std::string left_out = describe(culled); !left_out.empty()) {
    notes.push_back("left out: " + left_out);
  }
  if (proof.stability.is_together) {
    notes.emplace_back(
        "all ranges were narrowed by the same share, because finding the limit of each parameter "
        "would take too long");
  }
  if (request.preset.keyboard && !keys.mode) {
    const std::string reason = reason_without_mode(reduced.network);
    if (!reason.empty()) {
      notes.push_back("keys do not set the pitch: " + reason);
    }
  }
  if (misses_gain) {
    notes.emplace_back(
        "the gain was not adjusted, because playing a note of this large network takes too long; "
        "set it with -g");
  }
  if (reduced.merged_springs > 0) {
    notes.push_back("merged: " + std::to_string(reduced.merged_springs) +
                    (reduced.merged_springs == 1 ? " parallel spring" : " parallel springs"));
  }
  notes.insert(notes.end(), keys.notes.begin(), keys.notes.end());
  if (!bows.note.empty()) {
    notes.push_back(bows.note);
  }
  return notes;
}

// The load path. Every stage is a function of the results before it, and no stage changes one; the
// machine moves from tabulate() through plan() into the engine.
Result<Compiled> compile_by_stages(const CompileRequest& request) {
  const Preset& preset = request.preset;
  const CompileOptions& options = request.options;
  const Progress& progress = options.progress;
  progress.stage("expanding its macros");
  if (auto errors = find_preset_errors(request.written, preset); !errors.empty()) {
    return std::move(errors.front());
  }
  const Reduced reduced = reduce(request);
  const Network& network = reduced.network;

  const Result<Analysis> analysis = analyse(request, network);
  if (!analysis) {
    return analysis.error();
  }

  progress.stage("dividing it into parts");
  const bool plays_published_laws = options.bare && !options.budget;
  const Schemes schemes = choose_schemes(
      network, plays_published_laws ? Budget{.passive = Passivity::never} : request.budget,
      progress);
  const Culled culled = cull(network, progress);
  Machine machine = tabulate(network, culled, schemes.links, analysis->values, options.rate_hz,
                             options.rescale, progress);

  const auto parts = std::ranges::count_if(
      machine.parts, [](const Program& program) { return program.moving > 0; });
  auto body = compile_body(request, network, analysis->start, static_cast<std::size_t>(parts));
  if (!body) {
    return body.error();
  }

  Proof proof = prove(request, reduced, *analysis, schemes, machine);
  if (*body) {
    proof.stability = within_ranges_of(**body, std::move(proof.stability));
  }
  Planned planned = plan(request, *analysis, proof, std::move(machine));
  const TunedKeys keys = tune(request, network, *analysis, proof.margins, planned,
                              voice_curves(network, preset, proof.stability));

  if (auto error = check_memory(planned.machine, request.voices, request.precision,
                                options.executor, options.most_bytes)) {
    return *std::move(error);
  }
  const BodyGain body_gain = *body ? measure_gain(**body, progress) : BodyGain();
  const auto playing_with = [&](int voices, double gain) {
    Playing playing = make_playing(network, preset, proof, keys, options.bare, voices, gain);
    playing.share = options.share;
    playing.body_gain = body_gain.largest;
    playing.mean_body_gain = body_gain.mean;
    playing.body_response = body_gain.response;
    return playing;
  };
  std::optional<double> factor = 1.0;  // factor on the preset's gain
  if (options.find_gain) {
    progress.stage("finding its gain");
    factor =
        find_gain(planned.machine, playing_with(1, 1.0), request.precision, options.isa, progress);
  }
  const double gain = preset.gain * factor.value_or(1.0);
  // The voices move the body by their outputs as they are. The last body has the preset's gain.
  const double voice_gain = *body ? 1.0 : gain;

  BowCheck bows = check_bows(request, network, schemes, *analysis, proof, planned.machine, keys);
  std::vector<std::string> notes =
      make_notes(request, reduced, schemes, culled, proof, keys, !factor, bows);
  progress.stage("making its voices");
  Instrument instrument =
      make_instrument(network, preset, proof, keys, request.voices, voice_gain * body_gain.mean);
  instrument.gain = gain;
  instrument.struck = find_struck(request.written, planned.machine);
  std::optional<Accuracy> accuracy = accuracy_of(planned.parts);
  Compiled compiled{
      .engine = make_engine(std::move(planned.machine), playing_with(request.voices, voice_gain),
                            request.precision, options.isa, progress, options.executor),
      .instrument = std::move(instrument),
      .plan = {.parts = std::move(planned.parts),
               .budget = request.budget,
               .precision = request.precision,
               .accuracy = std::move(accuracy),
               .notes = std::move(notes)},
      .stability = proof.stability,
      .schemes = schemes,
      .strong_bow = std::move(bows.error)};
  if (*body) {
    add_body(compiled, **std::move(body), preset.bodies.front().file);
  }
  return compiled;
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
    // Ranges in swings are resolved first: a loud note is played, and its displacement is measured
    // at the masses that the controls touch.
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
