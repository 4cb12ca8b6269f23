#include "core/compile/tune.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "core/compile/accuracy/loaded_waveguide.h"
#include "core/compile/accuracy/pitches.h"
#include "core/compile/instrument.h"
#include "core/kernels/oversampled/oversampled_form.h"
#include "core/model/preset/fit.h"

namespace ressort::compile {
namespace {

// fraction of the sample rate; higher modes are not played
constexpr double highest_mode_share = 0.456;

struct FoundPitches {
  Pitches pitches;
  bool ignores_springs = false;  // tuned as if nothing were attached to the waveguide
};

// Tunes keys to the lowest mode at these values of the parameters.
FoundPitches find_pitches(const CompileRequest& request, const Network& network,
                          const Machine& machine, const LowestShapes& shapes,
                          std::span<const double> parameters, const PitchWindow& window = {}) {
  const double rate_hz = request.options.rate_hz;
  if (network.waveguides.empty()) {
    return {make_pitches(shapes, stepping_of_lowest(machine, shapes, parameters), rate_hz,
                         request.rate_ratio, window)};
  }
  if (auto loaded =
          loaded_waveguide_pitches(machine, parameters, request.options.progress, window)) {
    return {*std::move(loaded)};
  }
  return {make_pitches(shapes, {.scheme = Stepping::Scheme::exact}, rate_hz, request.rate_ratio,
                       window),
          true};
}

// Raises each key by the cents that the preset's sound is flat of its lowest mode.
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

// Returns the ratio of the factors at which one step a sample and several have the pitch of a key.
// Empty if no part lets low keys take one step.
Pitches find_warp(const CompileRequest& request, const Machine& machine,
                  const LowestShapes& shapes) {
  double times = 1.0;
  for (const Program& program : machine.parts) {
    const auto* steps = program.form.get_if<Oversampled>();
    times = steps != nullptr && steps->coarse ? std::max<double>(times, steps->times) : times;
  }
  if (times == 1.0) {
    return {};
  }
  const auto at_step = [&](double step) {
    return make_pitches(shapes, {.step = step}, request.options.rate_hz, request.rate_ratio);
  };
  Pitches warp = at_step(1.0);
  const Pitches fine = at_step(1.0 / times);
  warp.factors.resize(std::min(warp.factors.size(), fine.factors.size()));
  for (std::size_t i = 0; i < warp.factors.size(); ++i) {
    warp.factors[i] /= fine.factors[i];
  }
  return warp;
}

// Returns the parameter along which keys stay in tune and its range, without pitches.
std::optional<PitchesAlong> range_to_tune(const CompileRequest& request, const Network& network,
                                          std::span<const double> start) {
  const Preset& preset = request.preset;
  const std::string& name = preset.morph.empty() ? preset.tuned_along : preset.morph_parameter;
  const int parameter = find_parameter(network, name);
  if (parameter < 0 || request.options.bare) {
    return std::nullopt;
  }
  PitchesAlong along{.parameter = static_cast<std::size_t>(parameter),
                     .start = start[static_cast<std::size_t>(parameter)]};
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

// Tunes keys at equal steps of one parameter. Halves the steps until the cubics between them are
// within 0.01 cents of the pitches halfway, or up to 64 steps. Empty if a mode is missing anywhere.
PitchesAlong find_pitches_along(const CompileRequest& request, const Network& network,
                                const Machine& machine) {
  constexpr double in_tune = 1e-5;  // difference of the logarithm of the factor: 0.01 cents
  constexpr std::size_t most_steps = 64;
  std::optional<PitchesAlong> along = range_to_tune(request, network, machine.parameters);
  if (!along) {
    return {};
  }
  request.options.progress.stage("tuning keys along a parameter");
  bool is_found = true;
  const auto pitches_at = [&](double value) {
    std::vector<double> parameters = machine.parameters;
    parameters[along->parameter] = value;
    const auto shapes = find_shapes(request, network, parameters);
    is_found = is_found && shapes;
    return shapes ? sharpened(find_pitches(request, network, machine, *shapes, parameters).pitches,
                              request.preset)
                  : Pitches();
  };
  while (along->at.size() <= along->legs * along->steps) {
    along->at.push_back(pitches_at(along->value_at(along->at.size())));
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
      finer.at.push_back(pitches_at(finer.value_at(i)));
      for (const double hz : {27.5, 261.6, 2093.0}) {
        const double off =
            std::log(finer.at.back().factor_at(hz) / along->factor_at(hz, finer.value_at(i)));
        is_near = is_near && std::fabs(off) < in_tune;
      }
    }
    along = std::move(finer);
  }
  return is_found ? *std::move(along) : PitchesAlong();
}

// Tunes each key at its own values of the parameters, around its frequency. Empty if the curves
// change no parameter from key to key, or if a mode is missing on any key. `shared`: the pitches at
// the start values, before sharpened().
std::vector<Pitches> find_key_pitches(const CompileRequest& request, const Network& network,
                                      const Machine& machine, const LowestShapes& shared_shapes,
                                      const Pitches& shared,
                                      const std::vector<std::optional<VoiceCurve>>& curves) {
  if (std::ranges::none_of(curves,
                           [](const auto& curve) { return curve && !curve->keys.empty(); })) {
    return {};
  }
  request.options.progress.stage("tuning each key at its own parameters");
  const KeyFrequencies keys_hz = key_frequencies(request.preset);
  const KeyFrequencies usual_hz = equal_temperament(request.preset.a4_hz, request.preset.transpose);
  std::vector<Pitches> keys;
  std::optional<LowestShapes> shapes;
  std::vector<double> before;
  for (std::size_t key = 0; key < key_count; ++key) {
    std::vector<double> parameters = machine.parameters;
    for (std::size_t i = 0; i < curves.size(); ++i) {
      if (curves[i]) {
        parameters[i] = curves[i]->on_key(static_cast<double>(key), parameters[i]);
      }
    }
    if (parameters != before) {
      shapes = find_shapes(request, network, parameters);
    }
    if (!shapes) {
      return {};
    }
    const double ratio = shared_shapes.mode.frequency_hz / shapes->mode.frequency_hz;
    const PitchWindow window{.near = &shared,
                             .frequency_hz = keys_hz[key] > 0.0 ? keys_hz[key] : usual_hz[key],
                             .ratio = ratio * ratio};
    keys.push_back(
        sharpened(find_pitches(request, network, machine, *shapes, parameters, window).pitches,
                  request.preset));
    before = std::move(parameters);
  }
  return keys;
}

}  // namespace

TunedKeys tune(const CompileRequest& request, const Network& network, const Analysis& analysis,
               const Margins& margins, const Planned& planned,
               const std::vector<std::optional<VoiceCurve>>& curves) {
  TunedKeys keys{.highest_factor = margins.keys, .away = margins.away};
  if (!analysis.shapes) {
    return keys;
  }
  const FoundPitches found =
      find_pitches(request, network, planned.machine, *analysis.shapes, planned.machine.parameters);
  if (found.ignores_springs) {
    keys.notes.push_back("keys tune the waveguide without its load, because more than " +
                         std::to_string(most_loading_springs) + " springs are attached to it");
  }
  keys.pitches = sharpened(found.pitches, request.preset);
  keys.warp = find_warp(request, planned.machine, *analysis.shapes);
  keys.mode = analysis.mode();
  keys.mode->frequency_hz = keys.pitches.frequency_at(1.0);
  keys.along = find_pitches_along(request, network, planned.machine);
  keys.by_key =
      find_key_pitches(request, network, planned.machine, *analysis.shapes, found.pitches, curves);
  // The chosen forms allow more stiffness than the published scheme. Keys may use it up to the
  // highest mode that is played.
  if (planned.more > 1.0) {
    const double highest = keys.pitches.factor_at(highest_mode_share * request.options.rate_hz);
    keys.highest_factor = std::min(planned.more * margins.keys, highest);
    for (double& factor : keys.away) {
      factor = std::min(planned.more * factor, highest);
    }
  }
  return keys;
}

}  // namespace ressort::compile
