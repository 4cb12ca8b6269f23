// The life of voices, and their sound.
#include "core/engine/voices.h"

#include <algorithm>
#include <cmath>

namespace ressort {
namespace {

constexpr double smoothing_hz = 44.1;   // of a position: its one-pole's (1 - pole) * rate
constexpr double bow_start_s = 0.005;   // a bow reaches its speed as a one-pole of this time
constexpr double level_memory_s = 0.1;  // how long a voice's level remembers a peak
constexpr double quiet_s = 0.5;         // longer than half a period of the slowest sound
constexpr std::size_t most_reserve_lanes = 4;

}  // namespace

Engine::Voices::Voices(Program program_in, Playing playing_in, Precision precision)
    : program(std::move(program_in)),
      playing(std::move(playing_in)),
      bank(precision == Precision::float32
               ? decltype(bank)(std::in_place_type<Bank<float>>, program, lanes_wanted())
               : decltype(bank)(std::in_place_type<Bank<double>>, program, lanes_wanted())),
      voices(std::visit([](const auto& b) { return b.lanes(); }, bank)),
      hands(voices.size() * program.inputs.size()),
      parameters(program.parameters),
      rest(program.inputs.size()),
      audio_control(program.inputs.size(), nullptr),
      audio_before(program.inputs.size()),
      pole(playing.bare ? 0.0 : 1.0 - std::min(1.0, smoothing_hz / program.rate_hz)),
      bow_pole(playing.bare ? 0.0 : std::exp(-1.0 / (bow_start_s * program.rate_hz))) {
  for (std::size_t i = 0; i < rest.size(); ++i) {
    rest[i] = middle(i);
  }
  for (const Control& control : playing.controls) {
    if (control.gesture == Gesture::pluck) {
      rest[control.target] = middle(control.target) - control.travel;
    }
    if (control.gesture == Gesture::hold) {
      rest[control.target] = control.low;
    }
    if (control.source == Source::audio) {
      audio_control[control.target] = &control;
      audio_before[control.target] = playing.bare ? middle(control.target) : 0.0;
    }
  }
  changes.reserve(max_changes);
  told.reserve(max_changes);
  start(0, 0.0);
  voices[0].level = 0.0;  // no note: the first one may take its place
}

std::size_t Engine::Voices::lanes_wanted() const {
  const auto wanted = static_cast<std::size_t>(std::max(1, playing.voices));
  return wanted + std::min(wanted, most_reserve_lanes);
}

void Engine::Voices::start(std::size_t lane, double frequency_hz) {
  Voice& voice = voices[lane];
  voice = Voice{};
  voice.awake = true;
  voice.frequency_hz = frequency_hz;
  voice.level = 1.0;  // not yet heard: not yet the quietest
  rest_lane(lane);
  tune(lane, false);
  last = lane;
}

void Engine::Voices::rest_lane(std::size_t lane) {
  std::visit(
      [&](auto& b) {
        const std::size_t width = b.lanes() / b.groups.size();
        reset_lane(program, b.groups[lane / width], lane % width);
      },
      bank);
  for (std::size_t i = 0; i < program.inputs.size(); ++i) {
    hand(lane, i).place(rest[i]);
  }
}

void Engine::Voices::wake(std::size_t lane) {
  if (!voices[lane].awake) {
    start(lane, voices[lane].frequency_hz);
  }
  voices[lane].quiet_frames = 0;
}

void Engine::Voices::fade(std::size_t lane, double seconds) {
  Voice& voice = voices[lane];
  const double step = -1.0 / std::max(1.0, seconds * program.rate_hz);
  voice.gain_step = std::min(voice.gain_step, step);
  voice.fading = true;
  voice.held = voice.sustained = false;
}

std::size_t Engine::Voices::lane_for(int key, int channel) {
  std::size_t live = 0;
  std::size_t quietest = voices.size();
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    if (!is_live(lane)) {
      continue;
    }
    ++live;
    if (quietest == voices.size() || voices[lane].level < voices[quietest].level) {
      quietest = lane;
    }
  }
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    const Voice& voice = voices[lane];
    if (is_live(lane) && voice.frequency_hz > 0.0 && voice.key == key && voice.channel == channel) {
      return lane;
    }
  }
  if (live >= static_cast<std::size_t>(std::max(1, playing.voices))) {
    stolen += voices[quietest].level > quiet_level ? 1 : 0;
    fade(quietest, steal_fade_s);
  }
  // A reserve lane is free unless several voices were stolen within one fade; then the one
  // that has faded most goes at once.
  std::size_t faintest = voices.size();
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    if (!voices[lane].awake) {
      return lane;
    }
    if (voices[lane].fading &&
        (faintest == voices.size() || voices[lane].gain < voices[faintest].gain)) {
      faintest = lane;
    }
  }
  return faintest;
}

