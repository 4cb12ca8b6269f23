#include "core/compile/bodies.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <complex>
#include <iterator>
#include <numeric>
#include <utility>

#include "core/linear_algebra/fourier.h"
#include "core/model/language/mdl.h"
#include "core/model/preset/fit.h"

namespace ressort::compile {
namespace {

// Returns the preset of a body: audio channel n drives input n.
Preset body_preset(const Preset& preset, const Network& body) {
  Preset own{
      .gain = preset.gain, .keyboard = false, .third = preset.third, .budget = preset.budget};
  own.bodies.assign(preset.bodies.begin() + 1, preset.bodies.end());
  own.through_location = preset.through_location;
  for (const ParameterSetting& setting : preset.parameters) {
    if (find_parameter(body, setting.name) >= 0) {
      own.parameters.push_back(setting);
    }
  }
  for (const Input& input : body.inputs) {
    own.controls.push_back({.source = ControlSource::audio,
                            .number = input.number,
                            .target = "in" + std::to_string(input.number)});
  }
  return own;
}

// Returns the error with the file of its line.
Error in_file(const std::string& file, const Error& error) {
  return error.line > 0
             ? Error{to_string(
                   Diagnostic{.line = error.line, .column = error.column, .message = error.message},
                   file)}
             : error;
}

const ParameterInfo* find_shared(const Compiled& body, const ParameterInfo& of_voices) {
  for (const ParameterInfo& info : body.instrument.parameters) {
    if (info.name == of_voices.name && info.audio_input == 0 && of_voices.audio_input == 0) {
      return &info;
    }
  }
  return nullptr;
}

std::vector<SharedParameter> shared_parameters(const Instrument& voices, const Compiled& body) {
  std::vector<SharedParameter> shared;
  for (std::size_t i = 0; i < voices.parameters.size(); ++i) {
    if (const ParameterInfo* const info = find_shared(body, voices.parameters[i])) {
      shared.push_back(
          {.index = static_cast<std::uint16_t>(i),
           .of_body = static_cast<std::uint16_t>(info - body.instrument.parameters.data())});
    }
  }
  return shared;
}

// Returns the beginning of an impulse response, as voices are compared by it.
std::vector<double> summed_by_step(std::span<const double> response, double rate_hz) {
  constexpr double longest_s = 0.05;
  const std::size_t step = engine::compared_step(rate_hz);
  const auto longest = static_cast<std::size_t>(longest_s * rate_hz);
  std::vector<double> sums;
  for (std::size_t at = 0; at + step <= std::min(longest, response.size()); at += step) {
    const auto from = response.begin() + static_cast<std::ptrdiff_t>(at);
    sums.push_back(std::accumulate(from, from + static_cast<std::ptrdiff_t>(step), 0.0));
  }
  return sums;
}

}  // namespace

Result<std::optional<Compiled>> compile_body(const CompileRequest& request, const Network& network,
                                             std::span<const double> start,
                                             std::size_t forms_before) {
  if (request.preset.bodies.empty()) {
    return std::optional<Compiled>();
  }
  const BodyModel& model = request.preset.bodies.front();
  Preset rest;
  rest.bodies.assign(request.preset.bodies.begin() + 1, request.preset.bodies.end());
  Network body = with_preset_parameters(model.network, rest);
  for (Parameter& parameter : body.parameters) {
    if (const int same = find_parameter(network, parameter.name);
        same >= 0 && parameter.audio_input == 0) {
      parameter.value = start[static_cast<std::size_t>(same)];
    }
  }
  CompileOptions options = request.options;
  options.voices = 1;
  options.precision = request.precision;
  options.share = {};
  options.find_gain = false;
  const std::size_t before = std::min(forms_before, options.forms.size());
  options.forms.erase(options.forms.begin(),
                      options.forms.begin() + static_cast<std::ptrdiff_t>(before));
  auto compiled = compile_network(body, body_preset(request.preset, body), options);
  if (!compiled) {
    return in_file(model.file, compiled.error());
  }
  return std::optional<Compiled>(*std::move(compiled));
}

BodyGain measure_gain(Compiled& body, const Progress& progress) {
  constexpr double lowest_hz = 20.0;
  constexpr double longest = 65536.0;  // frames, as `shortest`
  constexpr double shortest = 2048.0;
  constexpr double most_ns = 2.5e8;
  constexpr double ns_of_a_step = 10.0;  // see Progress::spend()
  constexpr std::size_t block = 256;     // a multiple of max_block_frames, as all that is played
  constexpr double first_impulse = 1e-6;
  constexpr double audible = 1e-2;  // far above the level at which a voice sleeps
  progress.stage("measuring the gain of its body");
  Engine& engine = *body.engine;
  const Machine& machine = engine.machine();
  double ns = 1.0;  // per sample
  for (const Part& part : body.plan.parts) {
    ns += part.estimated_ns;
  }
  const double inputs = static_cast<double>(std::max<std::size_t>(1, machine.inputs.size()));
  const std::size_t frames = std::bit_floor(
      static_cast<std::size_t>(std::clamp(most_ns / (ns * inputs), shortest, longest)));
  const auto count = static_cast<std::size_t>(engine.output_count());
  std::vector<std::vector<double>> heard(count, std::vector<double>(frames));
  std::vector<double*> outputs(count);
  const std::vector<double> silence(block);
  std::vector<double> sound(block);
  const auto play = [&](std::size_t channel, double impulse) {
    double peak = 0.0;
    std::vector<const double*> channels(channel + 1, silence.data());
    channels[channel] = sound.data();
    for (std::size_t at = 0; at < frames; at += block) {
      progress.spend(static_cast<std::size_t>(block * ns / ns_of_a_step));
      sound[0] = at == 0 ? impulse : 0.0;
      for (std::size_t c = 0; c < count; ++c) {
        outputs[c] = heard[c].data() + at;
      }
      engine.process({}, channels, outputs, block);
      for (const double* const output : outputs) {
        peak = std::accumulate(output, output + block, peak,
                               [](double most, double y) { return std::max(most, std::fabs(y)); });
      }
    }
    const Event panic{.kind = EventKind::panic};
    std::vector<double> fade(block);
    std::fill(outputs.begin(), outputs.end(), fade.data());
    const auto fade_frames = static_cast<std::size_t>(0.02 * machine.rate_hz);
    for (std::size_t at = 0; at < fade_frames; at += block) {
      engine.process({&panic, at == 0 ? std::size_t{1} : std::size_t{0}}, {}, outputs, block);
    }
    return peak;
  };
  Fourier fourier(frames);
  std::vector<std::complex<double>> bins(fourier.bins());
  const auto first_bin = static_cast<std::size_t>(
      std::ceil(lowest_hz / machine.rate_hz * static_cast<double>(frames)));
  // [output][bin] sum over the inputs
  std::vector<std::vector<double>> gains(count, std::vector<double>(bins.size()));
  BodyGain most{0.0, 0.0, {}};
  for (const ModelInput& input : machine.inputs) {
    const auto channel = static_cast<std::size_t>(input.number - 1);
    double impulse = first_impulse;
    if (const double peak = play(channel, impulse); peak > 0.0 && peak < audible) {
      impulse /= peak;
      play(channel, impulse);
    }
    if (most.response.empty()) {
      most.response = summed_by_step(heard.front(), machine.rate_hz);
    }
    for (std::size_t c = 0; c < count; ++c) {
      fourier.forward(heard[c], bins);
      std::transform(
          bins.begin(), bins.end(), gains[c].begin(), gains[c].begin(),
          [&](std::complex<double> bin, double sum) { return sum + std::abs(bin) / impulse; });
    }
  }
  for (const std::vector<double>& gain : gains) {
    double squares = 0.0;
    for (std::size_t bin = first_bin; bin < gain.size(); ++bin) {
      most.largest = std::max(most.largest, gain[bin]);
      squares += gain[bin] * gain[bin];
    }
    most.mean = std::max(most.mean, std::sqrt(squares / static_cast<double>(gain.size())));
  }
  return most.largest > 0.0 && std::isfinite(most.largest) ? most : BodyGain();
}

StabilityCheck within_ranges_of(const Compiled& body, StabilityCheck voices) {
  for (std::size_t i = 0; i < voices.parameters.size(); ++i) {
    ParameterInfo& info = voices.parameters[i];
    const ParameterInfo* const same = find_shared(body, info);
    if (same == nullptr) {
      continue;
    }
    info.minimum = std::max(info.minimum, same->minimum);
    info.maximum = std::min(info.maximum, same->maximum);
    info.safe = {std::max(info.safe.lowest, same->safe.lowest),
                 std::min(info.safe.highest, same->safe.highest)};
    info.is_raised = info.is_raised || same->is_raised;
    info.is_lowered = info.is_lowered || same->is_lowered;
    const auto index = static_cast<std::size_t>(same - body.instrument.parameters.data());
    if (i < voices.limits.size() && index < body.stability.limits.size()) {
      const Limits& limits = body.stability.limits[index];
      voices.limits[i] = {std::max(voices.limits[i].lowest, limits.lowest),
                          std::min(voices.limits[i].highest, limits.highest)};
    }
  }
  return voices;
}

void add_body(Compiled& voices, Compiled body, const std::string& file) {
  const std::string name = file.substr(file.rfind('/') + 1);
  std::vector<SharedParameter> shared = shared_parameters(voices.instrument, body);
  voices.instrument.outputs = body.instrument.outputs;
  voices.engine->set_body(std::move(body.engine), std::move(shared));
  for (Part& part : body.plan.parts) {
    part.body = part.body.empty() ? name : part.body;
    voices.plan.parts.push_back(std::move(part));
  }
  for (const std::string& note : body.plan.notes) {
    const bool is_named = note.find(".mdl: ") != note.npos;
    voices.plan.notes.push_back(is_named ? note : name + ": " + note);
  }
  voices.plan.accuracy = accuracy_of(voices.plan.parts);
  voices.bodies.push_back({.file = file,
                           .stability = std::move(body.stability),
                           .hazard = std::move(body.schemes.hazard),
                           .strong_bow = std::move(body.strong_bow)});
  std::move(body.bodies.begin(), body.bodies.end(), std::back_inserter(voices.bodies));
}

}  // namespace ressort::compile
