#include "app/realtime/controllers.h"

#include <algorithm>
#include <cmath>

#include "core/engine/midi/channels.h"
#include "core/midi_number.h"

namespace ressort::realtime {
namespace {

using enum MidiNumber::Controller;

constexpr double steps_of_range = 127.0;  // of an encoder

int bits_of(double value) {
  return static_cast<int>(std::lround(127.0 * std::clamp(value, 0.0, 1.0)));
}

// Steps of 1/127 add up to the ends of the range only up to rounding.
double at_end(double position) {
  constexpr double rounding = 1e-9;
  return position < rounding ? 0.0 : position > 1.0 - rounding ? 1.0 : position;
}

}  // namespace

void ControllerMapper::use(const ControllerMap& map) {
  map_ = &map;
  for (std::size_t row = 0; row < map.count; ++row) {
    states_[row] = {.position = map.rows[row].target.start};
  }
}

void ControllerMapper::begin_chunk(const Engine* engine, std::uint32_t model) {
  engine_ = engine;
  model_ = model;
  for (std::size_t row = 0; map_ != nullptr && row < map_->count; ++row) {
    states_[row].is_newer = false;
  }
}

ControllerMapper::Result ControllerMapper::map(Event& event) {
  Move move;
  if (map_ == nullptr || map_->count == 0 || event.channel >= midi_channel_count ||
      event.model != 0) {
    return Result::passes;
  }
  if (const Result result = read(event, move); result != Result::mapped) {
    return result;
  }
  const auto& [input, target] = map_->rows[move.row];
  State& state = states_[move.row];
  double next = move.value;
  if (target.kind == EventKind::program || target.kind == EventKind::panic) {
    if (!is_press(move)) {
      return Result::nothing;
    }
  } else if (const double present = position(move.row); move.is_relative) {
    next = at_end(std::clamp(present + move.change, 0.0, 1.0));
  } else if (input.picks_up && !meets(move, present)) {
    return Result::nothing;
  } else {
    state.sent = static_cast<int>(std::lround(next * input.most()));
  }
  state.set = next;
  const bool is_controller = target.kind == EventKind::controller;
  event = {.frame = event.frame,
           .kind = target.kind,
           .channel = event.channel,
           .index = target.index,
           .model = is_controller ? 0 : target.model,
           .value = target.kind == EventKind::parameter ? target.range.value_at(next) : next};
  return target.kind == EventKind::program ? Result::action : Result::mapped;
}

// Finds the row of a message and the knob's move.
ControllerMapper::Result ControllerMapper::read(const Event& event, Move& move) {
  ControllerInput source{.number = event.index, .channel = event.channel};
  const int bits = bits_of(event.value);
  if (event.kind == EventKind::note_on || event.kind == EventKind::note_off) {
    source.source = ControllerSource::note;
    move.is_note_on = event.kind == EventKind::note_on;
    move.value = move.is_note_on ? event.value : 0.0;
    return find(source, false, move.row) ? Result::mapped : Result::passes;
  }
  if (event.kind != EventKind::controller) {
    return Result::passes;
  }
  if (event.index == data_entry || event.index == data_entry_fine ||
      (event.index >= data_increment && event.index <= registered_coarse)) {
    return read_number(event, move);
  }
  if (find(source, false, move.row)) {
    if (map_->rows[move.row].input.has_14_bits) {
      coarse_[event.index % coarse_.size()] = bits;
      read_value(bits << 7, move);
    } else if (map_->rows[move.row].input.mode == ControllerMode::absolute) {
      move.value = std::clamp(event.value, 0.0, 1.0);  // OSC has more than 7 bits
    } else {
      read_value(bits, move);
    }
    return Result::mapped;
  }
  if (event.index >= first_low_half) {
    source.number = static_cast<std::uint16_t>(event.index - first_low_half);
    if (find(source, true, move.row)) {
      read_value(coarse_[source.number % coarse_.size()] << 7 | bits, move);
      return Result::mapped;
    }
  }
  return Result::passes;
}

// Follows the messages of parameter numbers. The engine gets all that select a number, so that it
// ignores the data of others.
ControllerMapper::Result ControllerMapper::read_number(const Event& event, Move& move) {
  Number& number = numbers_[event.channel % numbers_.size()];
  const int bits = bits_of(event.value);
  switch (event.index) {
    case unregistered_coarse:
      number.selected = (number.selected & 0x7f) | bits << 7;
      return Result::passes;
    case unregistered_fine:
      number.selected = (number.selected & 0x3f80) | bits;
      return Result::passes;
    case registered_coarse:
    case registered_fine:
      number.selected = Number::none;
      return Result::passes;
    default:
      break;
  }
  const ControllerInput source{.source = ControllerSource::nrpn,
                               .number = static_cast<std::uint16_t>(number.selected),
                               .channel = event.channel};
  if (number.selected == Number::none || !find(source, false, move.row)) {
    return Result::passes;
  }
  const ControllerInput& input = map_->rows[move.row].input;
  if (event.index == data_increment || event.index == data_decrement) {
    move.is_relative = true;
    move.change = (event.index == data_increment ? 1.0 : -1.0) / input.most();
  } else if (event.index == data_entry) {
    number.data = bits << 7;
    read_value(input.has_14_bits ? number.data : bits, move);
  } else if (input.has_14_bits) {
    number.data = (number.data & 0x3f80) | bits;
    read_value(number.data, move);
  } else {
    return Result::nothing;  // the low half of a value of 7 bits
  }
  return Result::mapped;
}

void ControllerMapper::read_value(int value, Move& move) const {
  const ControllerInput& input = map_->rows[move.row].input;
  move.is_relative = input.mode != ControllerMode::absolute;
  move.change = steps_of(input.mode, value) / steps_of_range;
  move.value = static_cast<double>(value) / input.most();
}

// Finds the row of a source whose target the present model has.
bool ControllerMapper::find(const ControllerInput& source, bool is_low_half,
                            std::size_t& row) const {
  for (row = 0; row < map_->count; ++row) {
    const auto& [input, target] = map_->rows[row];
    if (input.is_same_source(source) && exists(target) && (input.has_14_bits || !is_low_half)) {
      return true;
    }
  }
  return false;
}

bool ControllerMapper::exists(const MappedTarget& target) const {
  return target.exists && (target.model == 0 || target.model == model_);
}

// A button presses when its value rises above the half, or comes again, because some buttons send
// no release. A knob presses once on its way up.
bool ControllerMapper::is_press(const Move& move) {
  State& state = states_[move.row];
  const bool is_repeated = state.has_moved && state.knob == move.value;
  const bool was_up = !state.has_moved || state.knob < 0.5;
  state.knob = move.value;
  state.has_moved = true;
  return move.is_note_on || (move.value >= 0.5 && (was_up || is_repeated));
}

// Returns whether the knob still has the present value, meets it, or crosses it.
bool ControllerMapper::meets(const Move& move, double present) {
  constexpr double rounding = 1e-6;
  constexpr double half_step = 0.5 / 127.0;
  State& state = states_[move.row];
  const bool holds = state.set >= 0.0 && std::fabs(state.set - present) <= rounding;
  const bool crosses = state.has_moved && (state.knob - present) * (move.value - present) <= 0.0;
  state.knob = move.value;
  state.has_moved = true;
  return holds || crosses || std::fabs(move.value - present) <= half_step;
}

double ControllerMapper::position(std::size_t row) const {
  const MappedTarget& target = map_->rows[row].target;
  return target.has_parameter && !states_[row].is_newer && engine_ != nullptr
             ? target.range.position_of(engine_->parameter(target.parameter))
             : states_[row].position;
}

void ControllerMapper::follow(const Event& event) {
  for (std::size_t row = 0; map_ != nullptr && row < map_->count; ++row) {
    const MappedTarget& target = map_->rows[row].target;
    if (target.kind == event.kind && target.index == event.index && exists(target)) {
      states_[row].position =
          event.kind == EventKind::parameter ? target.range.position_of(event.value) : event.value;
      states_[row].is_newer = true;
    }
  }
}

std::span<const MidiBytes> ControllerMapper::messages() {
  message_count_ = 0;
  for (std::size_t row = 0; map_ != nullptr && row < map_->count; ++row) {
    const auto& [input, target] = map_->rows[row];
    if (!input.sends || !exists(target)) {
      continue;
    }
    const auto number = static_cast<int>(std::lround(position(row) * input.most()));
    if (number != states_[row].sent) {
      states_[row].sent = number;
      add_messages(input, number);
    }
  }
  return {messages_.data(), message_count_};
}

void ControllerMapper::add_messages(const ControllerInput& input, int number) {
  const bool has_channel = input.channel != ControllerInput::any_channel;
  const auto status = static_cast<std::uint8_t>(0xb0 | (has_channel ? input.channel : 0));
  const auto add = [&](int controller, int value) {
    messages_[message_count_++] = {status, static_cast<std::uint8_t>(controller),
                                   static_cast<std::uint8_t>(value & 0x7f)};
  };
  const bool is_nrpn = input.source == ControllerSource::nrpn;
  if (is_nrpn) {
    add(unregistered_coarse, input.number >> 7);
    add(unregistered_fine, input.number);
  }
  const int controller = is_nrpn ? int{data_entry} : int{input.number};
  add(controller, input.has_14_bits ? number >> 7 : number);
  if (input.has_14_bits) {
    add(controller + first_low_half, number);
  }
}

}  // namespace ressort::realtime
