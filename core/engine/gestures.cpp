#include "core/engine/gestures.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace ressort::engine {
namespace {

bool has_turn(const Control& control, std::uint64_t stroke) {
  return control.turns < 2 || stroke % control.turns == control.turn;
}

bool is_asked(const Control& control, Source source, int number) {
  const bool is_in_range = number >= control.lowest_key && number <= control.highest_key;
  return control.source == source && (source == Source::note         ? is_in_range
                                      : source == Source::controller ? number == control.number
                                                                     : true);
}

Stroke stroke_of(const Control& control, double amount = 1.0) {
  return {.amount = amount,
          .has_control = true,
          .low = control.low,
          .high = control.high,
          .exponential = control.exponential,
          .travel = control.travel,
          .has_level = control.has_level,
          .low_db = control.low_db,
          .high_db = control.high_db,
          .longest_s = control.longest_s,
          .shortest_s = control.shortest_s};
}

}  // namespace

Gestures::Gestures(const Machine& machine, const Playing& playing, Voices& voices,
                   Parameters& parameters)
    : machine_(machine),
      playing_(playing),
      voices_(voices),
      parameters_(parameters),
      drivers_(voices.size() * machine.inputs.size()),
      pitches_(voices.size(), 1.0) {
  starts_.resize(Channels::count * machine.inputs.size());
  for (std::size_t input = 0; input < machine.inputs.size(); ++input) {
    set_starts(all_channels, input, machine.inputs[input].position);
  }
  for (const Control& control : playing.controls) {
    if (const auto start = row_of(control.gesture).start) {
      set_starts(all_channels, control.target, start(on_input(control.target, stroke_of(control))));
    }
  }
}

void Gestures::go_on_from(const Gestures& from) {
  drivers_ = from.drivers_;
  pitches_ = from.pitches_;
  starts_ = from.starts_;
  strokes_ = from.strokes_;
}

