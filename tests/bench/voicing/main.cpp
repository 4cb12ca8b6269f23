// Measures the sound of presets:
//
//  ressort_voicing [--keys STEP] [PRESET...]           one row each, ! after values out of bounds
//  ressort_voicing --random N [--seed S] [PRESET...]   N random settings of all controls for each
//  ressort_voicing --bows N [PRESET...]                bows: N speeds and N pressures, 24 keys
//  ressort_voicing --played N [PRESET...]              processor time as played, median of N
//  ressort_voicing --restrikes KEY [PRESET...]         level of a ringing note after a soft strike
//  ressort_voicing --mono RATE [PRESET...]             level of a change of keys in mono mode
//  ressort_voicing --rounding RATE [PRESET...]         errors of single precision
//  ressort_voicing --tuner RATE [PRESET...]            pitch of every semitone by YIN
//  ressort_voicing [--seconds S] FILE.mid... [PRESET...]
//                                                      MIDI files, each to its end or for S seconds
//
// Without names, all presets are measured, or, with MIDI files, ten. STEP is the distance in
// semitones between the keys whose pitch is measured, from 21 to 108 (default 12). The table is
// Markdown. The sound is measured before the limiter.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "app/commands/offline.h"
#include "app/commands/smf/midi_file.h"
#include "app/control/registry.h"
#include "app/session/files.h"
#include "core/engine/limiter.h"
#include "tests/bench/voicing/midi_files.h"
#include "tests/bench/voicing/mono.h"
#include "tests/bench/voicing/played.h"
#include "tests/bench/voicing/player.h"
#include "tests/bench/voicing/random_settings.h"
#include "tests/bench/voicing/restrikes.h"
#include "tests/bench/voicing/rounding.h"
#include "tests/bench/voicing/sound.h"
#include "tests/bench/voicing/tuner.h"