void Engine::Voices::segment(std::span<const double* const> inputs,
                             std::span<double* const> outputs, std::size_t at, std::size_t frames) {
  listen(inputs, at, frames);
  std::visit([&](auto& b) { segment_in(b, inputs, outputs, at, frames); }, bank);
  remember_audio(inputs, at + frames);
  since_settled += frames;
  if (since_settled == max_segment_frames) {
    since_settled = 0;
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      if (voices[lane].awake) {
        settle(lane);
      }
    }
  }
  if (playing.noise) {
    for (std::size_t n = at; n < at + frames; ++n) {
      for (double* const output : outputs) {
        output[n] *= white();
      }
    }
  }
}

template <class T>
void Engine::Voices::segment_in(Bank<T>& b, std::span<const double* const> inputs,
                                std::span<double* const> outputs, std::size_t at,
                                std::size_t frames) {
  for (std::size_t group = 0; group < b.groups.size(); ++group) {
    const std::size_t first = group * lane_count<T>;
    bool any_awake = false;
    for (std::size_t i = 0; i < lane_count<T>; ++i) {
      any_awake |= voices[first + i].awake;
    }
    if (!any_awake) {
      continue;
    }
    fill_drive(b, first, inputs, at, frames);
    fill_audio(b, first, inputs, at, frames);
    step_direct(program, b.groups[group], b.drive.data(), b.audio.data(), b.outputs.data(), frames);
    for (std::size_t i = 0; i < lane_count<T>; ++i) {
      if (voices[first + i].awake) {
        mix(b, first + i, i, outputs, at, frames);
      }
    }
  }
}

template <class T>
void Engine::Voices::fill_drive(Bank<T>& b, std::size_t first,
                                std::span<const double* const> inputs, std::size_t at,
                                std::size_t frames) {
  const std::size_t count = program.inputs.size();
  for (std::size_t input = 0; input < count; ++input) {
    const bool is_force = program.inputs[input].is_force;
    Drive<T>* const drive = b.drive.data() + input;
    for (std::size_t i = 0; i < lane_count<T>; ++i) {
      Hand& mover = hand(first + i, input);
      for (std::size_t n = 0; n < frames; ++n) {
        const HandSample sample = is_force ? mover.next_force() : mover.next_position();
        drive[n * count].value[i] = static_cast<T>(sample.value);
        drive[n * count].velocity[i] = static_cast<T>(sample.velocity);
      }
    }
    if (const double* const audio = audio_for(input, inputs)) {
      add_audio(b, input, audio + at, frames);
    }
  }
}

template <class T>
void Engine::Voices::add_audio(Bank<T>& b, std::size_t input, const double* audio,
                               std::size_t frames) {
  const double r = program.inputs[input].is_force ? program.rate_ratio : 1.0;
  const double scale = audio_control[input]->high * r * r;
  const T kept = playing.bare ? T(0) : T(1);
  double before = audio_before[input];
  Drive<T>* drive = b.drive.data() + input;
  for (std::size_t n = 0; n < frames; ++n) {
    const double value = scale * audio[n];
    drive->value = kept * drive->value + static_cast<T>(value);
    drive->velocity = kept * drive->velocity + static_cast<T>(value - before);
    before = value;
    drive += program.inputs.size();
  }
}

template <class T>
void Engine::Voices::fill_audio(Bank<T>& b, std::size_t first,
                                std::span<const double* const> inputs, std::size_t at,
                                std::size_t frames) {
  Lanes<T>* value = b.audio.data();
  for (std::size_t n = at; n < at + frames && !program.audio_parameters.empty(); ++n) {
    for (const AudioParameter& audio : program.audio_parameters) {
      const auto channel = static_cast<std::size_t>(audio.channel);
      const bool is_there = channel < inputs.size() && inputs[channel] != nullptr;
      parameters[audio.parameter] = is_there ? inputs[channel][n] : 0.0;
    }
    for (const std::uint32_t c : program.audio_coefficients) {
      for (std::size_t i = 0; i < lane_count<T>; ++i) {
        (*value)[i] = static_cast<T>(coefficient_value(program, program.coefficients[c], parameters,
                                                       voices[first + i].factor));
      }
      ++value;
    }
  }
}

