#include "tests/bench/voicing/restrikes.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

namespace ressort::voicing {
namespace {

constexpr int loud = 127;
constexpr int soft = 20;
constexpr double soft_s = 0.75;    // time of the soft strike
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

// Plays `turn` silent notes, then the events, and then silent notes until all round robins are back
// at their first control.
Stereo play(Player& player, int key, int turn, const std::vector<TimedEvent>& events) {
  const auto play_silently = [&](int notes) {
    player.play(std::vector<TimedEvent>(static_cast<std::size_t>(notes), {0.0, note_on(key, 1)}),
                0.01);
  };
  play_silently(turn);
  Stereo sound = player.play(events, soft_s + watched_s + window_s);
  const auto played = turn + static_cast<int>(std::count_if(
                                 events.begin(), events.end(), [](const TimedEvent& timed) {
                                   return timed.event.kind == EventKind::note_on;
                                 }));
  play_silently((strokes - played % strokes) % strokes);
  return sound;
}

Stereo sum_of(Stereo a, const Stereo& b, double sign) {
  for (std::size_t channel = 0; channel < a.channels.size(); ++channel) {
    for (std::size_t n = 0; n < a.size(); ++n) {
      a.channels[channel][n] += sign * b.channels[channel][n];
    }
  }
  return a;
}

// The lowest level of a window after the soft strike.
struct Lowest {
  double alone_db = 1e9;  // relative to the loud note alone
  double least_db = 1e9;  // relative to that, or to the sum of both notes alone if this is softer:
                          // two waves of one pitch may cancel
};

Lowest lowest_of(Player& player, int key, std::vector<TimedEvent> events) {
  const TimedEvent strike{soft_s, note_on(key, soft)};
  const Stereo alone = play(player, key, 0, events);
  const Stereo second = play(player, key, 1, {strike});
  // A pluck from the other side has the opposite sign.
  const Stereo sums[] = {sum_of(alone, second, 1.0), sum_of(alone, second, -1.0)};
  events.push_back(strike);
  const Stereo both = play(player, key, 0, events);
  Lowest lowest;
  for (double at_s = soft_s; at_s <= soft_s + watched_s - window_s; at_s += 0.01) {
    const auto relative_db = [&](const Stereo& sound) {
      return 0.5 * decibels(power_of(both, at_s) / std::max(1e-30, power_of(sound, at_s)));
    };
    const double alone_db = relative_db(alone);
    lowest.alone_db = std::min(lowest.alone_db, alone_db);
    lowest.least_db =
        std::min(lowest.least_db, std::max({alone_db, relative_db(sums[0]), relative_db(sums[1])}));
  }
  return lowest;
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
  const Lowest pedal = lowest_of(
      player, key, {{0.0, turn(64, 1.0)}, {0.01, note_on(key, loud)}, {0.6, note_off(key)}});
  const Lowest again = lowest_of(player, key, {{0.01, note_on(key, loud)}, {0.72, note_off(key)}});
  const int failures =
      (pedal.least_db < -most_loss_db ? 1 : 0) + (again.least_db < -most_loss_db ? 1 : 0);
  std::printf(
      "%s: a soft strike changes the level by %.1f dB under the pedal (%.1f without "
      "cancellation), by %.1f dB on the released key (%.1f)%s\n",
      name.c_str(), pedal.alone_db, pedal.least_db, again.alone_db, again.least_db,
      failures > 0 ? " !" : "");
  std::fflush(stdout);
  return failures;
}

}  // namespace ressort::voicing
