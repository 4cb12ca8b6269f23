#include "app/control/desk.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "app/control/calls.h"
#include "app/session/files.h"
#include "app/text.h"
#include "core/model/language/expression.h"
#include "core/model/preset/preset.h"

namespace ressort {

namespace fs = std::filesystem;

std::shared_ptr<const Loaded> loaded(const Desk& desk) {
  auto current = desk.session.current();
  return current->serial != 0 ? current : nullptr;
}

namespace {

// --- playing ------------------------------------------------------------------------------------

const Error nothing_loaded{
    "no model is loaded yet; 'models' lists what there is, 'load NAME' "
    "loads one"};

// Sends a playing call to the audio thread; all of its events act together.
Result<std::vector<Event>> play(Desk& desk, const Call& call) {
  if (!loaded(desk)) {
    return nothing_loaded;
  }
  auto events = desk.session.events(call);
  if (!events) {
    Error error = events.error();
    if (const std::string address = call.address + ": "; error.message.starts_with(address)) {
      error.message.erase(0, address.size());
    }
    return error;
  }
  std::vector<TimedEvent> timed;
  for (const Event& event : *events) {
    timed.push_back({.event = event});
  }
  if (!desk.process.send(desk.process.from_console, timed)) {
    return Error{"the audio thread is busy and took nothing; try again"};
  }
  desk.session.remember(timed);
  return events;
}

Result<Done> play_words(Desk& desk, std::string address, Words words) {
  Call call{std::move(address), {}};
  for (const std::string& word : words) {
    call.arguments.push_back(to_argument(word));
  }
  if (auto played = play(desk, call); !played) {
    return played.error();
  }
  return Done{};
}

// The number of the input that a gesture goes to: as typed, or the first that knows it.
Result<std::string> input_for(const Desk& desk, bool InputInfo::*knows, const std::string& gesture,
                              const std::string* word) {
  const auto current = loaded(desk);
  if (!current) {
    return nothing_loaded;
  }
  if (word != nullptr) {
    double number = 0.0;
    if (!parse_number(*word, number) || number != std::floor(number) || number < 1.0) {
      return Error{"the input must be a whole number from 1, found '" + *word + "'"};
    }
    return print_number(number);
  }
  for (const InputInfo& input : current->instrument.inputs) {
    if (input.*knows) {
      return std::to_string(input.number);
    }
  }
  return Error{current->name + " has no input with a " + gesture +
               "; 'explain' tells what it has, 'noteon 60' plays it"};
}

}  // namespace

Result<Done> act::note_on(Desk& desk, Words words) {
  return play_words(desk, "/note/on", words);
}

Result<Done> act::note_off(Desk& desk, Words words) {
  return play_words(desk, "/note/off", words);
}

Result<Done> act::panic(Desk& desk, Words words) {
  return play_words(desk, "/panic", words);
}

Result<Done> act::pluck(Desk& desk, Words words) {
  const auto input =
      input_for(desk, &InputInfo::can_pluck, "pluck", words.empty() ? nullptr : &words[0]);
  if (!input) {
    return input.error();
  }
  const std::string strength = words.size() > 1 ? words[1] : "0.8";
  return play_words(desk, "/in/" + *input + "/pluck", {&strength, 1});
}

Result<Done> act::bow(Desk& desk, Words words) {
  const auto input =
      input_for(desk, &InputInfo::can_bow, "bow", words.size() > 2 ? &words[2] : nullptr);
  if (!input) {
    return input.error();
  }
  return play_words(desk, "/in/" + *input + "/bow",
                    words.first(std::min<std::size_t>(2, words.size())));
}

namespace {

// Semitone by semitone from a C; the upper row of letters has the black keys.
constexpr std::string_view piano = "awsedftgyhujkolp;'";

constexpr std::string_view piano_picture =
    "    w   e       t   y   u       o   p\n"
    "  a   s   d   f   g   h   j   k   l   ;   '\n"
    "  C   D   E   F   G   A   B   C   D   E   F\n"
    "z and x: an octave down and up; q: back to the commands";

}  // namespace

Result<Done> act::keys(Desk& desk, Words) {
  if (!desk.keyboard) {
    return Error{"'keys' needs a terminal to play from; 'noteon 60' plays without one"};
  }
  if (!loaded(desk)) {
    return nothing_loaded;
  }
  desk.print(std::string(piano_picture));
  int octave = 4;
  double sounding = -1.0;  // a key; none below 0
  std::optional<Error> failure;
  const auto send = [&](const char* address, double key) {
    if (auto played = play(desk, {address, {key}}); !played) {
      failure = played.error();
    }
  };
  const auto release = [&] {
    if (sounding >= 0.0) {
      send("/note/off", sounding);
    }
    sounding = -1.0;
  };
  desk.keyboard([&](char typed) {
    constexpr char control_c = 3;
    constexpr char control_d = 4;
    constexpr char escape = 27;
    const char key = static_cast<char>(std::tolower(static_cast<unsigned char>(typed)));
    release();
    if (key == 'q' || key == control_c || key == control_d || key == escape) {
      return false;
    }
    if (key == 'z' || key == 'x') {
      octave = std::clamp(octave + (key == 'x' ? 1 : -1), -1, 8);
      desk.print("a plays key " + std::to_string(12 * (octave + 1)));
    } else if (const auto semitone = piano.find(key); key != 0 && semitone != piano.npos) {
      sounding = 12.0 * (octave + 1) + static_cast<double>(semitone);
      send("/note/on", sounding);
    }
    return !failure;
  });
  release();
  if (failure) {
    return *failure;
  }
  return Done{};
}

// --- models -------------------------------------------------------------------------------------

Result<Done> act::load(Desk& desk, Words words) {
  const auto result = desk.session.load_and_wait(words[0], words.size() > 1);
  if (!result) {
    return Error{"'" + words[0] + "' was not loaded\n" + result.error().message};
  }
  const Loaded& now = **result;
  const Instrument& instrument = now.instrument;
  std::string text = now.name + ": " + counted(instrument.masses, "mass", "masses") + ", " +
                     counted(instrument.links, "link", "links") + ", " +
                     counted(static_cast<std::size_t>(instrument.voices), "voice", "voices") +
                     ", loaded in " + fixed(now.load_ms, 1) + " ms";
  for (const std::string& warning : now.warnings) {
    text += "\n" + warning;
  }
  desk.print(text);
  return Done{};
}

namespace {

std::string description_of(const std::string& preset_name) {
  const fs::path path =
      fs::path(models_folder()).parent_path() / "presets" / (preset_name + ".toml");
  const auto text = read_text(path.string(), max_preset_bytes);
  if (!text) {
    return "";
  }
  return parse_preset(*text).preset.description;
}

}  // namespace

Result<Done> act::models(Desk& desk, Words) {
  std::vector<std::vector<std::string>> rows;
  for (const std::string& name : known_presets()) {
    rows.push_back({name, description_of(name)});
  }
  const std::string bare = joined(known_models(), ", ");
  desk.print(rows.empty() && bare.empty()
                 ? "nothing in '" + models_folder() + "'; 'load FILE.mdl' loads a file of yours"
                 : "Presets\n" + table(rows, 2) + "\nModels as they are written\n  " + bare);
  return Done{};
}

Result<Done> act::params(Desk& desk, Words) {
  const auto current = loaded(desk);
  if (!current) {
    return nothing_loaded;
  }
  const bool is_proved = current->instrument.verdict == Verdict::stable;
  std::vector<std::vector<std::string>> rows;
  for (const ParameterInfo& info : current->instrument.parameters) {
    rows.push_back({info.name, print_number(desk.session.parameter(info.name).value_or(info.value)),
                    print_number(info.minimum) + " .. " + print_number(info.maximum),
                    is_proved ? describe(info.safe) : ""});
  }
  desk.print(rows.empty() ? current->name + " has no parameters" : table(rows));
  return Done{};
}

Result<Done> act::get(Desk& desk, Words words) {
  const auto current = loaded(desk);
  if (!current) {
    return nothing_loaded;
  }
  std::vector<std::string> found;
  std::vector<std::string> names;
  for (const ParameterInfo& info : current->instrument.parameters) {
    names.push_back(info.name);
    if (fits(words[0], info.name)) {
      const double value = desk.session.parameter(info.name).value_or(info.value);
      found.push_back(info.name + " = " + print_number(value));
    }
  }
  if (found.empty()) {
    return Error{current->name + " has no parameter '" + words[0] + "'; it has " +
                 (names.empty() ? "none" : joined(names, ", "))};
  }
  desk.print(joined(found, "\n"));
  return Done{};
}

Result<Done> act::set(Desk& desk, Words words) {
  const auto current = loaded(desk);
  const Call call{"/param/" + words[0], {to_argument(words[1])}};
  const auto events = play(desk, call);
  if (!events) {
    return events.error();
  }
  double wanted = 0.0;
  parse_number(words[1], wanted);
  std::vector<std::string> lines;
  for (const Event& event : *events) {
    // A model that was loaded by another thread meanwhile has other parameters.
    if (event.model != current->serial) {
      continue;
    }
    const ParameterInfo& info = current->instrument.parameters[event.index];
    std::string line = info.name + " = " + print_number(event.value);
    if (event.value != wanted) {
      line += ", the " + std::string(event.value < wanted ? "highest" : "lowest") + " it may be";
    }
    const std::string limited = told_limit(call, event, current->instrument);
    lines.push_back(limited.empty() ? std::move(line) : limited);
  }
  desk.print(joined(lines, "\n"));
  return Done{};
}

// --- looking ------------------------------------------------------------------------------------

namespace {

// ", 24 semitones lower", or nothing.
std::string transposition(int semitones) {
  return semitones == 0 ? ""
                        : ", " + std::to_string(std::abs(semitones)) +
                              (semitones < 0 ? " semitones lower" : " semitones higher");
}

std::string peak(double level_db) {
  return level_db > -120.0 ? "peak " + fixed(std::min(level_db, -0.0) + 0.0, 1) + " dBFS"
                           : std::string("silence");
}

// Three digits of it.
std::string about(double number) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3g", number);
  return text.data();
}

// What modes hold is not known, nor, while a hand moves, what is lost.
std::string describe_energy(const Status& now) {
  if (now.voices == 0) {
    return "none";
  }
  const std::string voices = "; " + std::to_string(now.voices) + " of " +
                             counted(static_cast<std::size_t>(now.max_voices), "voice", "voices");
  if (!now.is_whole) {
    return (now.energy > 0.0 ? about(now.energy) + " and that of modes" : "not known of modes") +
           voices;
  }
  const std::string change = now.is_driven     ? "driven from outside"
                             : now.loss == 0.0 ? "neither rising nor falling"
                                               : (now.loss > 0.0 ? "falling by " : "rising by ") +
                                                     about(std::fabs(now.loss)) + " a second";
  return about(now.energy) + ", " + change + voices;
}

}  // namespace