void Gestures::place(std::size_t lane) {
  const std::size_t inputs = machine_.inputs.size();
  for (std::size_t input = 0; input < inputs; ++input) {
    driver(lane, input).place(starts_[voices_[lane].channel * inputs + input]);
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

void Gestures::wake(std::size_t lane, std::uint8_t channel) {
  if (voices_.wake(lane)) {
    voices_[lane].channel = channel;
    place(lane);
  }
}

bool Gestures::is_moving(std::size_t lane) const {
  for (std::size_t input = 0; input < machine_.inputs.size(); ++input) {
    if (is_moving(lane, input)) {
      return true;
    }
  }
  return false;
}

bool Gestures::is_drawn(std::size_t lane) const {
  for (std::size_t input = 0; input < machine_.inputs.size(); ++input) {
    if (drivers_[lane * machine_.inputs.size() + input].is_drawn()) {
      return true;
    }
  }
  return false;
}

Stroke Gestures::on_input(std::size_t input, Stroke stroke) const {
  stroke.is_force = machine_.inputs[input].is_force;
  stroke.middle = machine_.inputs[input].position;
  stroke.rate_ratio = machine_.rate_ratio;
  stroke.rate_hz = machine_.rate_hz;
  stroke.bare = playing_.bare;
  return stroke;
}

void Gestures::play(const GestureRow& gesture, std::size_t input, Stroke stroke,
                    const Scope& scope) {
  const std::optional<std::size_t> last = voices_.last_of(scope);
  const auto first_channel = static_cast<std::uint8_t>(std::countr_zero(scope.channels));
  stroke = on_input(input, stroke);
  if (gesture.goal != nullptr) {
    const double goal = gesture.goal(stroke);
    if (scope.key == Scope::every_key) {
      set_starts(scope.channels, input, goal);
    }
    for (std::size_t lane = 0; lane < voices_.size(); ++lane) {
      const bool is_meant = voices_.hears(voices_[lane], scope) || lane == last;
      if (is_meant && (voices_[lane].awake || !gesture.is_touch)) {
        wake(lane, first_channel);
        driver(lane, input).follow(goal, stroke.pole_of_position());
      }
    }
    return;
  }
  if (!last) {
    return;
  }
  wake(*last, first_channel);
  set_pitch(*last, std::sqrt(voices_.factor_of(*last, parameters_.highest_factor())));
  stroke.pitch = pitches_[*last];
  gesture.play(driver(*last, input), stroke);
  if (stroke.has_level && stroke.amount != 0.0) {
    voices_.set_strength(*last, stroke.level());
  }
  if (stroke.rest) {
    set_starts(scope.channels, input, *stroke.rest);
  }
  if (stroke.pressure) {
    perform(Source::pressure, 0, *stroke.pressure, scope);
  }
}

void Gestures::perform(const Control& control, double amount, const Scope& scope) {
  const Stroke stroke = stroke_of(control, amount);
  if (control.gesture == Gesture::parameter) {
    return parameters_.set(control.target, stroke.mapped());
  }
  play(row_of(control.gesture), control.target, stroke, scope);
}

void Gestures::perform(Source source, int number, double amount, const Scope& scope) {
  for (const Control& control : playing_.controls) {
    if (is_asked(control, source, number) && has_turn(control, strokes_)) {
      perform(control, amount, scope);
    }
  }
  strokes_ += source == Source::note ? 1 : 0;
}

// Where the next hand starts is as if the voice were a new one here.
void Gestures::perform_elsewhere(int key, double amount, std::uint8_t channel) {
  const Scope scope{.channels = channel_bit(channel)};
  for (const Control& control : playing_.controls) {
    if (!is_asked(control, Source::note, key) || !has_turn(control, strokes_)) {
      continue;
    }
    const GestureRow& gesture = row_of(control.gesture);
    if (control.gesture == Gesture::parameter || gesture.goal != nullptr) {
      perform(control, amount, scope);
      continue;
    }
    Stroke stroke = on_input(control.target, stroke_of(control, amount));
    InputDriver elsewhere;
    elsewhere.place(starts_[channel * machine_.inputs.size() + control.target]);
    gesture.play(elsewhere, stroke);
    if (stroke.rest) {
      set_starts(scope.channels, control.target, *stroke.rest);
    }
  }
  ++strokes_;  // the turn passes on, whoever has it
}

void Gestures::perform_live(const Event& event) {
  const GestureRow& gesture = row_of(event.gesture);
  const auto play_it = [&](std::size_t input, Stroke stroke) {
    stroke.is_live = true;
    stroke.amount = event.value;
    stroke.second = event.value2;
    play(gesture, input, stroke, Scope{});
  };
  const std::vector<Control>& controls = playing_.controls;
  if (gesture.live == Live::by_preset) {
    const auto control = std::find_if(controls.begin(), controls.end(), [&](const Control& row) {
      return row.gesture == event.gesture && machine_.inputs[row.target].number == event.index;
    });
    if (control != controls.end()) {
      play_it(control->target, stroke_of(*control));
    }
  } else if (gesture.live != Live::never) {
    for (std::size_t i = 0; i < machine_.inputs.size(); ++i) {
      if (machine_.inputs[i].number == event.index &&
          machine_.inputs[i].is_force == (gesture.live == Live::on_forces)) {
        play_it(i, Stroke{});
      }
    }
  }
}

void Gestures::release(std::size_t lane) {
  for (const Control& control : playing_.controls) {
    const auto release = row_of(control.gesture).release;
    if (release != nullptr && is_asked(control, Source::note, voices_[lane].key)) {
      release(driver(lane, control.target), on_input(control.target, stroke_of(control)));
    }
  }
}

void Gestures::set_pitch(std::size_t lane, double pitch) {
  for (std::size_t input = 0; input < machine_.inputs.size(); ++input) {
    driver(lane, input).hasten(pitch / pitches_[lane]);
  }
  pitches_[lane] = pitch;
}

void Gestures::follow_pitches() {
  for (std::size_t lane = 0; lane < voices_.size(); ++lane) {
    if (voices_[lane].awake && voices_[lane].is_retuned) {
      set_pitch(lane, std::sqrt(voices_[lane].factor));
    }
  }
}

// Those of voices that sleep, too, so that their hands do not come to lie on anything.
template <class T>
Gestures::Rest Gestures::rest(Bank<T>& bank, const VoiceGroup& group) const {
  const PartBank<T>& part = bank.parts[group.part];
  const std::size_t lanes = std::min(part.width, voices_.size() - group.first);
  Rest rest;
  bool is_new = false;
  T* row = bank.row.data();
  for (const InputSlot& slot : part.program.inputs) {
    std::fill(row + lanes, row + part.width, T(0));
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const InputDriver& mover = driver(group.first + lane, slot.input);
      const T value = static_cast<T>(mover.value());
      is_new |= !(value == row[lane]);
      row[lane] = value;
      rest.is_any_moving |= mover.is_moving() && voices_[group.first + lane].awake;
      rest.is_alike &= value == row[0];
    }
    row += part.width;
  }
  rest.is_alike &= !rest.is_any_moving;
  bank.filled_part = is_new ? nullptr : bank.filled_part;
  return rest;
}

// Drivers that rest give every frame the same row.
template <class T>
void Gestures::fill_rest(Bank<T>& bank, const PartBank<T>& part, std::size_t frames) {
  const std::size_t inputs = part.program.inputs.size();
  const std::size_t step = inputs * bank.lanes_of_rows(part);
  if (bank.still < frames * step) {
    std::fill_n(bank.velocity.begin(), frames * step, T(0));
    bank.still = frames * step;
  }
  if (bank.filled_part == &part && bank.filled_frames >= frames &&
      bank.filled_common == bank.is_common) {
    return;
  }
  const T* row = bank.row.data();
  if (bank.is_common) {
    for (std::size_t i = 0; i < inputs; ++i) {
      bank.common_row[i] = row[i * part.width];
    }
    row = bank.common_row.data();
  }
  bank.mixer.fill_rows(row, step, frames, bank.value.data());
  bank.filled_part = &part;
  bank.filled_frames = frames;
  bank.filled_common = bank.is_common;
}

template <class T>
void Gestures::fill(Bank<T>& bank, const VoiceGroup& group, std::size_t frames, const Rest& rest,
                    EnergyWatch& watch) {
  const PartBank<T>& part = bank.parts[group.part];
  fill_rest(bank, part, frames);
  if (!rest.is_any_moving) {
    return;
  }
  const std::size_t step = part.program.inputs.size() * part.width;  // from frame to frame
  for (std::size_t i = 0; i < part.program.inputs.size(); ++i) {
    const InputSlot& slot = part.program.inputs[i];
    for (std::size_t lane = group.first; lane < group.end; ++lane) {
      InputDriver& mover = driver(lane, slot.input);
      if (!voices_[lane].awake || !mover.is_moving()) {
        continue;
      }
      watch.stir(voices_[lane], lane, group.part);
      bank.filled_part = nullptr;
      T* value = bank.value.data() + i * part.width + lane - group.first;
      T* velocity = bank.velocity.data() + i * part.width + lane - group.first;
      if (slot.is_force) {
        for (std::size_t n = 0; n < frames; ++n) {
          value[n * step] = static_cast<T>(mover.next_force().value);
        }
      } else {
        bank.still = 0;
        mover.fill_positions(frames, step, value, velocity);
      }
    }
  }
}

template Gestures::Rest Gestures::rest(Bank<float>&, const VoiceGroup&) const;
template Gestures::Rest Gestures::rest(Bank<double>&, const VoiceGroup&) const;
template void Gestures::fill(Bank<float>&, const VoiceGroup&, std::size_t, const Rest&,
                             EnergyWatch&);
template void Gestures::fill(Bank<double>&, const VoiceGroup&, std::size_t, const Rest&,
                             EnergyWatch&);

}  // namespace ressort::engine
