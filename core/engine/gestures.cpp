#include "core/engine/gestures.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace ressort::engine {
namespace {

bool has_turn(const Control& control, std::uint64_t stroke) {
  return control.turns < 2 || stroke % control.turns == control.turn;
}

bool matches(const Control& control, Source source, int number) {
  const bool is_in_range = number >= control.lowest_key && number <= control.highest_key;
  const bool is_of_key = source == Source::note || source == Source::release;
  return control.source == source && (is_of_key                      ? is_in_range
                                      : source == Source::controller ? number == control.number
                                                                     : true);
}

Stroke stroke_of(const Control& control, double amount = 1.0, double key = middle_c) {
  return {.amount = amount, .has_control = true, .settings = control.settings_on(key)};
}

// Returns the key of the string that a control with fixed tuning strikes, if it has keys of its
// own. A control that is open to lower or to higher keys plays the string of its last or first key.
std::optional<double> string_of(const Control& control, double key) {
  const bool is_open_below = control.lowest_key == 0;
  const bool is_open_above = control.highest_key == 127;
  if (is_open_below && is_open_above) {
    return std::nullopt;
  }
  return is_open_below ? control.highest_key : is_open_above ? control.lowest_key : key;
}

double key_of(const Voice& voice) {
  return voice.has_key ? voice.key : middle_c;
}

}  // namespace

Gestures::Gestures(const Machine& machine, const Playing& playing)
    : machine_(machine),
      playing_(playing),
      drivers_(lane_count(playing.voices) * machine.inputs.size()),
      pitches_(lane_count(playing.voices), 1.0),
      keeps_speed_(machine.inputs.size()) {
  starts_.resize(Channels::count * machine.inputs.size());
  for (std::size_t input = 0; input < machine.inputs.size(); ++input) {
    set_starts(all_channels, input, machine.inputs[input].position);
  }
  for (const Control& control : playing.controls) {
    if (control.gesture != Gesture::parameter && !control.settings.follows_pitch) {
      keeps_speed_[control.target] = true;
    }
    if (const auto start = row_of(control.gesture).start) {
      set_starts(all_channels, control.target,
                 start(stroke_on(control.target, stroke_of(control))));
    }
  }
}

void Gestures::continue_from(const Gestures& from) {
  drivers_ = from.drivers_;
  pitches_ = from.pitches_;
  starts_ = from.starts_;
  strokes_ = from.strokes_;
}

void Gestures::reset_drivers(const Voice& voice, std::size_t lane) {
  const std::size_t inputs = machine_.inputs.size();
  for (std::size_t input = 0; input < inputs; ++input) {
    driver(lane, input).place(starts_[voice.channel * inputs + input]);
  }
  // The rest position of these gestures depends on the key. A pluck starts on the side where the
  // last one ended.
  for (const Control& control : playing_.controls) {
    const GestureRow& gesture = row_of(control.gesture);
    if (!control.by_key.empty() && gesture.start != nullptr && gesture.goal == nullptr &&
        voice.has_key && matches(control, Source::note, voice.key)) {
      const double middle = machine_.inputs[control.target].position;
      const double last = starts_[voice.channel * inputs + control.target] - middle;
      const double start =
          gesture.start(stroke_on(control.target, stroke_of(control, 1.0, voice.key))) - middle;
      driver(lane, control.target).place(middle + (last * start < 0.0 ? -start : start));
    }
  }
}

void Gestures::set_starts(ChannelMask channels, std::size_t input, double start) {
  const std::size_t inputs = machine_.inputs.size();
  if (playing_.tuning == Tuning::fixed) {
    channels = all_channels;  // there is one instrument
  }
  for (unsigned channel = 0; channel < Channels::count; ++channel) {
    double& here = starts_[channel * inputs + input];
    here = has_channel(channels, channel) ? start : here;
  }
}

void Gestures::wake(Keyboard& keyboard, std::size_t lane, std::uint8_t channel) {
  if (keyboard.wake(lane)) {
    Voice& voice = keyboard.voices[lane];
    voice.channel = channel;
    reset_drivers(voice, lane);
  }
}

