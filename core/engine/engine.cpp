// What events do.
#include "core/engine/engine.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/engine/voices.h"

namespace ressort {
namespace {

constexpr std::size_t ramp_frames = 128;  // of a parameter; a shorter ramp is heard as a click
constexpr double bend_semitones = 2.0;

}  // namespace

double Engine::Voices::middle(std::size_t input) const {
  return machine.inputs[input].is_force ? 0.0 : machine.inputs[input].position;
}

Stroke Engine::Voices::stroke_on(std::size_t input, const Control* control) const {
  Stroke stroke{.is_force = machine.inputs[input].is_force,
                .middle = middle(input),
                .rate_ratio = machine.rate_ratio,
                .rate_hz = machine.rate_hz,
                .bare = playing.bare};
  if (control != nullptr) {
    stroke.has_control = true;
    stroke.low = control->low;
    stroke.high = control->high;
    stroke.exponential = control->exponential;
    stroke.travel = control->travel;
  }
  return stroke;
}

void Engine::Voices::play(const GestureRow& gesture, std::size_t input, Stroke stroke) {
  if (gesture.goal != nullptr) {
    rest[input] = gesture.goal(stroke);
    for (std::size_t lane = 0; lane < voices.size(); ++lane) {
      if (voices[lane].awake || lane == last) {
        wake(lane);
        driver(lane, input).follow(rest[input], stroke.pole_of_position());
      }
    }
    return;
  }
  wake(last);
  stroke.pitch = std::sqrt(factor_of(last));
  gesture.play(driver(last, input), stroke);
  rest[input] = stroke.rest.value_or(rest[input]);
  if (stroke.pressure) {
    press(*stroke.pressure);
  }
}

void Engine::Voices::perform(const Control& control, double amount) {
  if (control.gesture == Gesture::parameter) {
    const Stroke turn{.amount = amount,
                      .has_control = true,
                      .low = control.low,
                      .high = control.high,
                      .exponential = control.exponential};
    return set_parameter(control.target, turn.mapped());
  }
  Stroke stroke = stroke_on(control.target, &control);
  stroke.amount = amount;
  play(row_of(control.gesture), control.target, stroke);
}

template <class Wanted>
void Engine::Voices::perform_all(double amount, Wanted&& wanted) {
  for (const Control& control : playing.controls) {
    if (wanted(control)) {
      perform(control, amount);
    }
  }
}

double Engine::Voices::within_limits(std::size_t index, double value) const {
  return std::max(playing.limits[index].lowest, std::min(value, playing.limits[index].highest));
}

double Engine::Voices::highest_factor() const {
  double way = 0.0;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Limits& home = playing.home[i];
    const Limits& limits = playing.limits[i];
    if (parameters[i] > home.highest) {
      way = std::max(way, (parameters[i] - home.highest) / (limits.highest - home.highest));
    } else if (parameters[i] < home.lowest) {
      way = std::max(way, (home.lowest - parameters[i]) / (home.lowest - limits.lowest));
    }
  }
  if (way == 0.0 || playing.away.empty()) {
    return std::max(1.0, playing.highest_factor);
  }
  const double steps = static_cast<double>(playing.away.size());
  return std::max(1.0, playing.away[static_cast<std::size_t>(std::ceil(way * steps)) - 1]);
}

void Engine::Voices::set_parameter(std::size_t index, double wanted) {
  if (index >= parameters.size()) {
    return;
  }
  const double value = within_limits(index, wanted);
  beyond += value == wanted ? 0 : 1;
  if (parameters[index] == value) {
    return;
  }
  if (turned.empty()) {
    highest_before = highest_factor();
  }
  if (!is_turned[index]) {
    is_turned[index] = has_changed = true;
    turned.push_back(static_cast<std::uint16_t>(index));
  }
  parameters[index] = value;
  note_change(static_cast<std::uint16_t>(index));
}

void Engine::Voices::note_change(std::uint16_t index) {
  if (changes.size() < max_changes &&
      std::find(changes.begin(), changes.end(), index) == changes.end()) {
    changes.push_back(index);
  }
}

