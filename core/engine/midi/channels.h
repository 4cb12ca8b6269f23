// core/engine/midi: the controller state of each MIDI channel by MIDI 1.0, General MIDI 2 and MPE
// 1.0: bend and its range, tuning, volume, expression, pan, pedals, portamento, zones.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/rooms.h"

namespace ressort::engine {

// The MIDI channels, then one channel for each note with an ID. A note with an ID is a member of a
// permanent zone, so it has its own bend, pressure and slide.
inline constexpr unsigned midi_channel_count = 16;
inline constexpr unsigned most_note_ids = 16;
inline constexpr unsigned channel_count = midi_channel_count + most_note_ids;

// A set of channels, one bit each.
using ChannelMask = std::uint32_t;
inline constexpr ChannelMask all_channels = 0xffffffff;
inline constexpr ChannelMask midi_channels = 0xffff;
constexpr ChannelMask channel_bit(unsigned channel) {
  return ChannelMask{1} << channel % channel_count;
}
constexpr bool has_channel(ChannelMask channels, unsigned channel) {
  return (channels >> channel % channel_count & 1) != 0;
}
// Returns the channel of a note's ID, which counts from 1.
constexpr std::uint8_t note_channel(unsigned id) {
  return static_cast<std::uint8_t>(midi_channel_count + (id - 1) % most_note_ids);
}
inline constexpr double note_bend_semitones = 48.0;  // bend range of a note with an ID

// The gains of the odd outputs (left) and of the even outputs (right).
using SideGains = std::array<double, 2>;

// All functions: [audio] wait-free.
class Channels {
 public:
  static constexpr std::size_t count = channel_count;
  static constexpr int modulation_wheel = 1;  // controller number

  // `master`: the channel whose messages also apply to notes with an ID.
  explicit Channels(std::uint8_t master = 0);
  // Takes over the channels of another instrument, but keeps the own master.
  void adopt(const Channels& from);

  // The property that a controller has changed.
  enum class Change : std::uint8_t { nothing, pitch, level, sustain, sostenuto, zones, modulation };

  // Applies a controller 0..119 with a value 0..1. The player handles the channel modes from 120
  // on.
  Change turn(std::uint8_t channel, int number, double value);
  void bend(std::uint8_t channel, double amount) { of(channel).bend = amount; }
  // Resets bend, expression, pedals, portamento and the selected parameter number (MIDI RP-015).
  // Volume, pan, tuning, ranges and zones are kept.
  void reset(std::uint8_t channel);
  void lift_pedals();  // on all channels
  // Channel modes 126 and 127, which override the preset.
  void set_mono(std::uint8_t channel, bool is_mono) { of(channel).is_mono = is_mono; }

  // Returns the channels to which a message applies: the whole MPE zone if `channel` is its master.
  ChannelMask reach(std::uint8_t channel) const;
  bool is_member(std::uint8_t channel) const { return master_of(channel) != channel; }
  // Returns whether a controller on this channel is to be ignored, because it is for a whole zone,
  // but came on a member channel: pedals, switches and channel modes (MPE 1.0, appendix E). A
  // note with an ID has a channel of its own, so its modes end just that note.
  bool is_ignored(std::uint8_t channel, int number) const;
  // The channels whose zone the last Change::zones has created or ended. Their state was reset.
  ChannelMask rezoned() const { return rezoned_; }
  ChannelMask members() const;  // members of all zones
  // Returns the zone's master, or the channel itself if it is not a member.
  std::uint8_t master_of(std::uint8_t channel) const;

  // Bend plus coarse and fine tuning, of this channel and of its zone's master.
  double semitones(std::uint8_t channel) const;
  double zone_semitones(std::uint8_t channel) const {
    return is_member(channel) ? semitones(master_of(channel)) : 0.0;
  }
  // Returns the gain by volume and expression, times that of the zone's master: 1 at volume 100 and
  // expression 127, with 40 dB per decade of either.
  double level(std::uint8_t channel) const;
  // Returns equal-power pan gains for the channel's pan plus the master's: 1 and 1 in the middle;
  // the sum of the squares is always 2.
  SideGains balance(std::uint8_t channel) const;
  bool sustains(std::uint8_t channel) const { return pedal(channel) >= 0.5; }
  // Returns the share of the damper that lies on the string. It falls from 1 at a quarter of the
  // sustain pedal's travel to 0 at the half, where sustains() begins.
  double damper(std::uint8_t channel) const;
  bool latches(std::uint8_t channel) const {
    return of(channel).sostenuto || zone(channel).sostenuto;
  }
  // Returns the factor on velocity by the soft pedal.
  double softness(std::uint8_t channel) const;
  // Controllers override the preset's value.
  bool is_mono(std::uint8_t channel, bool preset) const {
    return zone(channel).is_mono.value_or(of(channel).is_mono.value_or(preset));
  }
  bool is_legato(std::uint8_t channel) const { return of(channel).legato || zone(channel).legato; }
  double glide_s(std::uint8_t channel, double preset) const;
  // Returns the wheel's position times its depth, 0..1.
  double modulation(std::uint8_t channel) const;

 private:
  static constexpr int no_parameter = 0x3fff;
  static constexpr std::uint8_t lower_master = 0;
  static constexpr std::uint8_t upper_master = 15;

  struct Channel {
    double bend = 0.0;
    double bend_range = 2.0;  // semitones
    double wheel = 0.0;       // modulation
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
    int parameter = no_parameter;  // registered parameter selected for data entry
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
  int lower_members_ = 0;  // size of the lower zone, which follows channel 0; 0: no zone
  int upper_members_ = 0;  // size of the upper zone, which precedes channel 15
  ChannelMask rezoned_ = 0;
};

}  // namespace ressort::engine