Result<Done> act::status(Desk& desk, Words) {
  const Status now = desk.session.status();
  const std::string limiter = now.limited_db > -0.05
                                  ? "limiter idle"
                                  : "limiter down to " + fixed(now.limited_db, 1) + " dB";
  std::vector<std::vector<std::string>> rows = {
      {"model",
       now.model.empty() ? "none" : now.model + ", loaded in " + fixed(now.load_ms, 1) + " ms"},
      {"audio", now.backend.empty() ? "no backend" : now.backend},
      {"rate", print_number(now.rate_hz) + " Hz, " + std::to_string(now.period_frames) +
                   " frames a period"},
      {"cpu", now.cpu < 0.0 ? "nothing runs"
                            : fixed(100.0 * now.cpu, 1) + " % of the time there is, at most " +
                                  fixed(100.0 * now.cpu_peak, 1) + " since the last status"},
      {"voices", std::to_string(now.voices) + " of " + std::to_string(now.max_voices) + ", " +
                     std::to_string(now.stolen) + " stolen, " + std::to_string(now.shed) +
                     " shed for want of time"},
      {"asleep", fixed(100.0 * now.saved, 0) + " % of what all voices would take"},
      {"energy", describe_energy(now)},
      {"output", peak(now.peak_db) + " since the last status, " + limiter},
      {"xruns", std::to_string(now.xruns) + "; " + counted(now.overruns, "period", "periods") +
                    " took too long to compute"},
      {"resets", std::to_string(now.resets) + " voices that became unstable"},
      {"limits", std::to_string(now.beyond) + " times a parameter was kept where it is stable"},
      {"events", std::to_string(now.late) + " late, " + std::to_string(now.dropped) + " dropped, " +
                     std::to_string(now.malformed) + " malformed, " +
                     std::to_string(now.strangers) + " ignored"},
  };
  if (now.modes > 0) {
    const double saved =
        100.0 * (1.0 - static_cast<double>(now.modes_awake) / static_cast<double>(now.modes));
    rows.push_back({"modes", std::to_string(now.modes_awake) + " of " + std::to_string(now.modes) +
                                 " awake, saves " + fixed(saved, 0) + " %"});
  }
  if (desk.recorder.is_running()) {
    rows.push_back({"recording", "yes"});
  }
  desk.print(table(rows));
  return Done{};
}

