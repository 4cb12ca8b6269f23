// core: the messages of controllers in a mapping: knobs, encoders, buttons and pads.
#pragma once

#include <cstdint>

namespace ressort {

enum class ControllerSource : std::uint8_t { controller, nrpn, note };

// The meaning of a value. A relative value is a number of steps, which makers write in three ways.
enum class ControllerMode : std::uint8_t {
  absolute,
  twos_complement,  // 1 is a step up, 127 a step down
  offset,           // 65 is a step up, 63 a step down
  sign_magnitude,   // 1 is a step up, 65 a step down
};

struct ControllerInput {
  static constexpr std::uint8_t any_channel = 255;

  ControllerSource source = ControllerSource::controller;
  std::uint16_t number = 0;
  std::uint8_t channel = any_channel;  // 0..15
  ControllerMode mode = ControllerMode::absolute;
  bool has_14_bits = false;  // of a controller: with the controller 32 above it
  bool picks_up = false;     // acts once it has met or crossed the present value
  bool sends = false;        // the present value is sent back

  // Returns whether one message can come from both.
  bool is_same_source(const ControllerInput& other) const {
    return source == other.source && number == other.number &&
           (channel == other.channel || channel == any_channel || other.channel == any_channel);
  }
  // Number of the highest value.
  int most() const { return has_14_bits ? 16383 : 127; }
  bool operator==(const ControllerInput&) const = default;
};

// Returns the steps of a relative controller's value 0..127, below 0 downwards.
constexpr int steps_of(ControllerMode mode, int value) {
  switch (mode) {
    case ControllerMode::twos_complement:
      return value < 64 ? value : value - 128;
    case ControllerMode::offset:
      return value - 64;
    case ControllerMode::sign_magnitude:
      return value < 64 ? value : 64 - value;
    case ControllerMode::absolute:
      break;
  }
  return 0;
}

}  // namespace ressort
