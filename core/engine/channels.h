// core/engine: what controllers have said of each MIDI channel, as MIDI 1.0 and General MIDI 2 mean
// it: bend and its range, tuning, volume, expression, pedals.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace ressort {

// All functions: [audio] wait-free.
class Channels {
 public:
  static constexpr std::size_t count = 16;

  // What a controller has changed.
  enum class Change : std::uint8_t { nothing, pitch, level, sustain, sostenuto };

  // Of a number 0..127 that means something everywhere, for 0..1; the channel modes from 120 on are
  // the player's.
  Change turn(std::uint8_t channel, int number, double value);
  void bend(std::uint8_t channel, double amount) { of(channel).bend = amount; }
  // Bend, expression and pedals as at power on, and no parameter number; volume and tuning stay.
  void reset(std::uint8_t channel);
  void lift_pedals();  // of all

  // Of bend, coarse and fine tuning together.
  double semitones(std::uint8_t channel) const;
  // 1 for a volume of 100 and an expression of 127, and 40 dB a decade of either.
  double level(std::uint8_t channel) const;
  bool sustains(std::uint8_t channel) const { return of(channel).sustain >= 0.5; }
  // The share of the dampers that lies on the strings: all of it up to a quarter of the sustain
  // pedal's way, nothing from three quarters on.
  double damper(std::uint8_t channel) const;
  bool holds(std::uint8_t channel) const { return of(channel).sostenuto; }
  // What a key's velocity is multiplied by.
  double softness(std::uint8_t channel) const;

 private:
  static constexpr int no_parameter = 0x3fff;

  struct Channel {
    double bend = 0.0;
    double bend_range = 2.0;  // semitones
    double fine = 0.0;        // semitones
    double coarse = 0.0;
    double volume = 100.0 / 127.0;
    double expression = 1.0;
    double sustain = 0.0;
    bool sostenuto = false;
    double soft = 0.0;
    int parameter = no_parameter;  // registered, that data entry is for
    int data = 0;                  // its 14 bits, as entered last
  };
  Channel& of(std::uint8_t channel) { return channels_[channel % count]; }
  const Channel& of(std::uint8_t channel) const { return channels_[channel % count]; }
  static Change enter(Channel& channel);

  std::array<Channel, count> channels_;
};

}  // namespace ressort
