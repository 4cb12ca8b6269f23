#include "tests/bench/voicing/restrikes.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

namespace ressort::voicing {
namespace {

constexpr int loud = 127;
constexpr int soft = 20;
// Times of the soft strike, at which two waves of one pitch are in different phases.
constexpr double soft_times_s[] = {0.75, 0.813, 0.9};
constexpr double watched_s = 0.2;  // after it
constexpr double window_s = 0.05;
constexpr double most_loss_db = 1.0;
constexpr int strokes = 12;  // a multiple of the length of every round robin

double power_of(const Stereo& sound, double from_s) {
  double power = 0.0;
  const Stereo part = sound.part(from_s, from_s + window_s);
  for (const std::vector<double>& channel : part.channels) {
    for (const double sample : channel) {
      power += sample * sample;
    }
  }
  return power;
}

// Plays the events, and then silent notes until all round robins are back at their first control.
Stereo play(Player& player, int key, const std::vector<TimedEvent>& events, double seconds) {
  Stereo sound = player.play(events, seconds);
  const auto played = std::count_if(events.begin(), events.end(), [](const TimedEvent& timed) {
    return timed.event.kind == EventKind::note_on;
  });
  player.play(
      std::vector<TimedEvent>(static_cast<std::size_t>(strokes - played), {0.0, note_on(key, 1)}),
      0.01);
  return sound;
}

// Returns the lowest level of a window after a soft strike, relative to the events alone.
double lowest_db(Player& player, int key, double soft_s, std::vector<TimedEvent> events) {
  const double seconds = soft_s + watched_s + window_s;
  const Stereo alone = play(player, key, events, seconds);
  events.push_back({soft_s, note_on(key, soft)});
  const Stereo both = play(player, key, events, seconds);
  double least_db = 1e9;
  for (double at_s = soft_s; at_s <= soft_s + watched_s - window_s; at_s += 0.01) {
    least_db = std::min(
        least_db, 0.5 * decibels(power_of(both, at_s) / std::max(1e-30, power_of(alone, at_s))));
  }
  return least_db;
}

bool is_restruck(const Preset& preset) {
  return !preset.noise && std::none_of(preset.controls.begin(), preset.controls.end(),
                                       [](const ControlSetting& control) {
                                         return control.source == ControlSource::note &&
                                                control.gesture == Gesture::bow;
                                       });
}

}  // namespace

int check_restrikes(Player& player, const std::string& name, int key) {
  if (!is_restruck(player.scene().preset)) {
    return 0;
  }
  double pedal_db = 1e9;
  for (const double soft_s : soft_times_s) {
    pedal_db = std::min(
        pedal_db,
        lowest_db(player, key, soft_s,
                  {{0.0, turn(64, 1.0)}, {0.01, note_on(key, loud)}, {0.6, note_off(key)}}));
  }
  const double again_db =
      lowest_db(player, key, soft_times_s[0], {{0.01, note_on(key, loud)}, {0.72, note_off(key)}});
  const int failures = (pedal_db < -most_loss_db ? 1 : 0) + (again_db < -most_loss_db ? 1 : 0);
  std::printf(
      "%s: a soft strike changes the level by %.1f dB under the pedal, by %.1f dB on the "
      "released key%s\n",
      name.c_str(), pedal_db, again_db, failures > 0 ? " !" : "");
  std::fflush(stdout);
  return failures;
}

}  // namespace ressort::voicing