// Adds the data of the input that a gesture needs.
Stroke Gestures::stroke_on(std::size_t input, Stroke stroke) const {
  stroke.is_force = machine_.inputs[input].is_force;
  stroke.middle = machine_.inputs[input].position;
  stroke.rate_ratio = machine_.rate_ratio;
  stroke.rate_hz = machine_.rate_hz;
  stroke.bare = playing_.bare;
  return stroke;
}

// The count of notes is the same in all engines that share them (NoteShare), so their seeds are,
// too.
std::uint64_t Gestures::seed_of(const Voice& voice, std::size_t input) const {
  return strokes_ << 32 | std::uint64_t{voice.is_released} << 31 | std::uint64_t{voice.key} << 24 |
         input;
}

void Gestures::play(const GestureRow& gesture, std::size_t input, Stroke stroke, const Scope& scope,
                    std::optional<std::size_t> lane, Keyboard& keyboard, Parameters& parameters) {
  const Voices& voices = keyboard.voices;
  const std::optional<std::size_t> latest = lane ? lane : keyboard.latest_of(scope);
  const auto first_channel = static_cast<std::uint8_t>(std::countr_zero(scope.channels));
  stroke = stroke_on(input, stroke);
  if (gesture.goal != nullptr) {
    const double goal = gesture.goal(stroke);
    if (scope.key == Scope::every_key) {
      set_starts(scope.channels, input, goal);
    }
    for (std::size_t one = 0; one < voices.size(); ++one) {
      const bool is_addressed = keyboard.is_addressed(voices[one], scope) || one == latest;
      if (is_addressed && (voices[one].awake || !gesture.is_touch)) {
        wake(keyboard, one, first_channel);
        driver(one, input).follow(goal, stroke.pole_of_position());
      }
    }
    return;
  }
  if (!latest) {
    return;
  }
  wake(keyboard, *latest, first_channel);
  Voice& voice = keyboard.voices[*latest];
  set_pitch(*latest, std::sqrt(keyboard.factor_of(voice, parameters.highest_factor())));
  stroke.pitch = stroke.settings.follows_pitch ? pitches_[*latest] : 1.0;
  stroke.seed = seed_of(voice, input);
  stroke.hardness = playing_.hardness ? parameters.values()[*playing_.hardness] : 0.0;
  // A voice's gain applies to all that rings in it. With fixed tuning all keys strike one network,
  // so the gain must not follow each blow: it is the loudest blow's, and a softer blow has less
  // force.
  if (gesture.is_blow && stroke.settings.has_level && playing_.tuning == Tuning::fixed) {
    stroke.share = stroke.level() / stroke.settings.highest_level();
  }
  gesture.play(driver(*latest, input), stroke);
  if (stroke.string_hz > 0.0 && !voice.is_new) {
    driver(*latest, input).wait_for_motion(stroke.string_hz / machine_.rate_hz);
  }
  if (stroke.settings.has_level && stroke.amount != 0.0) {
    const double rise_s = gesture.gesture == Gesture::bow ? stroke.length_s() : 0.0;
    keyboard.set_strength(voice, stroke.level() / stroke.share, rise_s);
  }
  if (stroke.rest) {
    set_starts(scope.channels, input, *stroke.rest);
  }
  if (stroke.pressure) {
    play(Source::pressure, 0, *stroke.pressure, scope, keyboard, parameters);
  }
}

void Gestures::play(const Control& control, double amount, const Scope& scope, Keyboard& keyboard,
                    Parameters& parameters, double key, std::optional<std::size_t> lane) {
  Stroke stroke = stroke_of(control, amount, key);
  if (control.gesture == Gesture::parameter) {
    return parameters.set(control.target, stroke.mapped());
  }
  if (row_of(control.gesture).is_blow && playing_.tuning == Tuning::fixed) {
    const std::optional<double> string = string_of(control, key);
    stroke.string_hz = string ? playing_.keys_hz[static_cast<std::size_t>(*string)] : 0.0;
  }
  play(row_of(control.gesture), control.target, stroke, scope, lane, keyboard, parameters);
}

