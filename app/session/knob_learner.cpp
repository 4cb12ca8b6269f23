#include "app/session/knob_learner.h"

#include <algorithm>
#include <cstdlib>

#include "core/midi_number.h"

namespace ressort::session {
namespace {

using enum MidiNumber::Controller;

bool is_knob(int controller) {
  constexpr int others[] = {0, 32, sustain_pedal, sostenuto_pedal, soft_pedal};
  return controller < MidiNumber::all_sound_off &&
         std::ranges::find(others, controller) == std::end(others);
}

// An absolute knob sends every value once, an encoder the same few steps again and again. Without
// a turn back, steps up in two's complement equal those of sign and magnitude, and steps down of
// sign and magnitude those up of the offset.
ControllerMode mode_of(const std::vector<int>& values) {
  constexpr int most_steps = 12;  // in one message
  constexpr int least_repeats = 2;
  int repeats = 0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    repeats += values[i] == values[i - 1] ? 1 : 0;
  }
  using enum ControllerMode;
  for (const ControllerMode mode : {twos_complement, offset, sign_magnitude}) {
    const bool is_possible = std::ranges::all_of(values, [&](int value) {
      const int steps = std::abs(steps_of(mode, value));
      return steps >= 1 && steps <= most_steps;
    });
    if (is_possible && repeats >= least_repeats) {
      return mode;
    }
  }
  return absolute;
}

}  // namespace

KnobLearner::Source& KnobLearner::source(ControllerSource kind, int number, int channel) {
  const ControllerInput input{.source = kind,
                              .number = static_cast<std::uint16_t>(number),
                              .channel = static_cast<std::uint8_t>(channel)};
  const auto known = std::ranges::find(sources_, input, &Source::input);
  return known != sources_.end() ? *known : sources_.emplace_back(Source{.input = input});
}

void KnobLearner::add(int channel, int controller, int value) {
  std::optional<int>& number = nrpn_[static_cast<std::size_t>(channel) % nrpn_.size()];
  switch (controller) {
    case unregistered_coarse:
      number = value << 7 | (number.value_or(0) & 0x7f);
      return;
    case unregistered_fine:
      number = (number.value_or(0) & 0x3f80) | value;
      return;
    case registered_coarse:
    case registered_fine:
      number.reset();
      return;
    case data_entry:
    case data_entry_fine:
    case data_increment:
    case data_decrement:
      if (number) {
        Source& nrpn = source(ControllerSource::nrpn, *number, channel);
        if (controller == data_entry_fine) {
          ++nrpn.low_halves;
        } else {
          nrpn.values.push_back(controller == data_entry ? value : 0);  // 0: a step
        }
      }
      return;
    default:
      if (is_knob(controller)) {
        source(ControllerSource::controller, controller, channel).values.push_back(value);
      }
  }
}

std::optional<ControllerInput> KnobLearner::found() const {
  constexpr std::size_t least_pairs = 2;
  const Source* best = nullptr;
  for (const Source& next : sources_) {
    best = best == nullptr || next.values.size() > best->values.size() ? &next : best;
  }
  if (best == nullptr) {
    return std::nullopt;
  }
  ControllerInput input = best->input;
  if (input.source == ControllerSource::nrpn) {
    input.has_14_bits = best->low_halves > 0;
  } else {
    const int coarse = input.number % first_low_half;
    const auto count = [&](int number) {
      ControllerInput half = best->input;
      half.number = static_cast<std::uint16_t>(number);
      const auto known = std::ranges::find(sources_, half, &Source::input);
      return known != sources_.end() ? known->values.size() : 0;
    };
    if (input.number < 2 * first_low_half &&
        std::min(count(coarse), count(coarse + first_low_half)) >= least_pairs) {
      input.number = static_cast<std::uint16_t>(coarse);
      input.has_14_bits = true;
    }
  }
  input.mode = input.has_14_bits ? ControllerMode::absolute : mode_of(best->values);
  return input;
}

}  // namespace ressort::session
