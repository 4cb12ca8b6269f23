#include "core/engine/midi/channels.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/midi_number.h"

namespace ressort::engine {
namespace {

using enum MidiNumber::Controller;

// Registered parameter numbers (RPN).
enum Parameter : int {
  bend_range = 0,
  fine_tuning = 1,
  coarse_tuning = 2,
  modulation_depth_range = 5,
  mpe_configuration = 6
};

constexpr int most_data = 0x3fff;
constexpr double member_bend_range = 48.0;  // semitones, by MPE 1.0
static_assert(member_bend_range == note_bend_semitones);
constexpr double usual_bend_range = 2.0;
constexpr double usual_depth_data = 64.0;  // 50 cents in 128ths of a semitone, by General MIDI 2

// Returns the pan position from -1 (left) to 1 (right). By General MIDI 2 (RP-036), 64 is the
// middle, and both 0 and 1 are fully left.
double pan_of(double value) {
  const double place = (127.0 * value - 64.0) / 63.0;
  constexpr double rounding = 1e-9;
  return std::fabs(place) < rounding ? 0.0 : std::clamp(place, -1.0, 1.0);
}

}  // namespace

Channels::Channels(std::uint8_t master) : notes_master_(master) {
  for (unsigned channel = midi_channel_count; channel < count; ++channel) {
    channels_[channel].bend_range = note_bend_semitones;
  }
}

void Channels::adopt(const Channels& from) {
  const std::uint8_t master = notes_master_;
  *this = from;
  notes_master_ = master;
}

Channels::Change Channels::turn(std::uint8_t index, int number, double value) {
  Channel& channel = of(index);
  const int bits = static_cast<int>(std::lround(127.0 * std::clamp(value, 0.0, 1.0)));
  const bool is_down = value >= 0.5;
  switch (number) {
    case modulation_wheel:
      channel.wheel = value;
      return Change::modulation;
    case volume:
      channel.volume = value;
      return Change::level;
    case expression:
      channel.expression = value;
      return Change::level;
    case pan:
      channel.pan = pan_of(value);
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
    case portamento_time: {
      constexpr double longest_s = 4.0;
      channel.glide_s = longest_s * value * value;
      return Change::nothing;
    }
    case portamento_switch:
      channel.glides = is_down;
      return Change::nothing;
    case legato_switch:
      channel.legato = is_down;
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
      return enter(index % count);
    case data_entry_fine:
      channel.data = (channel.data & 0x3f80) | bits;
      return channel.parameter == mpe_configuration ? Change::nothing : enter(index % count);
    case data_increment:
      channel.data = std::min(channel.data + 1, most_data);
      return enter(index % count);
    case data_decrement:
      channel.data = std::max(channel.data - 1, 0);
      return enter(index % count);
    default:
      return Change::nothing;
  }
}

Channels::Change Channels::enter(std::uint8_t index) {
  constexpr int middle = 64;
  Channel& channel = of(index);
  const int coarse = channel.data >> 7;
  switch (channel.parameter) {
    case bend_range:
      return set_bend_range(index, coarse + (channel.data & 0x7f) / 100.0);
    case fine_tuning:
      channel.fine = (channel.data - (middle << 7)) / 8192.0;
      return Change::pitch;
    case coarse_tuning:
      channel.coarse = coarse - middle;
      return Change::pitch;
    case modulation_depth_range:
      channel.wheel_depth = channel.data / usual_depth_data;
      return Change::modulation;
    case mpe_configuration:
      return set_zone(index, coarse);
    default:
      return Change::nothing;
  }
}

// The bend range of one member applies to all members of its zone.
Channels::Change Channels::set_bend_range(std::uint8_t index, double semitones) {
  const std::uint8_t master = master_of(index);
  for (std::uint8_t other = 0; other < midi_channel_count; ++other) {
    const bool is_sibling = is_member(index) && is_member(other) && master_of(other) == master;
    if (other == index || is_sibling) {
      of(other).bend_range = semitones;
    }
  }
  return Change::pitch;
}

// If two zones overlap, the newer one gets the channels. The message is ignored on channels that
// cannot be a master.
Channels::Change Channels::set_zone(std::uint8_t master, int members) {
  constexpr int most_members = 15;
  constexpr int most_of_both = 14;
  members = std::min(members, most_members);
  int& ours = master == lower_master ? lower_members_ : upper_members_;
  int& others = master == lower_master ? upper_members_ : lower_members_;
  if (master != lower_master && master != upper_master) {
    return Change::nothing;
  }
  std::array<std::uint8_t, midi_channel_count> before{};
  for (std::uint8_t channel = 0; channel < midi_channel_count; ++channel) {
    before[channel] = master_of(channel);
  }
  ours = members;
  if (members > 0) {
    others = std::clamp(others, 0, std::max(0, most_of_both - members));
  }
  rezoned_ = 0;
  for (std::uint8_t channel = 0; channel < midi_channel_count; ++channel) {
    if (before[channel] == master || master_of(channel) == master) {
      rezoned_ |= channel_bit(channel);
      of(channel).bend_range = is_member(channel) ? member_bend_range : usual_bend_range;
      reset(channel);
    }
  }
  return Change::zones;
}

std::uint8_t Channels::master_of(std::uint8_t index) const {
  const int channel = index % static_cast<int>(count);
  return channel >= static_cast<int>(midi_channel_count)       ? notes_master_
         : channel > lower_master && channel <= lower_members_ ? lower_master
         : channel < upper_master && channel >= upper_master - upper_members_
             ? upper_master
             : static_cast<std::uint8_t>(channel);
}

ChannelMask Channels::reach(std::uint8_t index) const {
  const auto channel = static_cast<std::uint8_t>(index % count);
  ChannelMask mask = channel_bit(channel);
  for (std::uint8_t other = 0; other < count; ++other) {
    mask |= master_of(other) == channel ? channel_bit(other) : 0U;
  }
  return mask;
}

ChannelMask Channels::members() const {
  ChannelMask mask = 0;
  for (std::uint8_t channel = 0; channel < count; ++channel) {
    mask |= is_member(channel) ? channel_bit(channel) : 0U;
  }
  return mask;
}

bool Channels::is_ignored(std::uint8_t channel, int number) const {
  constexpr int last_pedal = 69;  // hold 2
  constexpr int first_mode = 120;
  const bool is_for_zone =
      (number >= sustain_pedal && number <= last_pedal) || number >= first_mode;
  return is_for_zone && channel < midi_channel_count && is_member(channel);
}

void Channels::reset(std::uint8_t index) {
  Channel& channel = of(index);
  channel.bend = channel.wheel = 0.0;
  channel.expression = 1.0;
  channel.sustain = 0.0;
  channel.sostenuto = channel.legato = false;
  channel.soft = 0.0;
  channel.glides.reset();
  channel.parameter = no_parameter;
}

void Channels::lift_pedals() {
  for (Channel& channel : channels_) {
    channel.sustain = 0.0;
    channel.sostenuto = channel.legato = false;
    channel.soft = 0.0;
  }
}

double Channels::semitones(std::uint8_t channel) const {
  const Channel& c = of(channel);
  return c.bend * c.bend_range + c.coarse + c.fine;
}

double Channels::level(std::uint8_t channel) const {
  const auto of_one = [](const Channel& c) {
    const double volume = c.volume * 127.0 / 100.0;
    return volume * volume * c.expression * c.expression;
  };
  return of_one(of(channel)) * (is_member(channel) ? of_one(zone(channel)) : 1.0);
}

SideGains Channels::balance(std::uint8_t channel) const {
  const double place =
      std::clamp(of(channel).pan + (is_member(channel) ? zone(channel).pan : 0.0), -1.0, 1.0);
  if (place == 0.0) {
    return {1.0, 1.0};
  }
  // The sine is used on both sides, because it is exactly 0 at the far end, unlike the cosine.
  const auto gain = [](double share) {
    return std::numbers::sqrt2 * std::sin(0.25 * std::numbers::pi * share);
  };
  return {gain(1.0 - place), gain(1.0 + place)};
}

double Channels::damper(std::uint8_t channel) const {
  // Damping grows with the square of the damper's contact.
  const double contact = std::clamp(2.0 - 4.0 * pedal(channel), 0.0, 1.0);
  return contact * contact;
}

double Channels::softness(std::uint8_t channel) const {
  constexpr double softest = 0.75;
  return 1.0 - (1.0 - softest) * std::max(of(channel).soft, zone(channel).soft);
}

double Channels::modulation(std::uint8_t channel) const {
  return std::clamp(of(channel).wheel * of(channel).wheel_depth, 0.0, 1.0);
}

double Channels::glide_s(std::uint8_t channel, double preset) const {
  const Channel& c = is_member(channel) && zone(channel).glides ? zone(channel) : of(channel);
  const bool glides = c.glides.value_or(preset > 0.0);
  return glides ? c.glide_s.value_or(preset) : 0.0;
}

}  // namespace ressort::engine