void Gestures::play(Source source, int number, double amount, const Scope& scope,
                    Keyboard& keyboard, Parameters& parameters) {
  for (const Control& control : playing_.controls) {
    if (matches(control, source, number) && has_turn(control, strokes_)) {
      play(control, amount, scope, keyboard, parameters,
           source == Source::note ? number : middle_c);
    }
  }
  strokes_ += source == Source::note ? 1 : 0;
}

void Gestures::follow_other_engine(int key, double amount, std::uint8_t channel, Keyboard& keyboard,
                                   Parameters& parameters) {
  const Scope scope{.channels = channel_bit(channel)};
  for (const Control& control : playing_.controls) {
    if (!matches(control, Source::note, key) || !has_turn(control, strokes_)) {
      continue;
    }
    const GestureRow& gesture = row_of(control.gesture);
    if (control.gesture == Gesture::parameter || gesture.goal != nullptr) {
      play(control, amount, scope, keyboard, parameters, key);
      continue;
    }
    Stroke stroke = stroke_on(control.target, stroke_of(control, amount, key));
    InputDriver silent;
    silent.place(starts_[channel * machine_.inputs.size() + control.target]);
    gesture.play(silent, stroke);
    if (stroke.rest) {
      set_starts(scope.channels, control.target, *stroke.rest);
    }
  }
  ++strokes_;  // round robins advance in all engines alike
}

void Gestures::play_live(const Event& event, Keyboard& keyboard, Parameters& parameters) {
  const GestureRow& gesture = row_of(event.gesture);
  const auto play_on = [&](std::size_t input, Stroke stroke) {
    stroke.is_live = true;
    stroke.amount = event.value;
    stroke.second = event.value2;
    play(gesture, input, stroke, Scope{}, std::nullopt, keyboard, parameters);
  };
  const std::vector<Control>& controls = playing_.controls;
  if (gesture.live == Live::by_preset) {
    const auto control = std::find_if(controls.begin(), controls.end(), [&](const Control& row) {
      return row.gesture == event.gesture && machine_.inputs[row.target].number == event.index;
    });
    if (control != controls.end()) {
      const std::optional<std::size_t> latest = keyboard.latest_of(Scope{});
      play_on(control->target,
              stroke_of(*control, 1.0, latest ? key_of(keyboard.voices[*latest]) : middle_c));
    }
  } else if (gesture.live != Live::never) {
    for (std::size_t i = 0; i < machine_.inputs.size(); ++i) {
      if (machine_.inputs[i].number == event.index &&
          machine_.inputs[i].is_force == (gesture.live == Live::on_forces)) {
        play_on(i, Stroke{});
      }
    }
  }
}

void Gestures::end(const Voice& voice, std::size_t lane) {
  for (const Control& control : playing_.controls) {
    const auto release = row_of(control.gesture).release;
    if (release != nullptr && matches(control, Source::note, voice.key)) {
      release(driver(lane, control.target),
              stroke_on(control.target, stroke_of(control, 1.0, voice.key)));
    }
  }
}

void Gestures::play_release(std::size_t lane, Keyboard& keyboard, Parameters& parameters) {
  const Voice& voice = keyboard.voices[lane];
  const Scope scope{.channels = channel_bit(voice.channel), .key = voice.key};
  for (const Control& control : playing_.controls) {
    if (matches(control, Source::release, voice.key)) {
      play(control, voice.release_velocity, scope, keyboard, parameters, voice.key, lane);
    }
  }
}

void Gestures::set_pitch(std::size_t lane, double pitch) {
  for (std::size_t input = 0; input < machine_.inputs.size(); ++input) {
    if (!keeps_speed_[input]) {
      driver(lane, input).scale_speed(pitch / pitches_[lane]);
    }
  }
  pitches_[lane] = pitch;
}

void Gestures::follow_pitch_changes(const Voices& voices) {
  for (std::size_t lane = 0; lane < voices.size(); ++lane) {
    if (voices[lane].awake && voices[lane].is_retuned) {
      set_pitch(lane, std::sqrt(voices[lane].factor));
    }
  }
}