namespace {

std::string describe(const InputInfo& input) {
  std::vector<std::string> gestures;
  if (input.can_pluck) {
    gestures.emplace_back("pluck");
  }
  if (input.can_bow) {
    gestures.emplace_back("bow");
  }
  return std::string(input.is_force ? "a force on " : "a hand at ") +
         (input.attached_to.empty() ? "nothing" : input.attached_to) +
         (gestures.empty() ? "" : "; knows " + joined(gestures, " and "));
}

}  // namespace

namespace {

std::string describe_stability(const Instrument& instrument) {
  if (instrument.verdict == Verdict::unstable) {
    return "none: it plays by force, and what runs away fades out";
  }
  const std::string proved = instrument.verdict == Verdict::stable ? "proved" : "not proved";
  const double margin = instrument.stiffness_margin;
  return margin >= most_bounded ? "nothing to bound"
         : margin >= 1.0 ? proved + "; every stiffness may grow " + fixed(margin, 2) + " times"
                         : proved + " while nothing touches; with what may, up to " +
                               fixed(std::max(0.0, margin), 2) + " of the stiffness";
}

}  // namespace

Result<Done> act::explain(Desk& desk, Words) {
  const auto current = loaded(desk);
  if (!current) {
    return nothing_loaded;
  }
  const Instrument& instrument = current->instrument;
  std::vector<std::vector<std::string>> rows = {
      {"model", current->model_path},
      {"lowest mode", instrument.mode
                          ? fixed(instrument.mode->frequency_hz, 2) + " Hz as it is written"
                          : "none that keys could tune"},
      {"keys", instrument.is_tuned ? "set the pitch" + transposition(instrument.transpose) +
                                         ", up to " + fixed(instrument.highest_frequency_hz, 1) +
                                         " Hz; higher ones are folded down by octaves"
                                   : "all sound as the model is written"},
      {"stability", describe_stability(instrument)},
  };
  for (const InputInfo& input : instrument.inputs) {
    rows.push_back({"input " + std::to_string(input.number), describe(input)});
  }
  rows.push_back({"outputs", std::to_string(instrument.outputs)});
  std::string text = current->name;
  text += current->description.empty() ? "\n" : ": " + current->description + "\n";
  desk.print(text + describe(current->plan) + table(rows));
  return Done{};
}

Result<Done> act::record(Desk& desk, Words words) {
  if (words[0] == "stop") {
    auto told = desk.recorder.stop();
    if (!told) {
      return told.error();
    }
    desk.print(*told);
    return Done{};
  }
  const Existing existing = words.size() > 1 ? Existing::replace : Existing::refuse;
  if (auto started = desk.recorder.start(words[0], existing); !started) {
    return started.error();
  }
  desk.print("recording to " + words[0] + "; 'rec stop' ends it");
  return Done{};
}

Result<Done> act::quit(Desk& desk, Words) {
  desk.has_quit = true;
  return Done{};
}

}  // namespace ressort
