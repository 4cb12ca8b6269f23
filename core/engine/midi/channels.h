// core/engine/midi: what controllers have said of each MIDI channel, as MIDI 1.0, General MIDI 2
// and MPE 1.0 mean it: bend and its range, tuning, volume, expression, pan, pedals, portamento,
// zones.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/rooms.h"

namespace ressort::engine {

// MIDI's channels, then one for each note that was given an ID: a member of a zone that is always
// there, so that it bends, is pressed and slides alone.
inline constexpr unsigned midi_channel_count = 16;
inline constexpr unsigned most_note_ids = 16;
inline constexpr unsigned channel_count = midi_channel_count + most_note_ids;

// Channels, each a bit.
using ChannelMask = std::uint32_t;
inline constexpr ChannelMask all_channels = 0xffffffff;
inline constexpr ChannelMask midi_channels = 0xffff;
constexpr ChannelMask channel_bit(unsigned channel) {
  return ChannelMask{1} << channel % channel_count;
}
constexpr bool has_channel(ChannelMask channels, unsigned channel) {
  return (channels >> channel % channel_count & 1) != 0;
}
// Of a note's ID, from 1.
constexpr std::uint8_t note_channel(unsigned id) {
  return static_cast<std::uint8_t>(midi_channel_count + (id - 1) % most_note_ids);
}
inline constexpr double note_bend_semitones = 48.0;  // of a bend of 1

// A gain for the outputs with odd numbers, which are heard on the left, and one for the even ones.
using SideGains = std::array<double, 2>;

// All functions: [audio] wait-free.
class Channels {
 public:
  static constexpr std::size_t count = channel_count;

  // `master` is the channel whose messages are for notes with an ID, too.
  explicit Channels(std::uint8_t master = 0);
  // What was said to the channels of another instrument, whose master may be another.
  void adopt(const Channels& from);

  // What a controller has changed.
  enum class Change : std::uint8_t { nothing, pitch, level, sustain, sostenuto, zones, modulation };

  // Of a number 0..127 that means something everywhere, for 0..1; the channel modes from 120 on are
  // the player's.
  Change turn(std::uint8_t channel, int number, double value);
  void bend(std::uint8_t channel, double amount) { of(channel).bend = amount; }
  // Bend, expression, pedals and portamento as at power on, and no parameter number, as RP-015
  // says: volume, pan, tuning, ranges and zones stay.
  void reset(std::uint8_t channel);
  void lift_pedals();  // of all
  // Channel modes 126 and 127: one voice or many, whatever the preset says.
  void set_mono(std::uint8_t channel, bool is_mono) { of(channel).is_mono = is_mono; }

  // Of an MPE zone. A message to a zone's master is for the whole zone.
  ChannelMask reach(std::uint8_t channel) const;
  bool is_member(std::uint8_t channel) const { return master_of(channel) != channel; }
  // Those whose zone the last Change::zones has made or ended: nothing is known of them any more.
  ChannelMask rezoned() const { return rezoned_; }
  ChannelMask members() const;  // of both zones
  // The channel itself where it is no member.
  std::uint8_t master_of(std::uint8_t channel) const;

  // Of bend, coarse and fine tuning of this channel together, and of its zone's master.
  double semitones(std::uint8_t channel) const;
  double zone_semitones(std::uint8_t channel) const {
    return is_member(channel) ? semitones(master_of(channel)) : 0.0;
  }
  // 1 for a volume of 100 and an expression of 127, and 40 dB a decade of either; its zone's on
  // top.
  double level(std::uint8_t channel) const;
  // Of the pan, its zone's added: 1 and 1 in the middle, and the sum of their squares is always 2.
  SideGains balance(std::uint8_t channel) const;
  bool sustains(std::uint8_t channel) const { return pedal(channel) >= 0.5; }
  // The share of the dampers that lies on the strings: all of it up to a quarter of the sustain
  // pedal's way, nothing from three quarters on.
  double damper(std::uint8_t channel) const;
  bool holds(std::uint8_t channel) const {
    return of(channel).sostenuto || zone(channel).sostenuto;
  }
  // What a key's velocity is multiplied by.
  double softness(std::uint8_t channel) const;
  // What is said here goes before the preset's.
  bool is_mono(std::uint8_t channel, bool preset) const {
    return zone(channel).is_mono.value_or(of(channel).is_mono.value_or(preset));
  }
  bool is_legato(std::uint8_t channel) const { return of(channel).legato || zone(channel).legato; }
  double glide_s(std::uint8_t channel, double preset) const;
  // What the modulation wheel says, 0..1 of all that it may do: where it stands, times its depth.
  double modulation(std::uint8_t channel) const;

 private:
  static constexpr int no_parameter = 0x3fff;
  static constexpr std::uint8_t lower_master = 0;
  static constexpr std::uint8_t upper_master = 15;

  struct Channel {
    double bend = 0.0;
    double bend_range = 2.0;  // semitones
    double wheel = 0.0;       // of modulation
    double wheel_depth = 1.0;
    double fine = 0.0;  // semitones
    double coarse = 0.0;
    double volume = 100.0 / 127.0;
    double expression = 1.0;
    double pan = 0.0;  // -1..1
    double sustain = 0.0;
    bool sostenuto = false;
    double soft = 0.0;
    bool legato = false;
    std::optional<bool> is_mono;
    std::optional<bool> glides;
    std::optional<double> glide_s;
    int parameter = no_parameter;  // registered, that data entry is for
    int data = 0;                  // its 14 bits, as entered last
  };
  Channel& of(std::uint8_t channel) { return channels_[channel % count]; }
  const Channel& of(std::uint8_t channel) const { return channels_[channel % count]; }
  const Channel& zone(std::uint8_t channel) const { return of(master_of(channel)); }
  double pedal(std::uint8_t channel) const {
    return std::max(of(channel).sustain, zone(channel).sustain);
  }
  Change enter(std::uint8_t channel);
  Change set_bend_range(std::uint8_t channel, double semitones);
  Change set_zone(std::uint8_t master, int members);

  std::array<Channel, count> channels_;
  std::uint8_t notes_master_;
  int lower_members_ = 0;  // channels that follow the first; 0: there is no such zone
  int upper_members_ = 0;  // channels before the last
  ChannelMask rezoned_ = 0;
};

}  // namespace ressort::engine