// The row includes the drivers of sleeping voices, so that these do not touch anything.
template <class T>
Gestures::RowState Gestures::write_row(Bank<T>& bank, const VoiceGroup& group,
                                       const Voices& voices) const {
  const PartBank<T>& part = bank.parts[group.part];
  const std::size_t lanes = std::min(part.width, voices.size() - group.first);
  RowState state;
  bool is_new = false;
  T* row = bank.held->row.data();
  for (const InputSlot& slot : part.program.inputs) {
    std::fill(row + lanes, row + part.width, T(0));
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const InputDriver& mover = driver(group.first + lane, slot.input);
      const T value = static_cast<T>(mover.value());
      is_new |= !(value == row[lane]);
      row[lane] = value;
      state.is_any_moving |= mover.is_moving() && voices[group.first + lane].awake;
      state.is_uniform &= value == row[0];
    }
    row += part.width;
  }
  state.is_uniform &= !state.is_any_moving;
  bank.held->filled_part = is_new ? nullptr : bank.held->filled_part;
  return state;
}

// Drivers at rest give every frame the same row and no velocity. The buffers keep that content from
// block to block as long as nothing else writes to them.
template <class T>
void Gestures::fill_constant(Bank<T>& bank, const PartBank<T>& part, std::size_t frames) {
  const std::size_t inputs = part.program.inputs.size();
  const std::size_t step = inputs * bank.lanes_of_rows(part);
  if (bank.held->zero_velocities < frames * step) {
    std::fill_n(bank.block->velocity.begin(), frames * step, T(0));
    bank.held->zero_velocities = frames * step;
  }
  if (bank.held->filled_part == &part && bank.held->filled_frames >= frames &&
      bank.held->filled_common == bank.is_common) {
    return;
  }
  const T* row = bank.held->row.data();
  if (bank.is_common) {
    for (std::size_t i = 0; i < inputs; ++i) {
      bank.held->common_row[i] = row[i * part.width];
    }
    row = bank.held->common_row.data();
  }
  bank.mixer.fill_rows(row, step, frames, bank.block->value.data());
  bank.held->filled_part = &part;
  bank.held->filled_frames = frames;
  bank.held->filled_common = bank.is_common;
}

template <class T>
void Gestures::fill_inputs(Bank<T>& bank, const VoiceGroup& group, std::size_t frames,
                           const RowState& row_state, const Voices& voices, EnergyWatch& watch) {
  const PartBank<T>& part = bank.parts[group.part];
  fill_constant(bank, part, frames);
  if (!row_state.is_any_moving) {
    return;
  }
  const std::size_t step = part.program.inputs.size() * part.width;  // distance from frame to frame
  for (std::size_t i = 0; i < part.program.inputs.size(); ++i) {
    const InputSlot& slot = part.program.inputs[i];
    for (std::size_t lane = group.first; lane < group.end; ++lane) {
      InputDriver& mover = driver(lane, slot.input);
      if (!voices[lane].awake || !mover.is_moving()) {
        continue;
      }
      watch.mark_driven(voices[lane], lane, group.part);
      bank.held->filled_part = nullptr;
      T* value = bank.block->value.data() + i * part.width + lane - group.first;
      T* velocity = bank.block->velocity.data() + i * part.width + lane - group.first;
      if (slot.is_force) {
        if (mover.waits_for_motion()) {
          std::array<T, 64> x;
          std::array<T, 64> v;
          if (part.width <= x.size() &&
              part.of(lane).read(std::span(&slot.node, 1), x.data(), v.data())) {
            mover.follow_motion(static_cast<double>(x[lane % part.width]),
                                static_cast<double>(v[lane % part.width]));
          }
        }
        mover.fill_forces(frames, step, value);
      } else {
        bank.held->zero_velocities = 0;
        mover.fill_positions(frames, step, value, velocity);
      }
    }
  }
}

template Gestures::RowState Gestures::write_row(Bank<float>&, const VoiceGroup&,
                                                const Voices&) const;
template Gestures::RowState Gestures::write_row(Bank<double>&, const VoiceGroup&,
                                                const Voices&) const;
template void Gestures::fill_inputs(Bank<float>&, const VoiceGroup&, std::size_t, const RowState&,
                                    const Voices&, EnergyWatch&);
template void Gestures::fill_inputs(Bank<double>&, const VoiceGroup&, std::size_t, const RowState&,
                                    const Voices&, EnergyWatch&);

}  // namespace ressort::engine