namespace ressort::voicing {
namespace {

// Bounds that every preset must keep.
constexpr double forte_peak_db = -12.0;
constexpr double forte_tolerance_db = 2.0;
constexpr double least_dynamics_db = 20.0;
constexpr double most_dynamics_db = 30.0;
constexpr double keyboard_db = 6.0;
constexpr double usual_lufs = -26.5;  // loudness of the phrase, the same for all presets
constexpr double loudness_tolerance_db = 1.5;
constexpr double struck_attack_s = 0.020;
constexpr double bowed_attack_s = 0.150;
constexpr double most_release_s = 0.6;
constexpr double most_correlation = 0.9;
constexpr double most_mono_loss_db = 3.1;  // two uncorrelated channels lose 3.01 dB
constexpr double most_cents = 0.1;
constexpr double rates_hz[] = {44100.0, 48000.0, 96000.0};

std::string number(double value, int digits, bool is_within) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*f%s", digits, value, is_within ? "" : " !");
  return text;
}

bool is_bow(const ControlSetting& control) {
  return control.source == ControlSource::note && control.gesture == Gesture::bow;
}

bool is_bowed(const Preset& preset) {
  return std::ranges::any_of(preset.controls, is_bow);
}

// Returns the longest attack of a bowed note: the time in which its bow gains speed, if that is
// longer than `bowed_attack_s`.
double longest_attack_s(const Preset& preset, int key) {
  double longest_s = bowed_attack_s;
  for (const ControlSetting& control : preset.controls) {
    if (is_bow(control)) {
      longest_s = std::max(longest_s, 1e-3 * on_key(control, key).longest_ms);
    }
  }
  return longest_s;
}

double wanted_hz(const Player& player, int key) {
  return 440.0 * std::exp2((key + player.instrument().transpose - 69) / 12.0);
}

struct Tuning {
  double worst_cents = 0.0;
  int unheard = 0;  // keys at which another partial, or family of partials, is the loudest
  int silent = 0;
};

Tuning tuning_of(Player& player, int step) {
  Tuning tuning;
  for (int key = 21; key <= 108; key += step) {
    const double hz = wanted_hz(player, key);
    const double longer = std::max(0.5, 30.0 / hz);
    const Stereo sound = player.play({{0.0, note_on(key, 100)}}, 0.1 + longer).part(0.1, 9.0);
    if (decibels(peak_of(sound)) < silence_db) {
      ++tuning.silent;
      continue;
    }
    const Pitch pitch = pitch_of(sound, hz);
    if (pitch.level_db > -0.1 || std::fabs(cents(pitch.heard_hz, hz)) < 50.0) {
      tuning.worst_cents = std::max(tuning.worst_cents, std::fabs(cents(pitch.partial_hz, hz)));
    } else {
      ++tuning.unheard;
    }
  }
  return tuning;
}

Stereo phrase(Player& player) {
  std::vector<TimedEvent> events;
  const auto lines = parse_score(to_score(default_phrase()));
  for (const ScoreLine& line : *lines) {
    const auto calls = to_events(line.message, player.instrument(), 0);
    for (const Event& event : *calls) {
      events.push_back({line.time_s, event});
    }
  }
  return player.play(events, 5.2);
}

// Returns the worst offset with any lever half up and fully up and no key pressed.
double worst_offset(Player& player) {
  double worst = offset_of(player.play({{0.0, note_on(60, 127)}}, 2.0).part(1.0, 2.0));
  for (const ControlSetting& control : player.scene().preset.controls) {
    if (control.source == ControlSource::controller) {
      for (const double amount : {64.0 / 127.0, 1.0}) {
        const Stereo sound = player.play({{0.0, turn(control.number, amount)}}, 2.0);
        worst = std::max(worst, offset_of(sound.part(1.0, 2.0)));
      }
    }
  }
  return worst;
}

// Returns the limiter's largest gain reduction for a sound, in dB.
double limiting_db(const Stereo& sound) {
  Limiter limiter(sound.rate_hz);
  Stereo limited = sound;
  const std::array<double*, 2> channels = {limited.channels[0].data(), limited.channels[1].data()};
  limiter.process(channels, limited.size());
  return decibels(1.0 / limiter.take_reduction());
}

struct Row {
  std::vector<std::string> cells;
  double lufs = 0.0;
};

Row measure(const std::string& name, int step) {
  Player player(name, 48000.0);
  const bool bowed = is_bowed(player.scene().preset);
  Row row{.cells = {name}};
  const auto cell = [&](double value, int digits, bool is_within) {
    row.cells.push_back(number(value, digits, is_within));
  };
  std::map<int, double> peaks_db;
  std::map<int, double> centroids;
  double attack = 0.0;
  for (const int velocity : {20, 64, 100, 127}) {
    const Stereo sound = player.play({{0.0, note_on(60, velocity)}}, 1.5);
    peaks_db[velocity] = decibels(peak_of(sound));
    centroids[velocity] = centroid_hz(sound.part(0.0, bowed ? 1.5 : 0.5));
    if (velocity == 64) {
      attack = attack_s(sound, bowed);
    }
  }
  const double dynamics = peaks_db[127] - peaks_db[20];
  cell(peaks_db[20], 1, dynamics >= least_dynamics_db && dynamics <= most_dynamics_db);
  cell(peaks_db[64], 1, peaks_db[64] > peaks_db[20]);
  cell(peaks_db[100], 1,
       peaks_db[100] > peaks_db[64] &&
           std::fabs(peaks_db[100] - forte_peak_db) <= forte_tolerance_db);
  cell(peaks_db[127], 1, peaks_db[127] > peaks_db[100]);

  double least_db = 1e9;
  double most_db = -1e9;
  for (int key = 36; key <= 96; key += 6) {
    const double level = decibels(peak_of(player.play({{0.0, note_on(key, 100)}}, 0.7)));
    if (level > silence_db) {
      least_db = std::min(least_db, level);
      most_db = std::max(most_db, level);
    }
  }
  cell(most_db - least_db, 1, most_db - least_db <= keyboard_db);

  const Stereo played = phrase(player);
  row.lufs = loudness_lufs(played);
  cell(row.lufs, 1, std::fabs(row.lufs - usual_lufs) <= loudness_tolerance_db);
  cell(1000.0 * attack, 0,
       attack <= (bowed ? longest_attack_s(player.scene().preset, 60) : struck_attack_s));
  const double held = t60_s(player.play({{0.0, note_on(60, 100)}}, 9.0));
  cell(held, 2, true);
  const double released =
      t60_s(player.play({{0.0, note_on(60, 100)}, {0.5, note_off(60)}}, 4.0).part(0.52, 4.0));
  cell(released, 2, released <= most_release_s);
  for (const int velocity : {20, 64, 127}) {
    const int before = velocity == 127 ? 64 : 20;
    cell(centroids[velocity], 0, velocity == 20 || centroids[velocity] > centroids[before]);
  }
  const bool is_tuned = player.scene().preset.keyboard && player.instrument().mode;
  std::string unheard = "-";
  for (const double rate_hz : rates_hz) {
    if (!is_tuned) {
      row.cells.push_back("-");
      continue;
    }
    Player other(name, rate_hz);
    const Tuning tuning = tuning_of(other, step);
    cell(tuning.worst_cents, 2, tuning.worst_cents <= most_cents);
    unheard = std::to_string(tuning.unheard) + "/" + std::to_string(tuning.silent) +
              (tuning.unheard + tuning.silent > 0 ? " !" : "");
  }
  row.cells.push_back(unheard);
  const double offset_db = decibels(worst_offset(player));
  cell(offset_db, 0, offset_db <= most_offset_db);
  cell(correlation_of(played), 2, correlation_of(played) < most_correlation);
  cell(mono_loss_db(played), 1, mono_loss_db(played) <= most_mono_loss_db);
  std::vector<TimedEvent> chord;
  for (const int key : {48, 52, 55, 60, 64, 67, 72, 76, 79, 84}) {
    chord.push_back({0.0, note_on(key, 127)});
  }
  const Stereo ten = player.play(chord, 1.5);
  const double chord_db = decibels(peak_of(ten));
  cell(chord_db, 1, chord_db < 0.0);
  cell(limiting_db(ten), 1, chord_db < 0.0);
  const int voices = player.instrument().voices;
  const double cost = player.real_time_share(0.5, voices);
  const double one = player.real_time_share(0.5, 1);
  const double voice = voices > 1 ? std::max(0.0, (cost - one) / (voices - 1)) : one;
  cell(100.0 * voice, 2, true);
  cell(100.0 * std::max(0.0, one - voice), 1, true);
  cell(100.0 * cost, 0, cost < 0.7);
  return row;
}

void print(const std::vector<std::string>& cells) {
  for (const std::string& cell : cells) {
    std::printf("| %s ", cell.c_str());
  }
  std::printf("|\n");
  std::fflush(stdout);
}

int print_table(const std::vector<std::string>& names, int step) {
  const std::vector<std::string> head = {"preset",
                                         "peak 20",
                                         "64",
                                         "100",
                                         "127",
                                         "keys dB",
                                         "LUFS",
                                         "ms",
                                         "T60 s",
                                         "let go",
                                         "centroid 20",
                                         "64",
                                         "127",
                                         "c 44.1",
                                         "c 48",
                                         "c 96",
                                         "unheard/silent",
                                         "DC dB",
                                         "corr",
                                         "mono dB",
                                         "ten dB",
                                         "limiter dB",
                                         "CPU %",
                                         "body",
                                         "all"};
  print(head);
  print(std::vector<std::string>(head.size(), "---"));
  std::vector<double> loudness;
  int failures = 0;
  for (const std::string& name : names) {
    try {
      const Row row = measure(name, step);
      loudness.push_back(row.lufs);
      failures +=
          static_cast<int>(std::count_if(row.cells.begin(), row.cells.end(),
                                         [](const auto& cell) { return cell.ends_with('!'); }));
      print(row.cells);
    } catch (const std::runtime_error& error) {
      std::fprintf(stderr, "%s\n", error.what());
      ++failures;
    }
  }
  std::sort(loudness.begin(), loudness.end());
  if (!loudness.empty()) {
    std::printf("\nloudness %.1f to %.1f LUFS, median %.1f; %d marks\n", loudness.front(),
                loudness.back(), loudness[loudness.size() / 2], failures);
  }
  return failures;
}

// Tests that a bow speaks at all speeds and pressures, from 65 Hz upwards: at its key's pitch,
// before the bow has gained its speed or within 150 ms, and louder at higher speed. Returns the
// number of failures. The friction noise decides in which motion a string settles. One note in
// about 2,000 settles in a motion without the fundamental and may be quieter than a slower stroke.
// Such a note counts like a late one, and both strokes are repeated with other noise. The same
// happens to a repeated note with a probability of 1/2000, and to any of the 6,144 notes of four
// instruments twice with one of 0.2 %.
int bow(const std::string& name, int count) {
  Player player(name, 48000.0);
  if (!is_bowed(player.scene().preset)) {
    return 0;
  }
  int notes = 0;
  std::map<std::string, int> wrong;
  double slowest_s = 0.0;
  const int lowest_key = 36 - player.instrument().transpose;
  const auto stroke = [&](int key, double pressure, int velocity) {
    return player.play({{0.0, press(pressure)}, {0.0, note_on(key, velocity)}}, 1.0);
  };
  const auto steady_of = [](const Stereo& sound) { return sound.part(0.5, 1.0); };
  const auto level_of = [&](const Stereo& sound) { return decibels(peak_of(steady_of(sound))); };
  for (int key = lowest_key; key < lowest_key + 48; key += 2) {
    const double hz = wanted_hz(player, key);
    for (int pressed = 0; pressed < count; ++pressed) {
      const double pressure = static_cast<double>(pressed) / std::max(1, count - 1);
      double before_db = -1e9;
      int before_velocity = 0;
      for (int fast = 0; fast < count; ++fast) {
        const int velocity = 20 + 107 * fast / std::max(1, count - 1);
        const Stereo sound = stroke(key, pressure, velocity);
        const Pitch pitch = pitch_of(steady_of(sound), hz);
        const double attack = attack_s(sound, true);
        double level_db = level_of(sound);
        slowest_s = std::max(slowest_s, attack);
        const bool is_late = attack > longest_attack_s(player.scene().preset, key);
        const bool is_quiet = level_db <= before_db;
        const bool is_off = std::fabs(cents(pitch.heard_hz, hz)) > 50.0;
        if (is_quiet) {
          before_db = level_of(stroke(key, pressure, before_velocity));
          level_db = level_of(stroke(key, pressure, velocity));
        }
        wrong["late"] += is_late ? 1 : 0;
        wrong["off its pitch"] += is_off ? 1 : 0;
        wrong["no louder"] += is_quiet ? 1 : 0;
        wrong["any of these"] += is_late || is_off || is_quiet ? 1 : 0;
        wrong["no louder twice"] += level_db <= before_db ? 1 : 0;
        before_db = level_db;
        before_velocity = velocity;
        ++notes;
      }
    }
  }
  std::printf("%s: %d notes, the slowest speaks in %.0f ms", name.c_str(), notes, 1e3 * slowest_s);
  for (const auto& [what, times] : wrong) {
    std::printf(", %s %d", what.c_str(), times);
  }
  std::printf("\n");
  std::fflush(stdout);
  return wrong["any of these"] > notes / 20 || wrong["no louder twice"] > 0 ? 1 : 0;
}

int run(int argc, char** argv) {
  std::vector<std::string> names;
  std::vector<std::string> files;
  double seconds = 0.0;
  int step = 12;
  int random = 0;
  int bows = 0;
  int restrikes = 0;
  int played = 0;
  double tuner_hz = 0.0;
  double mono_hz = 0.0;
  double rounding_hz = 0.0;
  std::uint64_t seed = 1;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word.starts_with("--") && i + 1 == argc) {
      std::fprintf(stderr, "%s needs a number\n", word.c_str());
      return 2;
    }
    if (word == "--keys") {
      step = std::max(1, std::atoi(argv[++i]));
    } else if (word == "--random") {
      random = std::max(1, std::atoi(argv[++i]));
    } else if (word == "--bows") {
      bows = std::max(1, std::atoi(argv[++i]));
    } else if (word == "--restrikes") {
      restrikes = std::atoi(argv[++i]);
    } else if (word == "--mono") {
      mono_hz = std::atof(argv[++i]);
    } else if (word == "--rounding") {
      rounding_hz = std::atof(argv[++i]);
    } else if (word == "--played") {
      played = std::max(1, std::atoi(argv[++i]));
    } else if (word == "--tuner") {
      tuner_hz = std::atof(argv[++i]);
    } else if (word == "--seconds") {
      seconds = std::atof(argv[++i]);
    } else if (word == "--seed") {
      seed = std::strtoull(argv[++i], nullptr, 10);
    } else if (word.starts_with("--")) {
      std::fprintf(stderr, "unknown option %s\n", word.c_str());
      return 2;
    } else {
      (is_midi_file_name(word) ? files : names).push_back(word);
    }
  }
  if (names.empty() && !files.empty()) {
    names = {"Piano",          "Harp",       "Harpsichord", "NylonGuitar", "SteelGuitar",
             "ElectricGuitar", "BassGuitar", "Violin",      "Vibraphone",  "Marimba"};
  } else if (names.empty()) {
    names = known_presets();
  }
  if (played > 0) {
    return print_played(names, played) == 0 ? 0 : 1;
  }
  if (!files.empty()) {
    print_midi_head();
  } else if (random == 0 && bows == 0 && restrikes == 0 && mono_hz == 0.0 && tuner_hz == 0.0 &&
             rounding_hz == 0.0) {
    return print_table(names, step) == 0 ? 0 : 1;
  }
  int failures = 0;
  for (const std::string& name : names) {
    try {
      if (!files.empty()) {
        failures += play_midi_files(name, files, seconds);
      } else if (bows > 0) {
        failures += bow(name, bows);
      } else if (restrikes > 0) {
        Player player(name, 44100.0);
        failures += check_restrikes(player, name, restrikes);
      } else if (mono_hz > 0.0) {
        Player player(name, mono_hz);
        failures += check_mono(player, name);
      } else if (rounding_hz > 0.0) {
        failures += check_rounding(name, rounding_hz);
      } else if (tuner_hz > 0.0) {
        Player player(name, tuner_hz, false);
        failures += check_semitones(player, name);
      } else {
        Player player(name, 48000.0);
        failures += play_random_settings(player, name, random, seed);
      }
    } catch (const std::runtime_error& error) {
      std::fprintf(stderr, "%s\n", error.what());
      ++failures;
    }
  }
  return failures == 0 ? 0 : 1;
}

}  // namespace
}  // namespace ressort::voicing

int main(int argc, char** argv) {
  return ressort::voicing::run(argc, argv);
}
