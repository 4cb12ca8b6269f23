#include "tests/bench/voicing/mono.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <set>
#include <utility>
#include <vector>

namespace ressort::voicing {
namespace {

constexpr int full_velocity = 127;
// Times of the two notes and of the return to the first one.
constexpr double first_s = 0.05;
constexpr double second_s = 0.4;
constexpr double return_s = 0.7;
constexpr double end_s = 1.0;
// Delays of the two changes of a note that is not struck again, in steps: the string is at another
// phase at each of them.
constexpr int delays = 8;
constexpr double delay_s = 0.005 / delays;
constexpr double most_excess_db = 3.0;  // the noise of a blow differs from note to note
constexpr int mono_mode = 126;
constexpr int legato_switch = 68;
constexpr int portamento_switch = 65;
constexpr std::uint8_t poly_channel = 0;

using Keys = std::pair<int, int>;

// A way to change from one key to another, on a MIDI channel of its own, which keeps its mode.
struct Change {
  const char* name;
  std::uint8_t channel;
  std::vector<int> switches;
  bool is_struck = false;
};

const Change changes[] = {
    {"mono", 1, {mono_mode}, true},
    {"portamento", 2, {mono_mode, portamento_switch}, true},
    {"legato", 3, {mono_mode, legato_switch}},
    {"legato with portamento", 4, {mono_mode, legato_switch, portamento_switch}}};

// Every limit of a control by key, in both directions, and a usual step.
std::set<Keys> steps_of(const Preset& preset) {
  std::set<Keys> steps = {{60, 62}};
  for (const ControlSetting& control : preset.controls) {
    if (control.source == ControlSource::note && control.highest_key < 127) {
      steps.insert({control.highest_key, control.highest_key + 1});
      steps.insert({control.highest_key + 1, control.highest_key});
    }
  }
  return steps;
}

const std::set<Keys> leaps = {{60, 72}, {72, 60}, {36, 84}, {84, 36}};

// The notes of a bow go on in the voice, whose energy a leap changes.
bool is_blown_or_bowed(const Preset& preset) {
  return std::ranges::any_of(preset.controls, [](const ControlSetting& control) {
    return control.source == ControlSource::note &&
           (control.gesture == Gesture::bow || control.gesture == Gesture::hold);
  });
}

double peak_db(Player& player, std::vector<TimedEvent> events, std::uint8_t channel) {
  for (TimedEvent& timed : events) {
    timed.event.channel = channel;
  }
  return decibels(peak_of(player.play(events, end_s)));
}

double peak_in_mono_db(Player& player, const Keys& keys, const Change& change,
                       double late_s = 0.0) {
  std::vector<TimedEvent> events;
  for (const int number : change.switches) {
    events.push_back({0.0, turn(number, 1.0)});
  }
  events.push_back({first_s, note_on(keys.first, full_velocity)});
  events.push_back({second_s + late_s, note_on(keys.second, full_velocity)});
  events.push_back({return_s + late_s, note_off(keys.second)});
  return peak_db(player, events, change.channel);
}

double peak_in_poly_db(Player& player, const Keys& keys) {
  return peak_db(player,
                 {{first_s, note_on(keys.first, full_velocity)},
                  {second_s, note_on(keys.second, full_velocity)},
                  {return_s, note_on(keys.first, full_velocity)}},
                 poly_channel);
}

double peak_of_bend_db(Player& player, const Keys& keys) {
  const auto bend = [](double amount) { return Event{.kind = EventKind::bend, .value = amount}; };
  return peak_db(player,
                 {{first_s, note_on(keys.first, full_velocity)},
                  {second_s, bend(keys.second > keys.first ? 1.0 : -1.0)},
                  {return_s, bend(0.0)}},
                 poly_channel);
}

}  // namespace

int check_mono(Player& player, const std::string& name) {
  const Preset& preset = player.scene().preset;
  double worst_db = -1e9;
  std::string worst;
  const auto compare = [&](double excess_db, const Keys& keys, const char* change) {
    if (excess_db > worst_db) {
      worst_db = excess_db;
      worst = std::string(change) + " from key " + std::to_string(keys.first) + " to " +
              std::to_string(keys.second);
    }
  };
  const std::set<Keys> steps = steps_of(preset);
  for (const Keys& keys : steps) {
    const double poly_db = peak_in_poly_db(player, keys);
    for (const Change& change : changes) {
      for (int i = 0; i < (change.is_struck ? 1 : delays); ++i) {
        compare(peak_in_mono_db(player, keys, change, i * delay_s) - poly_db, keys, change.name);
      }
    }
    compare(peak_of_bend_db(player, keys) - poly_db, keys, "bend");
  }
  for (const Keys& keys : is_blown_or_bowed(preset) ? std::set<Keys>{} : leaps) {
    const double poly_db = peak_in_poly_db(player, keys);
    for (const Change& change : changes) {
      if (change.is_struck) {
        compare(peak_in_mono_db(player, keys, change) - poly_db, keys, change.name);
      }
    }
  }
  const bool fails = worst_db > most_excess_db;
  std::printf("%s: %+.1f dB by %s%s\n", name.c_str(), worst_db, worst.c_str(), fails ? " !" : "");
  std::fflush(stdout);
  return fails ? 1 : 0;
}

}  // namespace ressort::voicing
