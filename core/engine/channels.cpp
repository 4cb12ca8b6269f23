#include "core/engine/channels.h"

#include <algorithm>
#include <cmath>

namespace ressort {
namespace {

// Controllers, by their numbers in MIDI 1.0.
enum Number : int {
  data_entry = 6,
  volume = 7,
  expression = 11,
  data_entry_fine = 38,
  sustain_pedal = 64,
  sostenuto_pedal = 66,
  soft_pedal = 67,
  data_increment = 96,
  data_decrement = 97,
  unregistered_fine = 98,
  unregistered_coarse = 99,
  registered_fine = 100,
  registered_coarse = 101,
};

// Registered parameters.
enum Parameter : int { bend_range = 0, fine_tuning = 1, coarse_tuning = 2 };

constexpr int most_data = 0x3fff;

}  // namespace

Channels::Change Channels::turn(std::uint8_t index, int number, double value) {
  Channel& channel = of(index);
  const int bits = static_cast<int>(std::lround(127.0 * std::clamp(value, 0.0, 1.0)));
  const bool is_down = value >= 0.5;
  switch (number) {
    case volume:
      channel.volume = value;
      return Change::level;
    case expression:
      channel.expression = value;
      return Change::level;
    case sustain_pedal:
      channel.sustain = value;
      return Change::sustain;
    case sostenuto_pedal:
      channel.sostenuto = is_down;
      return Change::sostenuto;
    case soft_pedal:
      channel.soft = value;
      return Change::nothing;
    case registered_coarse:
      channel.parameter = (channel.parameter & 0x7f) | bits << 7;
      return Change::nothing;
    case registered_fine:
      channel.parameter = (channel.parameter & 0x3f80) | bits;
      return Change::nothing;
    case unregistered_coarse:
    case unregistered_fine:
      channel.parameter = no_parameter;
      return Change::nothing;
    case data_entry:
      channel.data = bits << 7;
      return enter(channel);
    case data_entry_fine:
      channel.data = (channel.data & 0x3f80) | bits;
      return enter(channel);
    case data_increment:
      channel.data = std::min(channel.data + 1, most_data);
      return enter(channel);
    case data_decrement:
      channel.data = std::max(channel.data - 1, 0);
      return enter(channel);
    default:
      return Change::nothing;
  }
}

Channels::Change Channels::enter(Channel& channel) {
  constexpr int middle = 64;
  const int coarse = channel.data >> 7;
  switch (channel.parameter) {
    case bend_range:
      channel.bend_range = coarse + (channel.data & 0x7f) / 100.0;
      return Change::pitch;
    case fine_tuning:
      channel.fine = (channel.data - (middle << 7)) / 8192.0;
      return Change::pitch;
    case coarse_tuning:
      channel.coarse = coarse - middle;
      return Change::pitch;
    default:
      return Change::nothing;
  }
}

void Channels::reset(std::uint8_t index) {
  Channel& channel = of(index);
  channel.bend = 0.0;
  channel.expression = 1.0;
  channel.sustain = 0.0;
  channel.sostenuto = false;
  channel.soft = 0.0;
  channel.parameter = no_parameter;
}

void Channels::lift_pedals() {
  for (Channel& channel : channels_) {
    channel.sustain = 0.0;
    channel.sostenuto = false;
    channel.soft = 0.0;
  }
}

double Channels::semitones(std::uint8_t channel) const {
  const Channel& c = of(channel);
  return c.bend * c.bend_range + c.coarse + c.fine;
}

double Channels::level(std::uint8_t channel) const {
  const Channel& c = of(channel);
  const double volume = c.volume * 127.0 / 100.0;
  return volume * volume * c.expression * c.expression;
}

double Channels::damper(std::uint8_t channel) const {
  // A lightly laid damper takes little: what it takes goes with the square of how far it lies.
  const double lies = std::clamp(1.5 - 2.0 * of(channel).sustain, 0.0, 1.0);
  return lies * lies;
}

double Channels::softness(std::uint8_t channel) const {
  constexpr double softest = 0.6;
  return 1.0 - (1.0 - softest) * of(channel).soft;
}

}  // namespace ressort