template <class T>
void Engine::Voices::set_coefficient(PartBank<T>& part, std::size_t lane, std::uint32_t c,
                                     bool ramped) {
  const double value = coefficient_value(part.program, part.program.coefficients[c], parameters,
                                         voices[lane].factor);
  part.of(lane).coefficients.set(lane % part.width, c, value, ramped);
}

template <class T>
void Engine::Voices::set_coefficients(PartBank<T>& part, std::size_t lane, bool ramped) {
  if (voices[lane].is_new || voices[lane].is_retuned) {
    for (std::uint32_t c = 0; c < part.program.coefficients.size(); ++c) {
      set_coefficient(part, lane, c, ramped);
    }
    return;
  }
  for (const std::uint16_t index : turned) {
    for (const std::uint32_t c : part.program.depending[index]) {
      set_coefficient(part, lane, c, ramped);
    }
  }
}

template <class T>
void Engine::Voices::apply_changes(PartBank<T>& part, std::size_t p) {
  const bool has_turned = std::any_of(turned.begin(), turned.end(), [&](std::uint16_t index) {
    return !part.program.depending[index].empty();
  });
  for (std::size_t first = 0; first < voices.size(); first += part.width) {
    bool ramps = false;
    for (std::size_t lane = first; lane < std::min(voices.size(), first + part.width); ++lane) {
      const Voice& voice = voices[lane];
      if (!voice.awake || !(has_turned || voice.is_new || voice.is_retuned)) {
        continue;
      }
      stir(lane, p);
      if (voice.is_new) {
        part.of(lane).reset(lane % part.width);
      }
      const bool ramped = !voice.is_new && !playing.bare;
      set_coefficients(part, lane, ramped);
      ramps |= ramped;
    }
    if (ramps) {
      part.of(first).coefficients.ramp(ramp_frames);
    }
  }
}

void Engine::Voices::apply_changes() {
  if (!has_changed) {
    return;
  }
  const bool retunes = !turned.empty() && highest_factor() != highest_before;
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    Voice& voice = voices[lane];
    if (!voice.awake || !(retunes || voice.is_new || voice.is_retuned)) {
      continue;
    }
    const double factor = factor_for(lane);
    voice.is_retuned |= factor != voice.factor;
    voice.factor = factor;
  }
  std::size_t p = 0;
  each_part([&](auto& part) { apply_changes(part, p++); });
  for (Voice& voice : voices) {
    voice.is_new = voice.is_retuned = false;
  }
  for (const std::uint16_t index : turned) {
    is_turned[index] = false;
  }
  turned.clear();
  has_changed = false;
}

double Engine::Voices::factor_for(std::size_t lane) const {
  const Voice& voice = voices[lane];
  const double bent = std::exp2(bend * bend_semitones / 12.0);
  const double factor = voice.frequency_hz > 0.0
                            ? stiffness_factor(playing.mode_stiffness, playing.mode_damping,
                                               voice.frequency_hz * bent, machine.rate_hz)
                            : bent * bent;
  return std::min(factor, highest_factor());
}

void Engine::Voices::tune(std::size_t lane) {
  voices[lane].is_retuned = has_changed = true;
}

double Engine::Voices::factor_of(std::size_t lane) const {
  const Voice& voice = voices[lane];
  return voice.is_new || voice.is_retuned ? factor_for(lane) : voice.factor;
}

void Engine::Voices::note_on(const Event& event) {
  const int key = event.index;
  if (playing.tuning == Tuning::fixed) {
    // One instrument as it is written: a key is only a way to excite it.
    const std::size_t lane = voices[last].fading ? lane_for(key, event.channel) : last;
    if (!is_live(lane)) {
      start(lane, 0.0);
    }
  } else {
    const std::size_t lane = lane_for(key, event.channel);
    if (!is_live(lane) || voices[lane].key != key || voices[lane].frequency_hz == 0.0) {
      start(lane, playable_hz(key));
    }
    last = lane;
  }
  Voice& voice = voices[last];
  voice.key = static_cast<std::uint8_t>(key);
  voice.channel = event.channel;
  voice.held = true;
  voice.sustained = false;
  wake(last);
  perform_all(event.value, [&](const Control& control) {
    return control.source == Source::note && key >= control.lowest_key &&
           key <= control.highest_key;
  });
}

