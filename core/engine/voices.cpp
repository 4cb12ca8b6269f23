// The life of voices, and their sound.
#include "core/engine/voices.h"

#include <algorithm>
#include <cmath>

namespace ressort {
namespace {

constexpr double level_memory_s = 0.1;  // how long a voice's level remembers a peak
constexpr double quiet_s = 0.5;         // longer than half a period of the slowest sound
constexpr std::size_t most_reserve_lanes = 4;
constexpr std::size_t updates_per_reading = 16;  // of the energy: 20 ms or so

}  // namespace

Engine::Voices::Voices(Machine machine_in, Playing playing_in, Precision precision, Isa isa,
                       const Progress& progress)
    : machine(std::move(machine_in)),
      playing(std::move(playing_in)),
      bank(precision == Precision::float32
               ? decltype(bank)(std::in_place_type<Bank<float>>, machine, lanes_wanted(), isa,
                                progress)
               : decltype(bank)(std::in_place_type<Bank<double>>, machine, lanes_wanted(), isa,
                                progress)),
      audio_control(machine.inputs.size(), nullptr),
      sound(machine.inputs.size()),
      level_kept(
          std::exp(-static_cast<double>(max_block_frames) / (level_memory_s * machine.rate_hz))) {
  playing.limits.resize(machine.parameters.size());
  playing.home.resize(machine.parameters.size());
  playing.rest_bounds.resize(machine.parts.size());
  voices.resize(lanes_wanted());
  first_output.push_back(0);
  for (const Program& program : machine.parts) {
    first_output.push_back(first_output.back() + program.outputs.size());
    elements.push_back(program.position.size() + program.ends.size());
  }
  watches.resize(voices.size() * machine.parts.size());
  held.resize(voices.size() * first_output.back());
  creators.reserve(max_creators);
  loudest = playing.bare ? runaway : std::min(runaway, runaway_level / playing.gain);
  drivers.resize(voices.size() * machine.inputs.size());
  parameters = machine.parameters;
  audio_before.resize(machine.inputs.size());
  for (std::size_t i = 0; i < machine.inputs.size(); ++i) {
    rest.push_back(middle(i));
  }
  for (const Control& control : playing.controls) {
    if (const auto start = row_of(control.gesture).start) {
      rest[control.target] = start(stroke_on(control.target, &control));
    }
    if (control.source == Source::audio) {
      audio_control[control.target] = &control;
      audio_before[control.target] = playing.bare ? middle(control.target) : 0.0;
    }
  }
  changes.reserve(max_changes);
  told.reserve(max_changes);
  turned.reserve(parameters.size());
  is_turned.resize(parameters.size());
  start(0, 0.0);
  apply_changes();
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
  is_idle = false;
  voice.frequency_hz = frequency_hz;
  voice.level = 1.0;  // not yet heard: not yet the quietest
  voice.is_new = has_changed = true;
  for (std::size_t p = 0; p < elements.size(); ++p) {
    forget(watch(lane, p));
  }
  for (std::size_t i = 0; i < machine.inputs.size(); ++i) {
    driver(lane, i).place(rest[i]);
  }
  last = lane;
}

void Engine::Voices::wake(std::size_t lane) {
  if (!voices[lane].awake) {
    start(lane, voices[lane].frequency_hz);
  }
  voices[lane].quiet_frames = 0;
}

void Engine::Voices::fade(std::size_t lane, double seconds) {
  Voice& voice = voices[lane];
  const double step = -1.0 / std::max(1.0, seconds * machine.rate_hz);
  voice.gain_step = std::min(voice.gain_step, step);
  voice.fading = true;
  voice.held = voice.sustained = false;
}

std::size_t Engine::Voices::voices_allowed() const {
  return std::min(static_cast<std::size_t>(std::max(1, playing.voices)), most_voices);
}

void Engine::Voices::limit_voices(std::size_t most) {
  most_voices = std::max<std::size_t>(1, most);
  std::size_t live = 0;
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    live += is_live(lane) ? 1 : 0;
  }
  const auto is_heard_less = [](const Voice& a, const Voice& b) {
    const bool a_is_up = !a.held && !a.sustained;
    const bool b_is_up = !b.held && !b.sustained;
    return a_is_up != b_is_up ? a_is_up : a.level < b.level;
  };
  for (; live > voices_allowed(); --live) {
    std::size_t least = voices.size();
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      const bool may_go = is_live(lane) && !(lane == last && voices[lane].held);
      if (may_go && (least == voices.size() || is_heard_less(voices[lane], voices[least]))) {
        least = lane;
      }
    }
    shed += voices[least].level > quiet_level ? 1 : 0;
    fade(least, steal_fade_s);
  }
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
  if (live >= voices_allowed()) {
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
  apply_changes();
  if (!is_idle) {
    std::visit([&](auto& b) { segment_in(b, inputs, outputs, at, frames); }, bank);
  }
  remember_audio(inputs, at + frames);
  since_update += frames;
  if (since_update == max_block_frames) {
    since_update = 0;
    update_all();
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
  for (std::size_t p = 0; p < b.parts.size(); ++p) {
    PartBank<T>& part = b.parts[p];
    for (std::size_t first = 0; first < voices.size(); first += part.width) {
      const Pace pace = pace_of(b, p, first);
      if (pace.stands) {
        mix_still(p, first, part.width, outputs, at, frames);
      }
      if (pace.steps) {
        fill_drive(b, p, first, frames);
        fill_audio(b, part, first, inputs, at, frames);
        part.of(first).step({.frames = frames,
                             .value = b.value.data(),
                             .velocity = b.velocity.data(),
                             .audio = b.audio.data(),
                             .outputs = b.outputs.data()});
        mix(b, p, first, outputs, at, frames);
      }
    }
  }
  for (Voice& voice : voices) {
    for (std::size_t n = 0; n < frames && voice.gain_step != 0.0; ++n) {
      voice.gain = voice.next_gain(voice.gain);
    }
  }
  if (has_lost) {
    fade_lost();
  }
}

template <class T>
Engine::Voices::Pace Engine::Voices::pace_of(const Bank<T>& b, std::size_t p, std::size_t first) {
  if (still > 0) {
    return pace_of_some(b, p, first);
  }
  const std::size_t end = std::min(voices.size(), first + b.parts[p].width);
  return {.steps = std::any_of(voices.begin() + static_cast<std::ptrdiff_t>(first),
                               voices.begin() + static_cast<std::ptrdiff_t>(end),
                               [](const Voice& voice) { return voice.awake; })};
}

template <class T>
Engine::Voices::Pace Engine::Voices::pace_of_some(const Bank<T>& b, std::size_t p,
                                                  std::size_t first) {
  const Program& program = b.parts[p].program;
  Pace pace;
  for (std::size_t lane = first; lane < std::min(voices.size(), first + b.parts[p].width); ++lane) {
    if (!voices[lane].awake) {
      continue;
    }
    const auto moves = [&](const InputSlot& input) {
      return sound[input.input] != nullptr || driver(lane, input.input).is_moving();
    };
    if (watch(lane, p).is_still &&
        std::any_of(program.inputs.begin(), program.inputs.end(), moves)) {
      stir(lane, p);
    }
    const bool is_still = watch(lane, p).is_still;
    pace.steps |= !is_still;
    pace.stands |= is_still;
  }
  return pace;
}

template <class T>
void Engine::Voices::fill_rest(Bank<T>& b, const PartBank<T>& part, std::size_t first,
                               std::size_t frames) {
  const std::size_t width = part.width;
  const std::size_t step = part.program.inputs.size() * width;
  for (std::size_t i = 0; i < part.program.inputs.size(); ++i) {
    for (std::size_t k = 0; k < width; ++k) {
      b.row[i * width + k] =
          first + k < voices.size()
              ? static_cast<T>(driver(first + k, part.program.inputs[i].input).value())
              : T(0);
    }
  }
  if (b.still < frames * step) {
    std::fill_n(b.velocity.begin(), frames * step, T(0));
    b.still = frames * step;
  }
  const auto end = b.row.begin() + static_cast<std::ptrdiff_t>(step);
  if (b.filled_part == &part && b.filled_frames >= frames &&
      std::equal(b.row.begin(), end, b.filled.begin())) {
    return;
  }
  b.mixer.fill_rows(b.row.data(), step, frames, b.value.data());
  std::copy(b.row.begin(), end, b.filled.begin());
  b.filled_part = &part;
  b.filled_frames = frames;
}

template <class T>
void Engine::Voices::fill_drive(Bank<T>& b, std::size_t p, std::size_t first, std::size_t frames) {
  const PartBank<T>& part = b.parts[p];
  fill_rest(b, part, first, frames);
  const std::size_t step = part.program.inputs.size() * part.width;  // from frame to frame
  for (std::size_t i = 0; i < part.program.inputs.size(); ++i) {
    const InputSlot& slot = part.program.inputs[i];
    for (std::size_t lane = first; lane < std::min(voices.size(), first + part.width); ++lane) {
      InputDriver& mover = driver(lane, slot.input);
      if (!voices[lane].awake || !mover.is_moving()) {
        continue;
      }
      watch(lane, p).is_stirred = true;
      b.filled_part = nullptr;
      T* value = b.value.data() + i * part.width + lane - first;
      T* velocity = b.velocity.data() + i * part.width + lane - first;
      if (slot.is_force) {
        for (std::size_t n = 0; n < frames; ++n) {
          value[n * step] = static_cast<T>(mover.next_force().value);
        }
      } else {
        b.still = 0;
        mover.fill_positions(frames, step, value, velocity);
      }
    }
    if (const double* const audio = sound[slot.input]) {
      for (std::size_t lane = first; lane < std::min(voices.size(), first + part.width); ++lane) {
        watch(lane, p).is_stirred = true;
      }
      b.filled_part = nullptr;
      AudioInput<T> added{.samples = audio,
                          .frames = frames,
                          .scale = audio_scale(slot.input),
                          .before = audio_before[slot.input],
                          .replaces = playing.bare,
                          .value = b.value.data() + i * part.width,
                          .velocity = nullptr,
                          .step = step,
                          .width = part.width};
      if (!slot.is_force) {
        b.still = 0;
        added.velocity = b.velocity.data() + i * part.width;
      }
      b.mixer.add_audio(added);
    }
  }
}

template <class T>
void Engine::Voices::fill_audio(Bank<T>& b, const PartBank<T>& part, std::size_t first,
                                std::span<const double* const> inputs, std::size_t at,
                                std::size_t frames) {
  const Program& program = part.program;
  T* value = b.audio.data();
  bool is_beyond = false;
  for (std::size_t n = at; n < at + frames && !program.audio_coefficients.empty(); ++n) {
    for (const AudioParameter& audio : program.audio_parameters) {
      const auto channel = static_cast<std::size_t>(audio.channel);
      const bool is_there = channel < inputs.size() && inputs[channel] != nullptr;
      const double wanted = is_there ? inputs[channel][n] : 0.0;
      parameters[audio.parameter] = within_limits(audio.parameter, wanted);
      is_beyond |= parameters[audio.parameter] != wanted;
    }
    for (const std::uint32_t c : program.audio_coefficients) {
      for (std::size_t lane = first; lane < first + part.width; ++lane) {
        *value++ =
            static_cast<T>(coefficient_value(program, program.coefficients[c], parameters,
                                             lane < voices.size() ? voices[lane].factor : 1.0));
      }
    }
  }
  beyond += is_beyond ? 1 : 0;
}

double Engine::Voices::audio_scale(std::size_t input) const {
  const double r = machine.inputs[input].is_force ? machine.rate_ratio : 1.0;
  return audio_control[input]->high * r * r;
}

bool Engine::Voices::is_silent(const double* audio, std::size_t frames) const {
  return std::visit([&](const auto& b) { return b.mixer.is_silent(audio, frames); }, bank);
}

bool Engine::Voices::sleeps_through(std::span<const double* const> inputs, std::size_t at,
                                    std::size_t frames) {
  if (playing.noise) {
    return false;  // it goes on
  }
  for (std::size_t input = 0; input < machine.inputs.size(); ++input) {
    const double* const audio = audio_for(input, inputs);
    if (audio != nullptr && !is_silent(audio + at, frames)) {
      return false;
    }
  }
  remember_audio(inputs, at + frames);
  since_update = (since_update + frames) % max_block_frames;
  return true;
}

const double* Engine::Voices::audio_for(std::size_t input,
                                        std::span<const double* const> inputs) const {
  const Control* const control = audio_control[input];
  return control != nullptr && control->number < inputs.size() ? inputs[control->number] : nullptr;
}

void Engine::Voices::listen(std::span<const double* const> inputs, std::size_t at,
                            std::size_t frames) {
  for (std::size_t input = 0; input < machine.inputs.size(); ++input) {
    sound[input] = nullptr;
    const double* const audio = audio_for(input, inputs);
    if (audio == nullptr) {
      continue;
    }
    const bool sounds = !is_silent(audio + at, frames);
    if (sounds) {
      wake(last);
    }
    if (sounds || audio_before[input] != 0.0 || playing.bare) {
      sound[input] = audio + at;
    }
  }
}

void Engine::Voices::remember_audio(std::span<const double* const> inputs, std::size_t end) {
  for (std::size_t input = 0; input < machine.inputs.size(); ++input) {
    if (const double* const audio = audio_for(input, inputs)) {
      audio_before[input] = audio_scale(input) * audio[end - 1];
    }
  }
}

template <class T>
void Engine::Voices::mix(Bank<T>& b, std::size_t p, std::size_t first,
                         std::span<double* const> outputs, std::size_t at, std::size_t frames) {
  PartBank<T>& part = b.parts[p];
  const std::size_t count = part.program.outputs.size();
  const Heard<T> heard{
      .outputs = b.outputs.data(), .frames = frames, .count = count, .width = part.width};
  b.mixer.find_peaks(heard, loudest, b.peak.data());
  std::fill(b.gain.begin(), b.gain.end(), 0.0);
  for (std::size_t lane = first; lane < std::min(voices.size(), first + part.width); ++lane) {
    Voice& voice = voices[lane];
    if (!voice.awake || (still > 0 && watch(lane, p).is_still)) {
      continue;
    }
    const auto peak = static_cast<double>(b.peak[lane - first]);
    if (!(peak < loudest)) {
      lose(b, p, lane, outputs, at, frames);
      continue;
    }
    voice.peak = std::max(voice.peak, peak);
    if (voice.gain_step != 0.0) {
      mix_some(b, p, lane, outputs, at, frames);
    } else {
      b.gain[lane - first] = playing.gain * voice.gain;
    }
  }
  std::copy_n(b.outputs.data() + (frames - 1) * part.row(), part.row(), part.last_of(first));
  for (std::size_t output = 0; output < count; ++output) {
    b.heard[output] = outputs[part.program.outputs[output].channel] + at;
  }
  b.mixer.add_voices(heard, b.gain.data(), b.heard.data());
  clear_wide_registers();
}

template <class T>
void Engine::Voices::mix_some(const Bank<T>& b, std::size_t p, std::size_t lane,
                              std::span<double* const> outputs, std::size_t at,
                              std::size_t frames) {
  const PartBank<T>& part = b.parts[p];
  const std::size_t count = part.program.outputs.size();
  double faded = voices[lane].gain;
  for (std::size_t n = 0; n < frames; ++n) {
    faded = voices[lane].next_gain(faded);
    const double gain = playing.gain * faded;
    for (std::size_t output = 0; output < count; ++output) {
      const std::size_t from = (n * count + output) * part.width + lane % part.width;
      outputs[part.program.outputs[output].channel][at + n] +=
          gain * static_cast<double>(b.outputs[from]);
    }
  }
}

template <class T>
void Engine::Voices::lose(Bank<T>& b, std::size_t p, std::size_t lane,
                          std::span<double* const> outputs, std::size_t at, std::size_t frames) {
  PartBank<T>& part = b.parts[p];
  const std::size_t count = part.program.outputs.size();
  const auto is_sane = [&](std::size_t n) {
    for (std::size_t output = 0; output < count; ++output) {
      const T y = b.outputs[(n * count + output) * part.width + lane % part.width];
      if (!(std::fabs(static_cast<double>(y)) < loudest)) {
        return false;
      }
    }
    return true;
  };
  std::size_t sane = 0;
  while (sane < frames && is_sane(sane)) {
    ++sane;
  }
  mix_some(b, p, lane, outputs, at, sane);
  resets += voices[lane].lost ? 0 : 1;
  voices[lane].lost = has_lost = true;
  lay_still(sane > 0 ? b.outputs.data() + (sane - 1) * part.row() : part.last_of(lane), part.width,
            lane, p);
  part.of(lane).reset(lane % part.width);  // nothing is to be slow for numbers that are none
  mix_held(p, lane, outputs, at, sane, frames);
}

void Engine::Voices::update_all() {
  ++updates;
  if (is_idle) {
    return;
  }
  look_around();
  is_idle = true;
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    if (voices[lane].awake) {
      update(lane);
    }
    is_idle = is_idle && !voices[lane].awake;
  }
  if (is_idle || updates % updates_per_reading == 0) {
    read_energy();
  }
}

