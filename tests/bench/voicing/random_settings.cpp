#include "tests/bench/voicing/random_settings.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <map>
#include <vector>

#include "tests/bench/voicing/sound.h"
#include "tests/support/random.h"

namespace ressort::voicing {
namespace {

// Times in s: the key goes down, a lever moves, the key goes up, then the pedals.
constexpr double press_s = 0.2;
constexpr double move_s = 0.5;
constexpr double lift_s = 1.0;
// for one note in eight, whose offset is measured while it is held
constexpr double long_lift_s = 2.2;
constexpr double pedals_up_s = 0.2;  // after the key
constexpr double after_s = 2.0;
constexpr double undamped_after_s = 16.0;  // for what no damper touches, which must ring out

constexpr double loudest_db = 0.0;
// at the mean velocity; the bound rises and falls with the square of the velocity, as MIDI's levels
// do
constexpr double softest_db = -40.0;
constexpr double mean_velocity = 73.5;
constexpr double most_step_db = -60.0;  // relative to the peak

constexpr int sustain_pedal = 64;
constexpr int sostenuto_pedal = 66;
constexpr int soft_pedal = 67;

struct Setting {
  std::vector<TimedEvent> events;
  std::string said;
  int key = 60;
  int velocity = 100;
  double softness = 1.0;  // factor of the velocity by the soft pedal
  bool has_move = false;
  bool is_long = false;
  double lifted_s = lift_s;

