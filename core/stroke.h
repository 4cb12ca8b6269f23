// core: one performance of a gesture, and the numbers that the gesture gives to an input's driver.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/noise.h"

namespace ressort {

// The settings of a preset's control that a gesture uses.
struct GestureSettings {
  double low = 0.0;  // the amount 0..1 is mapped to low..high: positions, forces, speeds per sample
  double high = 1.0;         // value at 44 100 Hz, or parameter value
  bool exponential = false;  // equal steps are equal ratios
  double travel = 0.0;       // pluck, swing: distance of the finger or mallet from its middle
  bool has_level = false;    // the amount also sets the voice's level, from low_db to high_db
  double low_db = 0.0;
  double high_db = 0.0;
  // Impulse, swing: duration of the softest and the hardest pulse, 0 is one sample. Noise: T60.
  // Bow: time in which the level rises.
  double longest_s = 0.0;
  double shortest_s = 0.0;
  bool follows_pitch = true;  // speeds, forces and durations scale with the key's pitch
  double low_hz = 20.0;       // noise, bow: band of the noise
  double high_hz = 20000.0;
  double roughness = 0.0;  // bow: rms of the noise in its speed, as a share of the speed

  // Returns the level of the loudest gesture as a factor.
  double highest_level() const { return std::pow(10.0, std::max(low_db, high_db) / 20.0); }
};

// The settings of a control at one key.
struct KeySettings {
  double key = 0.0;
  GestureSettings settings;
};

// Returns the settings on a key, joined by straight lines. There is at least one row, and the keys
// ascend. [any thread] wait-free, O(rows)
inline GestureSettings settings_at(const std::vector<KeySettings>& rows, double key) {
  std::size_t next = 0;
  while (next < rows.size() && rows[next].key < key) {
    ++next;
  }
  if (next == 0 || next == rows.size()) {
    return rows[std::min(next, rows.size() - 1)].settings;
  }
  const KeySettings& a = rows[next - 1];
  const KeySettings& b = rows[next];
  const double way = (key - a.key) / (b.key - a.key);
  GestureSettings settings = a.settings;
  for (double GestureSettings::*const number :
       {&GestureSettings::low, &GestureSettings::high, &GestureSettings::travel,
        &GestureSettings::low_db, &GestureSettings::high_db, &GestureSettings::longest_s,
        &GestureSettings::shortest_s}) {
    settings.*number = std::lerp(a.settings.*number, b.settings.*number, way);
  }
  return settings;
}

struct Stroke {
  double amount = 1.0;  // 0..1 of a preset's source, or the first argument of a live call
  double second = 0.0;  // second argument of a live call
  bool is_live = false;
  bool has_control = false;  // a live call may have none
  GestureSettings settings;  // settings of the preset's control
  // The input and the voice.
  bool is_force = false;
  double middle = 0.0;      // position of the input in the model; 0 for a force
  double rate_ratio = 1.0;  // 44 100 Hz to the engine's rate
  double rate_hz = 44100.0;
  double pitch = 1.0;  // the voice's pitch by the written pitch; 1 unless the control follows it
  double share = 1.0;  // factor on the force of a blow
  double string_hz = 0.0;  // pitch of what a blow strikes, if it may ring; 0: unknown
  double hardness = 0.0;   // added to the amount for the length of a blow
  bool bare = false;       // nothing is smoothed
  std::uint64_t seed = 0;  // differs from note to note and from input to input
  // Results, set by the gesture.
  std::optional<double> rest;      // position at which drivers of new voices start from now on
  std::optional<double> pressure;  // channel pressure to apply
  std::optional<double> loudness;  // factor on the highest level, in place of the amount

  // Returns the amount mapped to the control's range. Without a control it is used unchanged.
  double mapped() const {
    if (!has_control) {
      return amount;
    }
    const double low = settings.low;
    const double high = settings.high;
    const double a = std::clamp(amount, 0.0, 1.0);
    return settings.exponential && low * high > 0.0 ? low * std::pow(high / low, a)
                                                    : low + (high - low) * a;
  }
  // Returns the voice's level as a factor.
  double level() const {
    const double part = loudness ? 1.0 : std::clamp(amount, 0.0, 1.0);
    const double db = settings.low_db + (settings.high_db - settings.low_db) * part;
    return std::pow(10.0, db / 20.0) * loudness.value_or(1.0);
  }
  // Returns the duration of the gesture. It shrinks in equal ratios from soft to hard.
  double length_s(double harder = 0.0) const {
    const double longest_s = settings.longest_s;
    const double shortest_s = settings.shortest_s;
    const double a = std::clamp(amount, 0.0, 1.0) + harder;
    return longest_s > 0.0 && shortest_s > 0.0
               ? longest_s * std::pow(shortest_s / longest_s, a)
               : std::max(0.0, longest_s + (shortest_s - longest_s) * a);
  }
  // Returns the duration of a blow. If the control follows the pitch, it shrinks in proportion to
  // the period of a higher key, so that all keys have the same timbre.
  double pulse_frames() const { return length_s(hardness) * rate_hz / pitch; }
  // Returns the share of a burst's level that remains after one sample.
  double burst_kept() const { return std::pow(10.0, -3.0 / (length_s() * rate_hz)); }
  BandNoise noise() const { return {seed, settings.low_hz, settings.high_hz, rate_hz}; }
  // Scales a lasting force for the same motion at every rate; a position has the same value.
  double pushed(double value) const { return is_force ? value * rate_ratio * rate_ratio : value; }
  // Scales a speed or an impulse for the same displacement at every rate and pitch.
  double paced(double value) const { return value * rate_ratio * pitch; }
  // Scales the force of a blow, or the displacement that gives the same blow through a spring.
  double struck(double value) const {
    return share * (is_force ? paced(value) : value / (rate_ratio * pitch));
  }
  // Poles of the one-pole filters that smooth a position (44.1 Hz / rate) and a speed (5 ms).
  double pole_of_position() const { return bare ? 0.0 : 1.0 - std::min(1.0, 44.1 / rate_hz); }
  double pole_of_speed() const { return bare ? 0.0 : std::exp(-1.0 / (0.005 * rate_hz)); }
};

}  // namespace ressort