void Engine::Voices::update(std::size_t lane) {
  Voice& voice = voices[lane];
  constexpr std::size_t frames = max_block_frames;
  const double peak = voice.peak * playing.gain * voice.gain;
  voice.peak = 0.0;
  voice.level = std::max(peak, voice.level * level_kept);
  if (voice.fading && voice.gain == 0.0) {
    voice = Voice{};
    return;
  }
  voice.quiet_frames = peak < quiet_level ? voice.quiet_frames + frames : 0;
  if (playing.bare || voice.held || voice.sustained ||
      static_cast<double>(voice.quiet_frames) < quiet_s * machine.rate_hz) {
    return;
  }
  voice.quiet_frames = 0;
  for (std::size_t input = 0; input < machine.inputs.size(); ++input) {
    if (driver(lane, input).is_moving()) {
      return;
    }
  }
  if (is_at_rest(lane)) {
    const double frequency_hz = voice.frequency_hz;
    for (std::size_t p = 0; p < elements.size(); ++p) {
      forget(watch(lane, p));
    }
    voice = Voice{};
    voice.frequency_hz = frequency_hz;
  }
}

bool Engine::Voices::is_at_rest(std::size_t lane) const {
  const double bound = quiet_level / std::max(1e-30, playing.gain);
  return std::visit(
      [&](const auto& b) {
        return std::all_of(b.parts.begin(), b.parts.end(), [&](const auto& part) {
          return part.of(lane).is_near_start(lane % part.width, bound);
        });
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
