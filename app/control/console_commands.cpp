#include "app/control/console_commands.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>

#include "app/control/status.h"
#include "app/session/files.h"
#include "app/text.h"
#include "core/model/language/expression.h"
#include "core/model/preset/edit.h"

namespace ressort::control {

namespace fs = std::filesystem;

namespace {

const Error nothing_loaded{
    "no model is loaded yet; 'models' lists them, 'load NAME' "
    "loads one"};

}  // namespace

std::shared_ptr<const Loaded> loaded(const ConsoleContext& console) {
  auto current = console.session.current();
  return current->serial != 0 ? current : nullptr;
}

// --- playing ------------------------------------------------------------------------------------

Result<std::vector<Event>> play(ConsoleContext& console, const Message& message) {
  const auto current = loaded(console);
  if (!current) {
    return nothing_loaded;
  }
  auto events = to_events(message, current->instrument, current->serial);
  if (!events) {
    Error error = events.error();
    if (const std::string address = message.address + ": "; error.message.starts_with(address)) {
      error.message.erase(0, address.size());
    }
    return error;
  }
  std::vector<TimedEvent> timed;
  for (const Event& event : *events) {
    timed.push_back({.event = event});
  }
  if (!console.process.send(console.process.from_console, timed)) {
    return Error{"the audio thread is busy and accepted no events; try again"};
  }
  console.session.remember(timed);
  return events;
}

std::string meant_parameter(const Instrument& instrument, const std::string& word) {
  const auto& known = instrument.parameters;
  const auto is = [&](bool in_any_case) {
    return std::ranges::find_if(known, [&](const ParameterInfo& info) {
      return in_any_case ? same_but_case(info.name, word) : info.name == word;
    });
  };
  const auto found = is(false) != known.end() ? is(false) : is(true);
  return found != known.end() ? found->name : word;
}

namespace {

// Returns the number of the input for a gesture: the number typed, or the first input that has it.
Result<std::string> input_for(const ConsoleContext& console, const GestureRow& gesture,
                              const std::string* word) {
  const auto current = loaded(console);
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
    if (input.knows(gesture.gesture)) {
      return std::to_string(input.number);
    }
  }
  return Error{current->name + " has no input with a " + std::string(gesture.name) +
               "; 'explain' lists its inputs, 'noteon 60' plays it"};
}

// Executes a command that only plays: its words are the arguments of its address, and INPUT.
Result<Done> play_words(ConsoleContext& console, const Row& row, Words words) {
  std::map<std::string, const std::string*> typed;  // Keyed by their names in the help.
  const std::vector<std::string> names = split_words(row.words);
  for (std::size_t i = 0; i < std::min(words.size(), names.size()); ++i) {
    typed[names[i].front() == '[' ? names[i].substr(1, names[i].size() - 2) : names[i]] = &words[i];
  }
  Message message{row.address, {}};
  if (const std::size_t at = message.address.find("/N/"); at != message.address.npos) {
    const auto input = input_for(console, row_of(row.gesture), typed["INPUT"]);
    if (!input) {
      return input.error();
    }
    message.address.replace(at + 1, 1, *input);
  }
  for (const CallArgument& argument : row.arguments) {
    if (const std::string* const word = typed[std::string(argument.word)]) {
      message.arguments.push_back(to_argument(*word));
    } else if (argument.console_value) {
      message.arguments.emplace_back(*argument.console_value);
    } else {
      break;
    }
  }
  if (auto played = play(console, message); !played) {
    return played.error();
  }
  return Done{};
}

}  // namespace

Result<Done> run_command(ConsoleContext& console, const Row& row, Words words) {
  if (row.needs_scene && !loaded(console)) {
    return nothing_loaded;
  }
  return row.act != nullptr ? row.act(console, words) : play_words(console, row, words);
}

namespace {

// Semitones upwards from C; the upper row of letters has the black keys.
constexpr std::string_view piano = "awsedftgyhujkolp;'";

constexpr std::string_view piano_picture =
    "    w   e       t   y   u       o   p\n"
    "  a   s   d   f   g   h   j   k   l   ;   '\n"
    "  C   D   E   F   G   A   B   C   D   E   F\n"
    "z and x: an octave down and up; q: back to the commands";

}  // namespace