double Engine::Voices::playable_hz(int key) const {
  double hz = 440.0 * std::exp2((key + playing.transpose - 69) / 12.0);
  const double highest = highest_factor();
  while (hz > 1.0 && (hz >= 0.5 * machine.rate_hz ||
                      stiffness_factor(playing.mode_stiffness, playing.mode_damping, hz,
                                       machine.rate_hz) > highest)) {
    hz *= 0.5;
  }
  return hz;
}

void Engine::Voices::note_off(const Event& event) {
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    Voice& voice = voices[lane];
    if (voice.held && voice.key == event.index && voice.channel == event.channel) {
      voice.held = false;
      if (pedal[event.channel & 15]) {
        voice.sustained = true;
      } else {
        release(lane);
      }
    }
  }
}

void Engine::Voices::release(std::size_t lane) {
  Voice& voice = voices[lane];
  voice.held = voice.sustained = false;
  for (const Control& control : playing.controls) {
    if (control.source != Source::note || voice.key < control.lowest_key ||
        voice.key > control.highest_key) {
      continue;
    }
    if (const auto release = row_of(control.gesture).release) {
      release(driver(lane, control.target), stroke_on(control.target, &control));
    }
  }
  if (playing.release_s > 0.0) {
    fade(lane, playing.release_s);
  }
}

void Engine::Voices::controller(const Event& event) {
  const std::uint8_t channel = event.channel & 15;
  switch (event.index) {
    case 64: {
      pedal[channel] = event.value >= 0.5;
      for (std::size_t lane = 0; lane < voices.size() && !pedal[channel]; ++lane) {
        if (voices[lane].sustained && voices[lane].channel == channel) {
          release(lane);
        }
      }
      break;
    }
    case 120:
      panic();
      break;
    case 123:
      for (std::size_t lane = 0; lane < voices.size(); ++lane) {
        if (voices[lane].held && voices[lane].channel == channel) {
          release(lane);
        }
      }
      break;
    default:
      break;
  }
  perform_all(event.value, [&](const Control& control) {
    return control.source == Source::controller && control.number == event.index;
  });
}

void Engine::Voices::panic() {
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    if (voices[lane].awake) {
      fade(lane, steal_fade_s);
    }
  }
  pedal.fill(false);
}

const Control* Engine::Voices::control_for(int number, Gesture gesture) const {
  for (const Control& control : playing.controls) {
    if (control.gesture == gesture && machine.inputs[control.target].number == number) {
      return &control;
    }
  }
  return nullptr;
}

void Engine::Voices::press(double amount) {
  perform_all(amount, [](const Control& control) { return control.source == Source::pressure; });
}

void Engine::Voices::handle(const Event& event) {
  const bool is_number = std::isfinite(event.value) && std::isfinite(event.value2);
  if (!is_number && event.kind != EventKind::panic) {
    return;
  }
  switch (event.kind) {
    case EventKind::note_on:
      return note_on(event);
    case EventKind::note_off:
      return note_off(event);
    case EventKind::controller:
      return controller(event);
    case EventKind::pressure:
    case EventKind::key_pressure:
      return press(event.value);
    case EventKind::bend:
      bend = std::clamp(event.value, -1.0, 1.0);
      for (std::size_t lane = 0; lane < voices.size(); ++lane) {
        if (voices[lane].awake) {
          tune(lane);
        }
      }
      return;
    case EventKind::custom:
      if (event.index < playing.controls.size()) {
        perform(playing.controls[event.index], event.value);
      }
      return;
    case EventKind::parameter:
      return set_parameter(event.index, event.value);
    case EventKind::gesture:
      return play_live(event);
    case EventKind::panic:
      return panic();
  }
}