  // Returns the events without the lever's motion.
  std::vector<TimedEvent> unmoved() const {
    std::vector<TimedEvent> others;
    std::copy_if(events.begin(), events.end(), std::back_inserter(others),
                 [](const TimedEvent& timed) { return timed.time_s != move_s; });
    return others;
  }
};

std::string number(double value, int digits) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

// A control of the preset that only a player moves.
struct Lever {
  std::string name;
  Event event;  // complete except for its value
};

std::vector<Lever> levers_of(const Preset& preset) {
  std::vector<Lever> levers;
  for (std::size_t row = 0; row < preset.controls.size(); ++row) {
    const ControlSetting& control = preset.controls[row];
    Lever lever;
    if (control.source == ControlSource::controller) {
      lever = {"cc" + std::to_string(control.number), turn(control.number, 0.0)};
    } else if (control.source == ControlSource::pressure) {
      lever = {"pressure", press(0.0)};
    } else if (control.source == ControlSource::osc) {
      lever = {"osc" + std::to_string(row),
               {.kind = EventKind::custom, .index = static_cast<std::uint16_t>(row)}};
    }
    const bool is_known = std::any_of(levers.begin(), levers.end(),
                                      [&](const Lever& other) { return other.name == lever.name; });
    if (!lever.name.empty() && !is_known) {
      levers.push_back(lever);
    }
  }
  return levers;
}

Setting random_setting(std::vector<Lever> levers, support::Random& random) {
  Setting setting;
  for (std::size_t i = levers.size(); i > 1; --i) {
    std::swap(levers[i - 1], levers[random.below(i)]);
  }
  const auto move = [&](double time_s, Event event, const std::string& name) {
    setting.events.push_back({time_s, event});
    setting.said += " " + name + "=" + number(event.value, 2);
  };
  const auto moved = [&](const Lever& lever) {
    Event event = lever.event;
    // Every eighth value is at an end of the range, where levers are most of the time.
    const std::uint32_t place = static_cast<std::uint32_t>(random.below(8));
    event.value = place == 0 ? 0.0 : place == 1 ? 1.0 : random.uniform(0.0, 1.0);
    return event;
  };
  for (const Lever& lever : levers) {
    move(0.0, moved(lever), lever.name);
  }
  const bool is_bent = random.below(4) == 0;
  if (is_bent) {
    move(0.0, {.kind = EventKind::bend, .value = random.uniform(-1.0, 1.0)}, "bend");
  }
  const bool is_sustained = random.below(4) == 0;
  const bool is_latched = random.below(4) == 0;
  const bool is_soft = random.below(4) == 0;
  if (is_sustained) {
    move(0.1, turn(sustain_pedal, random.uniform(0.0, 1.0)), "sustain");
  }
  if (is_soft) {
    move(0.1, turn(soft_pedal, 1.0), "soft");
    setting.softness = 0.75;
  }
  setting.key = 36 + static_cast<int>(random.below(61));
  setting.velocity = 20 + static_cast<int>(random.below(108));
  setting.is_long = random.below(8) == 0;
  setting.lifted_s = setting.is_long ? long_lift_s : lift_s;
  setting.events.push_back({press_s, note_on(setting.key, setting.velocity)});
  if (is_latched) {
    move(press_s + 0.1, turn(sostenuto_pedal, 1.0), "sostenuto");
  }
  if (!levers.empty()) {
    const Lever& lever = levers[random.below(levers.size())];
    move(move_s, moved(lever), "then " + lever.name);
    setting.has_move = true;
  }
  setting.events.push_back({setting.lifted_s, note_off(setting.key)});
  setting.lifted_s += pedals_up_s;
  for (const int pedal : {sustain_pedal, sostenuto_pedal}) {
    setting.events.push_back({setting.lifted_s, turn(pedal, 0.0)});
  }
  return setting;
}

double largest_bend(const Stereo& sound, double from_s, double to_s) {
  const Stereo piece = sound.part(from_s, to_s);
  double most = 0.0;
  for (const std::vector<double>& channel : piece.channels) {
    for (std::size_t n = 2; n < channel.size(); ++n) {
      most = std::max(most, std::fabs(channel[n] - 2.0 * channel[n - 1] + channel[n - 2]));
    }
  }
  return most;
}

// Returns how far the second difference at the time of a move exceeds that of its neighbourhood.
double step_at(const Stereo& sound, double time_s) {
  const double around = std::max(largest_bend(sound, time_s - 0.06, time_s - 0.001),
                                 largest_bend(sound, time_s + 0.006, time_s + 0.06));
  return std::max(0.0, largest_bend(sound, time_s - 0.001, time_s + 0.005) - around);
}

// The same for the change that the lever causes, found with a sound in which the lever stays:
// partials beat, so the model itself can cause such peaks.
double step_at(const Stereo& sound, const Stereo& unmoved, double time_s) {
  Stereo change = sound;
  for (std::size_t c = 0; c < change.channels.size(); ++c) {
    for (std::size_t n = 0; n < change.size(); ++n) {
      change.channels[c][n] -= unmoved.channels[c][n];
    }
  }
  const double around = std::max(largest_bend(change, time_s + 0.006, time_s + 0.06),
                                 largest_bend(unmoved, time_s - 0.06, time_s + 0.06));
  return std::max(0.0, largest_bend(change, time_s - 0.001, time_s + 0.005) - around);
}

}  // namespace

int play_random_settings(Player& player, const std::string& name, int count, std::uint64_t seed) {
  const Preset& preset = player.scene().preset;
  const std::vector<Lever> levers = levers_of(preset);
  support::Random random(seed);
  std::map<std::string, int> wrong;
  int failures = 0;
  double softest_seen_db = 1e9;
  double loudest_seen_db = -1e9;
  for (int turn_number = 0; turn_number < count; ++turn_number) {
    const Setting setting = random_setting(levers, random);
    Stereo sound = player.play(setting.events, setting.lifted_s + after_s);
    const double peak = peak_of(sound.part(press_s, setting.lifted_s + after_s));
    const double peak_db = decibels(peak);
    softest_seen_db = std::min(softest_seen_db, peak_db);
    loudest_seen_db = std::max(loudest_seen_db, peak_db);
    bool is_wrong = false;
    const auto expect = [&](bool holds, const char* what, double figure) {
      if (holds) {
        return;
      }
      is_wrong = true;
      if (++wrong[what] <= 3) {
        std::printf("  %s: %s (%.1f):%s, key %d velocity %d, peak %.1f dBFS\n", name.c_str(), what,
                    figure, setting.said.c_str(), setting.key, setting.velocity, peak_db);
      }
    };
    expect(is_finite(sound), "not finite", 0.0);
    expect(peak_db <= loudest_db, "too loud", peak_db);
    const double velocity_db =
        40.0 * std::log10(setting.velocity * setting.softness / mean_velocity);
    expect(peak_db >= softest_db + velocity_db, "too soft", peak_db);
    const auto offset_db = [&](double from_s) {
      return decibels(offset_of(sound.part(from_s, from_s + 1.0)));
    };
    expect(offset_db(setting.lifted_s + 1.0) <= most_offset_db, "DC",
           offset_db(setting.lifted_s + 1.0));
    if (setting.is_long) {
      expect(offset_db(setting.lifted_s - 1.2) <= most_offset_db, "DC while held",
             offset_db(setting.lifted_s - 1.2));
    }
    if (setting.has_move && !preset.noise) {  // noise consists of steps only
      double step_db = decibels(step_at(sound, move_s) / std::max(peak, 1e-9));
      // A lever's click comes with every stroke, a slip of the bow at the same time does not.
      Stereo moved = sound.part(0.0, move_s + 0.1);
      for (int stroke = 0; stroke < 3 && step_db > most_step_db; ++stroke) {
        const auto play_again = [&](const std::vector<TimedEvent>& events) {
          // Played twice, because strokes from two sides alternate.
          player.play(events, move_s + 0.1);
          return player.play(events, move_s + 0.1);
        };
        if (stroke > 0) {
          moved = play_again(setting.events);
        }
        const double again_db =
            decibels(step_at(moved, play_again(setting.unmoved()), move_s) / std::max(peak, 1e-9));
        step_db = stroke == 0 ? again_db : std::min(step_db, again_db);
      }
      expect(step_db <= most_step_db, "a step", step_db);
    }
    const auto left_db = [&] {
      const double end_s = static_cast<double>(sound.size()) / sound.rate_hz;
      return decibels(peak_of(sound.part(end_s - 0.2, end_s)) / std::max(peak, 1e-9));
    };
    // A preset without damper, and a body, which no damper touches, must ring out by themselves.
    const bool is_undamped = preset.damper_s <= 0.0 || !preset.through.empty();
    for (double more_s = is_undamped ? undamped_after_s : 0.0;
         left_db() > silence_db && more_s > 0.0; more_s -= 2.0) {
      sound = player.continue_playing(2.0);
    }
    expect(left_db() <= silence_db, "does not end", left_db());
    failures += is_wrong ? 1 : 0;
  }
  std::printf("%s: %d of %d settings fail, peaks %.1f to %.1f dBFS", name.c_str(), failures, count,
              softest_seen_db, loudest_seen_db);
  for (const auto& [what, times] : wrong) {
    std::printf(", %s %d", what.c_str(), times);
  }
  std::printf("\n");
  std::fflush(stdout);
  return failures;
}

}  // namespace ressort::voicing