const double* Engine::Voices::audio_for(std::size_t input,
                                        std::span<const double* const> inputs) const {
  const Control* const control = audio_control[input];
  return control != nullptr && control->number < inputs.size() ? inputs[control->number] : nullptr;
}

void Engine::Voices::listen(std::span<const double* const> inputs, std::size_t at,
                            std::size_t frames) {
  for (std::size_t input = 0; input < program.inputs.size(); ++input) {
    const double* const audio = audio_for(input, inputs);
    if (audio != nullptr &&
        std::any_of(audio + at, audio + at + frames, [](double sample) { return sample != 0.0; })) {
      wake(last);
    }
  }
}

void Engine::Voices::remember_audio(std::span<const double* const> inputs, std::size_t end) {
  for (std::size_t input = 0; input < program.inputs.size(); ++input) {
    if (const double* const audio = audio_for(input, inputs)) {
      audio_before[input] = audio_control[input]->high * audio[end - 1];
    }
  }
}

template <class T>
void Engine::Voices::mix(Bank<T>& b, std::size_t lane, std::size_t i,
                         std::span<double* const> outputs, std::size_t at, std::size_t frames) {
  Voice& voice = voices[lane];
  const std::size_t channels = program.outputs.size();
  double peak = 0.0;
  bool in_bounds = true;
  for (std::size_t n = 0; n < frames * channels; ++n) {
    const double y = std::fabs(static_cast<double>(b.outputs[n][i]));
    in_bounds &= y < runaway;  // false for what is no number
    peak = std::max(peak, y);
  }
  if (!in_bounds) {
    ++resets;
    rest_lane(lane);
    return;
  }
  for (std::size_t n = 0; n < frames; ++n) {
    voice.gain = std::max(0.0, voice.gain + voice.gain_step);
    const double gain = playing.gain * voice.gain;
    for (std::size_t channel = 0; channel < channels; ++channel) {
      outputs[channel][at + n] += gain * static_cast<double>(b.outputs[n * channels + channel][i]);
    }
  }
  voice.peak = std::max(voice.peak, peak);
}

void Engine::Voices::settle(std::size_t lane) {
  Voice& voice = voices[lane];
  constexpr std::size_t frames = max_segment_frames;
  const double peak = voice.peak * playing.gain * voice.gain;
  voice.peak = 0.0;
  voice.level = std::max(peak, voice.level * std::exp(-static_cast<double>(frames) /
                                                      (level_memory_s * program.rate_hz)));
  if (voice.fading && voice.gain == 0.0) {
    voice = Voice{};
    return;
  }
  voice.quiet_frames = peak < quiet_level ? voice.quiet_frames + frames : 0;
  if (playing.bare || voice.held || voice.sustained ||
      static_cast<double>(voice.quiet_frames) < quiet_s * program.rate_hz) {
    return;
  }
  voice.quiet_frames = 0;
  for (std::size_t input = 0; input < program.inputs.size(); ++input) {
    if (hand(lane, input).is_moving()) {
      return;
    }
  }
  if (is_at_rest(lane)) {
    const double frequency_hz = voice.frequency_hz;
    voice = Voice{};
    voice.frequency_hz = frequency_hz;
  }
}

bool Engine::Voices::is_at_rest(std::size_t lane) const {
  const double bound = quiet_level / std::max(1e-30, playing.gain);
  return std::visit(
      [&](const auto& b) {
        const std::size_t width = b.lanes() / b.groups.size();
        const auto& state = b.groups[lane / width];
        for (std::size_t i = 0; i < program.moving; ++i) {
          const double x = static_cast<double>(state.x[i][lane % width]) - program.position[i];
          if (!(std::fabs(x) < bound)) {
            return false;
          }
        }
        return true;
      },
      bank);
}

double Engine::Voices::white() {
  noise ^= noise << 13;
  noise ^= noise >> 7;
  noise ^= noise << 17;
  return static_cast<double>(static_cast<std::int64_t>(noise)) * 0x1p-63;
}

}  // namespace ressort