void Engine::Voices::play_live(const Event& event) {
  const GestureRow& gesture = row_of(event.gesture);
  const auto say = [&](std::size_t input, const Control* control) {
    Stroke stroke = stroke_on(input, control);
    stroke.is_live = true;
    stroke.amount = event.value;
    stroke.second = event.value2;
    play(gesture, input, stroke);
  };
  if (gesture.live == Live::by_preset) {
    if (const Control* control = control_for(event.index, event.gesture)) {
      say(control->target, control);
    }
  } else if (gesture.live != Live::never) {
    for (std::size_t i = 0; i < machine.inputs.size(); ++i) {
      if (machine.inputs[i].number == event.index &&
          machine.inputs[i].is_force == (gesture.live == Live::on_forces)) {
        say(i, nullptr);
      }
    }
  }
}

Engine::Engine(Machine machine, Playing playing, Precision precision, Isa isa,
               const Progress& progress)
    : voices_(std::make_unique<Voices>(std::move(machine), std::move(playing), precision, isa,
                                       progress)) {}

Engine::~Engine() = default;

void Engine::process(std::span<const Event> events, std::span<const double* const> inputs,
                     std::span<double* const> outputs, std::size_t frames) noexcept {
  for (double* const output : outputs) {
    std::fill(output, output + frames, 0.0);
  }
  std::size_t next = 0;
  std::size_t at = 0;
  while (at < frames) {
    while (next < events.size() && events[next].frame <= at) {
      voices_->handle(events[next++]);
    }
    const std::size_t until =
        next < events.size() ? std::min<std::size_t>(frames, events[next].frame) : frames;
    if (voices_->is_idle && voices_->sleeps_through(inputs, at, until - at)) {
      at = until;
      continue;
    }
    const std::size_t end = std::min(until, at + max_block_frames - voices_->since_update);
    voices_->segment(inputs, outputs, at, end - at);
    at = end;
  }
}

void Engine::limit_voices(int most) {
  voices_->limit_voices(static_cast<std::size_t>(std::max(1, most)));
}

int Engine::voice_count() const {
  return std::max(1, voices_->playing.voices);
}

std::span<const std::uint16_t> Engine::take_changes() {
  voices_->told.swap(voices_->changes);
  voices_->changes.clear();
  return voices_->told;
}

std::span<const std::uint32_t> Engine::take_creators() {
  const std::size_t first = std::exchange(voices_->creators_told, voices_->creators.size());
  return std::span(voices_->creators).subspan(first);
}

double Engine::parameter(std::uint16_t index) const {
  return voices_->parameters[index];
}

const Machine& Engine::machine() const {
  return voices_->machine;
}

int Engine::output_count() const {
  return static_cast<int>(voices_->machine.channels);
}

double Engine::rate_hz() const {
  return voices_->machine.rate_hz;
}

EngineMeters Engine::meters() const {
  EngineMeters meters = voices_->metered;
  for (const Voice& voice : voices_->voices) {
    meters.voices += voice.awake && !voice.fading && voice.level > quiet_level ? 1 : 0;
    meters.stepped += voice.awake && !voice.fading ? 1 : 0;
  }
  voices_->each_part([&](const auto& part) {
    for (std::size_t lane = 0; lane < voices_->voices.size(); ++lane) {
      if (voices_->voices[lane].awake) {
        const Awake awake = part.of(lane).awake();
        meters.modes += awake.of;
        meters.modes_awake += awake.modes;
      }
    }
  });
  meters.resets = voices_->resets;
  meters.stolen = voices_->stolen;
  meters.shed = voices_->shed;
  meters.beyond = voices_->beyond;
  meters.saved = voices_->saved();
  return meters;
}

double stiffness_factor(double mode_stiffness, double mode_damping, double frequency_hz,
                        double rate_hz) {
  if (!(mode_stiffness > 0.0)) {
    return 1.0;
  }
  const double theta = 2.0 * std::numbers::pi * frequency_hz / rate_hz;
  const double z = std::clamp(mode_damping, 0.0, 0.999);
  const double stiffness = 2.0 - z - 2.0 * std::sqrt(1.0 - z) * std::cos(theta);
  return std::max(1e-6, stiffness / mode_stiffness);
}

}  // namespace ressort