Result<Done> command::keys(ConsoleContext& console, Words) {
  if (!console.keyboard) {
    return Error{"'keys' needs a terminal to play from; 'noteon 60' plays without one"};
  }
  if (!loaded(console)) {
    return nothing_loaded;
  }
  console.print(std::string(piano_picture));
  int octave = 4;
  double sounding = -1.0;  // The sounding key; below 0: none.
  std::optional<Error> failure;
  const auto send = [&](const char* address, double key) {
    if (auto played = play(console, {address, {key}}); !played) {
      failure = played.error();
    }
  };
  const auto release = [&] {
    if (sounding >= 0.0) {
      send("/note/off", sounding);
    }
    sounding = -1.0;
  };
  console.keyboard([&](char typed) {
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
      console.print("a plays key " + std::to_string(12 * (octave + 1)));
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

// --- models and presets --------------------------------------------------------------------------

Result<Done> command::load(ConsoleContext& console, Words words) {
  const auto result = console.session.load_and_wait(words[0], words.size() > 1);
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
  console.print(text);
  return Done{};
}

Result<Done> command::next_preset(ConsoleContext& console, Words) {
  const std::string name = console.session.preset_beside(1);
  return command::load(console, {&name, 1});
}

Result<Done> command::previous_preset(ConsoleContext& console, Words) {
  const std::string name = console.session.preset_beside(-1);
  return command::load(console, {&name, 1});
}

namespace {

std::string preset_table() {
  std::vector<std::vector<std::string>> rows;
  for (const std::string& name : known_presets()) {
    rows.push_back({name, preset_description(name)});
  }
  return table(rows, 2);
}

}  // namespace

Result<Done> command::models(ConsoleContext& console, Words) {
  const std::string presets = preset_table();
  const std::string bare = joined(known_models(), ", ");
  console.print(presets.empty() && bare.empty()
                    ? "nothing in '" + models_folder() + "'; 'load FILE.mdl' loads your own file"
                    : "Presets\n" + presets + "\nModels\n  " + bare);
  return Done{};
}

Result<Done> command::presets(ConsoleContext& console, Words) {
  const std::string all = preset_table();
  console.print(all.empty() ? "there are no presets; 'save NAME' makes one of the current sound"
                            : all);
  return Done{};
}

Result<Done> command::control(ConsoleContext& console, Words words) {
  const auto current = console.session.current();
  const auto& knobs = current->instrument.knobs;
  const auto meant = std::ranges::find_if(knobs, [&](const KnobInfo& knob) {
    return !words.empty() && same_but_case(knob.word, words[0]);
  });
  const std::string wanted = words.empty()          ? "*"
                             : meant != knobs.end() ? meant->word
                                                    : model::word_of(words[0]);
  if (words.size() == 2) {
    const auto events = play(console, {"/control/" + wanted, {to_argument(words[1])}});
    return events ? Result<Done>(Done{}) : events.error();
  }
  const Session::Present now = console.session.present();
  std::vector<std::vector<std::string>> rows;
  std::vector<std::string> known;
  for (std::size_t i = 0; i < now.knobs.size(); ++i) {
    const KnobInfo& knob = now.loaded->instrument.knobs[i];
    known.push_back(knob.word);
    if (fits(wanted, knob.word)) {
      rows.push_back({knob.word, fixed(now.knobs[i], 2), knob.help});
    }
  }
  if (rows.empty()) {
    return Error{current->name + " has no control '" + wanted + "'; it has " +
                 (known.empty() ? "none" : joined(known, ", ")) + did_you_mean(wanted, known)};
  }
  console.print(table(rows));
  return Done{};
}

Result<Done> command::params(ConsoleContext& console, Words) {
  const auto current = console.session.current();
  const bool is_proved = current->instrument.verdict == Verdict::stable;
  std::vector<std::vector<std::string>> rows;
  for (const ParameterInfo& info : current->instrument.parameters) {
    const std::string curve = curve_text(current->preset, info.name);
    rows.push_back({info.name,
                    print_number(console.session.parameter(info.name).value_or(info.value)),
                    print_number(info.minimum) + " .. " + print_number(info.maximum),
                    (is_proved ? describe(info.safe) : "") + (curve.empty() ? "" : "; ") + curve});
  }
  console.print(rows.empty() ? current->name + " has no parameters" : table(rows));
  return Done{};
}

Result<Done> command::get(ConsoleContext& console, Words words) {
  const auto current = console.session.current();
  std::vector<std::string> found;
  std::vector<std::string> names;
  const std::string meant = meant_parameter(current->instrument, words[0]);
  for (const ParameterInfo& info : current->instrument.parameters) {
    names.push_back(info.name);
    if (fits(meant, info.name)) {
      const double value = console.session.parameter(info.name).value_or(info.value);
      found.push_back(info.name + " = " + print_number(value));
    }
  }
  if (found.empty()) {
    return Error{current->name + " has no parameter '" + words[0] + "'; it has " +
                 (names.empty() ? "none" : joined(names, ", ")) + did_you_mean(words[0], names)};
  }
  console.print(joined(found, "\n"));
  return Done{};
}

Result<Done> command::set(ConsoleContext& console, Words words) {
  const auto current = console.session.current();
  const std::string meant = meant_parameter(current->instrument, words[0]);
  const Message message{"/param/" + meant, {to_argument(words[1])}};
  const auto events = play(console, message);
  if (!events) {
    return events.error();
  }
  double wanted = 0.0;
  parse_number(words[1], wanted);
  std::vector<std::string> lines;
  for (const Event& event : *events) {
    // A model loaded by another thread in the meantime has other parameters.
    if (event.model != current->serial) {
      continue;
    }
    const ParameterInfo& info = current->instrument.parameters[event.index];
    std::string line = info.name + " = " + print_number(event.value);
    if (event.value != wanted) {
      line += ", the " + std::string(event.value < wanted ? "highest" : "lowest") +
              " value of its range";
    }
    const std::string limited = describe_limit(message, event, current->instrument);
    lines.push_back(limited.empty() ? std::move(line) : limited);
  }
  console.print(joined(lines, "\n"));
  return Done{};
}

Result<Done> command::hit(ConsoleContext& console, Words words) {
  Message message{"/mass/" + words[0] + "/strike", {}};
  if (words.size() > 1) {
    message.arguments.push_back(to_argument(words[1]));
  }
  const auto events = play(console, message);
  return events ? Result<Done>(Done{}) : Result<Done>(events.error());
}

// --- information ---------------------------------------------------------------------------------

namespace {

// Returns ", 24 semitones lower", or an empty text.
std::string transposition(int semitones) {
  return semitones == 0 ? ""
                        : ", " + std::to_string(std::abs(semitones)) +
                              (semitones < 0 ? " semitones lower" : " semitones higher");
}

std::string describe(const InputInfo& input) {
  std::vector<std::string> known;
  for (const GestureRow& row : gestures) {
    if (row.live == Live::by_preset && input.knows(row.gesture)) {
      known.emplace_back(row.name);
    }
  }
  return std::string(input.is_force ? "a force on " : "a position at ") +
         (input.attached_to.empty() ? "nothing" : input.attached_to) +
         (known.empty() ? "" : "; accepts " + joined(known, " and "));
}

std::string describe_stability(const Instrument& instrument) {
  if (instrument.verdict == Verdict::unstable) {
    return "none: played with --force; voices that diverge fade out";
  }
  const std::string proved = instrument.verdict == Verdict::stable ? "proved" : "not proved";
  const double margin = instrument.stiffness_margin;
  return margin >= most_bounded ? "no limit"
         : margin >= 1.0
             ? proved + "; every stiffness may be multiplied by up to " + fixed(margin, 2)
             : proved + " without contacts; with all contacts closed, up to " +
                   fixed(std::max(0.0, margin), 2) + " of the stiffness";
}

// Returns the name of a control's knob and the number of its controller, of a controller without a
// knob the number, and of other controls the source.
std::vector<std::string> source_of(const ControlSetting& control, const Instrument& instrument) {
  if (control.source != ControlSource::controller) {
    return {source_name(control), ""};
  }
  const std::string controller = "controller " + std::to_string(control.number);
  for (const KnobInfo& knob : instrument.knobs) {
    if (knob.controller == control.number) {
      return {knob.name, controller + ' '};
    }
  }
  return {controller, ""};
}

// Returns a row such as "Ring" or "note" with its effect for every control and controller.
std::vector<std::vector<std::string>> control_rows(const ConsoleContext& console,
                                                   const Loaded& current) {
  std::vector<std::vector<std::string>> rows;
  const auto now = [&](const std::string& name) {
    const auto value = console.session.parameter(name);
    return value ? "; now " + print_number(*value) : "";
  };
  const std::vector<MappedRow> mapping = console.session.mapping();
  for (const MappedRow& row : mapping) {
    const std::string& target = row.setting.target;
    rows.push_back({name_of(row.setting.input),
                    is_action(target) ? target + ", mapped"
                    : !row.exists     ? "mapped to " + target + ", which this sound does not have"
                                      : "controls " + target +
                                        (row.is_learned ? ", learned" : ", mapped") + now(target)});
  }
  for (const ControlSetting& control : current.preset.controls) {
    const bool is_replaced = control.source == ControlSource::controller &&
                             std::ranges::any_of(mapping, [&](const MappedRow& row) {
                               return row.exists &&
                                      row.setting.input.source == ControllerSource::controller &&
                                      row.setting.input.number == control.number;
                             });
    if (is_replaced) {
      continue;
    }
    const bool turns = control.gesture == Gesture::parameter;
    // Six digits, because the values of a key between two points have many.
    char range[64];
    std::snprintf(range, sizeof range, "%.6g to %.6g%s", control.low, control.high,
                  control.range_keys.empty() ? "" : " on middle C, by key");
    const bool has_all_keys = control.lowest_key == 0 && control.highest_key == 127;
    const std::string keys = has_all_keys ? ""
                                          : ", keys " + std::to_string(control.lowest_key) +
                                                " to " + std::to_string(control.highest_key);
    const std::vector<std::string> source = source_of(control, current.instrument);
    rows.push_back({source[0], source[1] +
                                   (turns ? "controls " + control.target
                                          : std::string(row_of(control.gesture).name) + " at " +
                                                control.target) +
                                   ", " + range + (control.exponential ? ", exponential" : "") +
                                   keys + (turns ? now(control.target) : "")});
  }
  for (const KnobInfo& knob : current.instrument.knobs) {
    if (knob.controller < 0) {
      rows.push_back({knob.name, "control, " + print_number(knob.range.low) + " to " +
                                     print_number(knob.range.high) +
                                     (knob.range.exponential ? ", exponential" : "") +
                                     now(knob.name)});
    }
  }
  return rows;
}

}  // namespace

Result<Done> command::status(ConsoleContext& console, Words) {
  auto rows = status_lines(console.session.status());
  if (console.recorder.is_running()) {
    rows.push_back({"recording", "yes"});
  }
  console.print(table(rows));
  return Done{};
}

Result<Done> command::explain(ConsoleContext& console, Words) {
  const auto current = console.session.current();
  const Instrument& instrument = current->instrument;
  std::vector<std::vector<std::string>> rows = {
      {"model", current->model_path},
      {"tuned mode", instrument.mode ? fixed(instrument.mode->frequency_hz, 2) + " Hz as written"
                                     : "none that keys can tune"},
      {"keys", instrument.mode
                   ? "set the pitch" + transposition(instrument.transpose) + ", up to " +
                         fixed(instrument.highest_frequency_hz, 1) + " Hz; higher keys are silent"
                   : "all play the pitch written in the model"},
      {"stability", describe_stability(instrument)},
  };
  for (const InputInfo& input : instrument.inputs) {
    rows.push_back({"input " + std::to_string(input.number), describe(input)});
  }
  rows.push_back({"outputs", std::to_string(instrument.outputs)});
  for (std::vector<std::string>& row : control_rows(console, *current)) {
    rows.push_back(std::move(row));
  }
  std::string text = current->name;
  text += current->description.empty() ? "\n" : ": " + current->description + "\n";
  console.print(text + describe(current->plan) + table(rows));
  return Done{};
}

Result<Done> command::tuning(ConsoleContext& console, Words words) {
  const auto current = console.session.current();
  std::vector<TimedEvent> events;
  if (words[0] == "off" && words.size() == 1) {
    events.push_back({.event = {.kind = EventKind::tuning_reset}});
  } else {
    std::string scale;
    std::string map;
    for (const std::string& word : words) {
      std::string& path = word.ends_with(".kbm") ? map : scale;
      if (!path.empty() ||
          !(word.ends_with(".scl") || word.ends_with(".ascl") || word.ends_with(".kbm"))) {
        return Error{"expected a scale, NAME.scl, a keyboard map, NAME.kbm, or off; found '" +
                     word + "'"};
      }
      path = word;
    }
    const TuningReading tuning = read_tuning(scale, map);
    if (tuning.failure) {
      return Error{to_string(*tuning.failure)};
    }
    const double ratio = current->instrument.a4_hz / usual_a4_hz;
    for (std::size_t key = 0; key < tuning.keys_hz.size(); ++key) {
      events.push_back({.event = {.kind = EventKind::key_tuning,
                                  .index = static_cast<std::uint16_t>(key),
                                  .value = ratio * tuning.keys_hz[key],
                                  .value2 = 1.0}});
    }
  }
  if (!console.process.send(console.process.from_console, events)) {
    return Error{"the audio thread is busy and accepted no events; try again"};
  }
  console.session.set_tuning(words[0] == "off"
                                 ? std::vector<std::string>()
                                 : std::vector<std::string>(words.begin(), words.end()));
  return Done{};
}

Result<Done> command::record(ConsoleContext& console, Words words) {
  if (words[0] == "stop") {
    auto summary = console.recorder.stop();
    if (!summary) {
      return summary.error();
    }
    console.print(*summary);
    return Done{};
  }
  const Existing existing = words.size() > 1 ? Existing::replace : Existing::refuse;
  if (auto started = console.recorder.start(words[0], existing); !started) {
    return started.error();
  }
  console.print("recording to " + words[0] + "; 'rec stop' ends it");
  return Done{};
}

Result<Done> command::quit(ConsoleContext& console, Words) {
  console.has_quit = true;
  return Done{};
}

}  // namespace ressort::control
