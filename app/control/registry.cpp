#include "app/control/registry.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "app/control/console_commands.h"
#include "app/control/note_events.h"
#include "app/control/osc/answers.h"
#include "app/control/osc/subscribers.h"
#include "app/text.h"
#include "core/engine/midi/channels.h"
#include "core/model/language/expression.h"

namespace ressort {
namespace {

// --- what plays ---------------------------------------------------------------------------------

// On the channel that the instrument listens to.
Events one(const Said& said, Event event) {
  event.channel = said.instrument.channel;
  return std::vector{event};
}

// Of the parameters that a pattern names.
Events set_parameters(const Said& said) {
  std::vector<Event> events;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < said.instrument.parameters.size(); ++i) {
    const ParameterInfo& info = said.instrument.parameters[i];
    names.push_back(info.name);
    if (info.audio_input > 0 && said.name == info.name) {
      return Error{said.message.address + ": input " + std::to_string(info.audio_input) +
                   " gives it, sample by sample; it cannot be set"};
    }
    if (info.audio_input == 0 && fits(said.name, info.name)) {
      events.push_back({.kind = EventKind::parameter,
                        .index = static_cast<std::uint16_t>(i),
                        .model = said.serial,
                        .value = std::clamp(said.arguments[0], info.minimum, info.maximum)});
    }
  }
  if (events.empty()) {
    return Error{said.message.address + ": the model has no such parameter; it has " +
                 (names.empty() ? "none" : joined(names, ", ")) + did_you_mean(said.name, names)};
  }
  return events;
}

Events play_input(const Said& said, const GestureRow& gesture) {
  const InputInfo& input = *said.input;
  std::string misfit;
  if (gesture.live == Live::by_preset && !input.knows(gesture.gesture)) {
    misfit = "has no " + std::string(gesture.name) + " in this preset";
  } else if (gesture.live != Live::by_preset &&
             input.is_force != (gesture.live == Live::on_forces)) {
    misfit = input.is_force ? "takes a force, no position: use /in/N/force"
                            : "takes a position, no force: use /in/N/position";
  }
  if (!misfit.empty()) {
    return Error{said.message.address + ": input " + std::to_string(input.number) + " " + misfit};
  }
  return one(said, {.kind = EventKind::gesture,
                    .gesture = gesture.gesture,
                    .index = static_cast<std::uint16_t>(input.number),
                    .model = said.serial,
                    .value = said.arguments[0],
                    .value2 = said.arguments[1]});
}

// --- the rows -----------------------------------------------------------------------------------

std::vector<Row> make_rows() {
  const Row first[] = {
      {.address = "/note/on",
       .arguments = {{"KEY", "the key", 0, 127},
                     {"VELOCITY", "the velocity", 0, 127, 100},
                     {"ID", "the ID", 0, most_note_ids, 0}},
       .does =
           "starts a note; key 0-127, velocity 1-127 (100), or as a float up to 1 a share of the "
           "loudest; ID 1-16 lets the note be bent, pressed and slid alone",
       .play = events::note_on,
       .command = "noteon",
       .group = CommandGroup::playing,
       .words = "KEY [VELOCITY]",
       .command_does = "starts a note; 60 is the middle C",
       .details = "KEY is 0 to 127, VELOCITY is 1 to 127, or 100 if it is left out."},
      {.address = "/note/off",
       .arguments = {{"KEY", "the key", 0, 127},
                     {"VELOCITY", "the velocity", 0, 127, 63.5},
                     {"ID", "the ID", 0, most_note_ids, 0}},
       .does = "ends a note; the velocity is that of the release",
       .play = events::note_off,
       .command = "noteoff",
       .group = CommandGroup::playing,
       .words = "KEY",
       .details = "KEY is 0 to 127."},
      {.address = "/note/hz",
       .arguments = {{"ID", "the ID", 1, most_note_ids},
                     {"HZ", "the frequency", 1, 20000},
                     {"VELOCITY", "the velocity", 0, 127, 100}},
       .does = "starts a note of this frequency; ID 1-16; velocity as of /note/on",
       .play = events::note_hz},
      {.address = "/note/end",
       .arguments = {{"ID", "the ID", 1, most_note_ids}},
       .does = "ends the notes of this ID",
       .play = events::note_end},
      {.address = "/note/bend",
       .arguments = {{"ID", "the ID", 1, most_note_ids},
                     {"SEMITONES", "the bend", -note_bend_semitones, note_bend_semitones}},
       .does = "bends this note alone; semitones, -48 to 48; it stays for the ID's next note",
       .play = events::note_bend},
      {.address = "/note/pressure",
       .arguments = {{"ID", "the ID", 1, most_note_ids}, {"VALUE", "the pressure", 0, 127}},
       .does = "presses this note alone, 0-127",
       .play = events::note_pressure},
      {.address = "/note/slide",
       .arguments = {{"ID", "the ID", 1, most_note_ids}, {"VALUE", "the slide", 0, 127}},
       .does = "slides this note alone, as MPE does: controller 74, 0-127",
       .play = events::note_slide},
      {.command = "keys",
       .group = CommandGroup::playing,
       .command_does = "plays from the computer's keyboard",
       .details =
           "The letters are laid out as on a piano. A note lasts until the next, or a second.",
       .act = command::keys},
      {.address = "/cc",
       .arguments = {{"NUMBER", "the number", 0, 127}, {"VALUE", "the value", 0, 127}},
       .does = "a controller, as from a keyboard; value 0-127",
       .play =
           [](const Said& said) {
             return one(said, {.kind = EventKind::controller,
                               .index = said.whole(0),
                               .value = said.arguments[1] / 127.0});
           }},
      {.address = "/pressure",
       .arguments = {{"VALUE", "the pressure", 0, 127}},
       .does = "channel pressure, 0-127",
       .play =
           [](const Said& said) {
             return one(said, {.kind = EventKind::pressure, .value = said.arguments[0] / 127.0});
           }},
      {.address = "/bend",
       .arguments = {{"VALUE", "the bend", -1, 1}},
       .does = "pitch bend, -1 to 1 (two semitones)",
       .play =
           [](const Said& said) {
             return one(said, {.kind = EventKind::bend, .value = said.arguments[0]});
           }},
      {.command = "params",
       .group = CommandGroup::parameters,
       .command_does = "lists the parameters, their values and ranges",
       .act = command::params},
      {.command = "get",
       .group = CommandGroup::parameters,
       .words = "PARAMETER",
       .command_does = "tells a parameter's value",
       .details = "PARAMETER may be a pattern: 'get m_*' tells all that begin so.",
       .act = command::get},
      {.address = "/param/NAME",
       .arguments = {{"VALUE", "the value"}},
       .does = "a parameter: sets it, or answers its value",
       .play = set_parameters,
       .answer = answer::parameters,
       .command = "set",
       .group = CommandGroup::parameters,
       .words = "PARAMETER VALUE",
       .command_does = "turns a parameter; it stays within its range",
       .details = "PARAMETER may be a pattern: 'set *_Z 0.001' sets all that end so.",
       .act = command::set},
      {.command = "learn",
       .group = CommandGroup::parameters,
       .words = "PARAMETER",
       .command_does = "lets the knob that you move next turn a parameter",
       .details =
           "PARAMETER may be an OSC name of the preset's, such as /finger, too. The knob does "
           "nothing else\nmeanwhile. 'save NAME' keeps it.",
       .act = command::learn},
      {.command = "unlearn",
       .group = CommandGroup::parameters,
       .words = "[PARAMETER]",
       .command_does = "lets a knob, or all, do again what the preset says",
       .act = command::unlearn},
      {.command = "undo",
       .group = CommandGroup::parameters,
       .command_does = "takes back the last change of a parameter, or the last load",
       .details = "Whoever made it: knob, OSC or console. Turns within a second are one change. A "
                  "second 'undo'\ntakes back the first.",
       .act = command::undo},
      {.address = "/param/NAME/range",
       .does = "answers its minimum and maximum, and between what it is stable",
       .answer = answer::ranges},
  };
  std::vector<Row> rows(std::begin(first), std::end(first));
  for (const GestureRow& gesture : gestures) {
    if (gesture.live == Live::never) {
      continue;
    }
    Row row{.address = "/in/N/" + std::string(gesture.name),
            .does = gesture.live_does,
            .play = [](const Said& said) { return play_input(said, row_of(said.gesture)); },
            .gesture = gesture.gesture,
            .command = gesture.command.empty() ? "" : gesture.name,
            .group = CommandGroup::playing,
            .words = std::string(gesture.command),
            .command_does = gesture.command_does,
            .details = gesture.command_details};
    std::copy(std::begin(gesture.arguments), std::end(gesture.arguments), row.arguments);
    rows.push_back(std::move(row));
  }
  const Row last[] = {
      {.address = "/panic",
       .does = "silence at once",
       .play = [](const Said& said) { return one(said, {.kind = EventKind::panic}); },
       .command = "panic",
       .group = CommandGroup::playing,
       .details = "Every voice fades out."},
      {.address = "/model/load",
       .arguments = {{.word = "NAME", .is_text = true},
                     {.word = "ID", .otherwise = 0, .is_text = true}},
       .does = "loads a model or preset; answers /done or /fail",
       .answer = answer::load,
       .command = "load",
       .group = CommandGroup::models,
       .words = "MODEL [--force]",
       .command_does = "loads a model or a preset",
       .details =
           "MODEL is the name of a preset or a model that came with the program, or the path of a "
           ".mdl\nor .toml file. What sounds goes on until the new model is ready and then fades "
           "into it; if\nthere is an error in the file, it simply goes on. A model that is not "
           "stable is such an\nerror; --force plays it all the same, fading out what runs away.",
       .act = command::load},
      {.address = "/preset/load",
       .arguments = {{.word = "NAME", .is_text = true},
                     {.word = "ID", .otherwise = 0, .is_text = true}},
       .does = "the same for a preset",
       .answer = answer::load,
       .command = "preset",
       .group = CommandGroup::models,
       .words = "PRESET [--force]",
       .command_does = "the same; Tab offers the presets only",
       .details = "A preset is a model with ranges for its parameters and a plan of what plays it.",
       .act = command::load},
      {.address = "/preset/save",
       .arguments = {{.word = "NAME", .is_text = true}},
       .does = "saves what sounds, as it is now, among the user's presets, never over one that is "
               "there; answers /done or /fail",
       .answer = answer::save,
       .command = "save",
       .group = CommandGroup::models,
       .words = "NAME [--force]",
       .command_does = "keeps what sounds, as it is now, as a preset of yours",
       .details =
           "The values of the parameters, and what controllers have learnt, go to NAME.toml among "
           "your own\npresets, in $XDG_DATA_HOME/ressort/presets or "
           "~/.local/share/ressort/presets; "
           "'load NAME'\nbrings it back. --force writes over one that is there.",
       .act = command::save},
      {.command = "presets",
       .group = CommandGroup::models,
       .command_does = "lists the presets, yours among them, each with a line",
       .act = command::presets},
      {.command = "models",
       .group = CommandGroup::models,
       .command_does = "lists the presets and the models, yours among them",
       .details = "Presets go first, each with what it is; then the models that they are made of.",
       .act = command::models},
      {.address = "/status",
       .does = "answers voices, cpu load, xruns, resets, rate and more",
       .answer = answer::status,
       .command = "status",
       .group = CommandGroup::looking,
       .command_does = "tells what sounds, how loud, at what cost",
       .details = "The peak and the limiter's deepest cut are those since the last status.",
       .act = command::status},
      {.command = "explain",
       .group = CommandGroup::looking,
       .command_does = "tells how the model is computed and what plays it",
       .act = command::explain},
      {.address = "/modes",
       .arguments = {{"COUNT", "how many modes", 1, 10000, 32}},
       .does = "answers number, frequency, T60 and levels of the lowest modes, then their number",
       .answer = answer::modes,
       .command = "modes",
       .group = CommandGroup::looking,
       .words = "[COUNT]",
       .command_does = "lists the lowest modes: frequency, note, T60 and level",
       .details = "Levels are in dB below the loudest. Of the model as its parameters are now, at "
                  "the pitch that it\nis written with.",
       .act = command::modes},
      {.address = "/tune",
       .arguments = {{"MODE", "the mode", 1, 10000},
                     {.word = "NOTE|HZ [T60] [PART]", .is_text = true}},
       .does = "brings a mode to a pitch and a decay; answers /done or /fail",
       .answer = answer::tune,
       .command = "tune",
       .group = CommandGroup::parameters,
       .words = "MODE NOTE|HZ [T60] [PART]",
       .details = "Stiffness, and with a T60 in seconds damping, is scaled in all of the model, or "
                  "in what hangs\ntogether with a mass, string, mesh or link by its name. 'modes' "
                  "lists the modes; 'undo' takes\nit back, 'save NAME' keeps it.",
       .act = command::tune},
      {.address = "/subscribe",
       .arguments = {{"SECONDS", "the seconds", 0, Subscribers::longest_lease_s, 10}},
       .does =
           "sends every change, whoever makes it, for so long, at most 60 s (10): first all that "
           "is, then /loaded and /param/NAME; again renews it",
       .answer = answer::subscribe},
      {.address = "/unsubscribe", .does = "ends that", .answer = answer::unsubscribe},
      {.address = "/models",
       .does = "answers the name of each model, then their number",
       .answer = answer::models},
      {.address = "/presets",
       .does = "answers the name and the line of each preset, then their number",
       .answer = answer::presets},
      {.address = "/describe",
       .does = "answers a row for everything that can be set or asked",
       .answer = answer::describe},
      {.command = "tuning",
       .group = CommandGroup::playing,
       .words = "TUNING|off [TUNING]",
       .command_does = "tunes all keys by Scala files, or as the preset has them",
       .details =
           "TUNING is a scale, NAME.scl, or a keyboard map, NAME.kbm, or both. What sounds is "
           "tuned at once;\nmodels that are loaded later keep it.",
       .act = command::tuning},
      {.command = "rec",
       .words = "FILE|stop [--force]",
       .command_does = "records what is heard to a file, or ends that",
       .details =
           "The file's ending says what it is: .wav, .w64, .flac, .ogg, .aiff, .au or .caf; 24 "
           "bits a\nsample, and the rate of the audio. Over a sound file that is there it is "
           "written by --force\nonly.",
       .act = command::record},
      {.command = "wait",
       .words = "SECONDS",
       .command_does = "waits, for scripts and pipes: noteon 60, wait 0.5, noteoff 60",
       .act = command::wait},
      {.command = "help", .words = "[COMMAND]", .command_does = "tells more", .act = command::help},
      {.command = "quit", .command_does = "ends the program", .act = command::quit},
  };
  rows.insert(rows.end(), std::begin(last), std::end(last));
  for (Row& row : rows) {
    if (row.words.empty()) {
      row.words = row.arguments_text();
    }
    if (row.command_does.empty()) {
      row.command_does = row.does;
    }
  }
  return rows;
}

// --- addresses ----------------------------------------------------------------------------------

constexpr std::string_view answers[] = {"/error",        "/done",           "/fail",
                                        "/status.reply", "/describe.reply", "/describe.end",
                                        "/models.reply", "/models.end",     "/presets.reply",
                                        "/presets.end",  "/loaded",         "/subscribe.reply",
                                        "/modes.reply",  "/modes.end"};

// What stands before and after N or NAME; `hole` is empty where there is none.
struct Pattern {
  std::string_view before;
  std::string_view hole;
  std::string_view after;
};

Pattern pattern_of(const Row& row) {
  const std::string_view address = row.address;
  for (const std::string_view hole : {"/NAME", "/N"}) {
    if (const std::size_t at = address.find(hole); at != address.npos) {
      return {address.substr(0, at + 1), hole.substr(1), address.substr(at + hole.size())};
    }
  }
  return {address, "", ""};
}

// Of an address that begins as those of inputs do: the input, or why there is none.
Result<const InputInfo*> find_input(const Message& message, const Instrument& instrument,
                                    std::string_view number_text) {
  int number = 0;
  const auto failure =
      std::from_chars(number_text.data(), number_text.data() + number_text.size(), number).ec;
  for (const InputInfo& input : instrument.inputs) {
    if (failure == std::errc{} && input.number == number) {
      return &input;
    }
  }
  return Error{message.address + ": the model has " +
               (instrument.inputs.empty()
                    ? "no inputs"
                    : "the inputs 1 to " + std::to_string(instrument.inputs.back().number))};
}

Error unknown(const Message& message, const Instrument& instrument) {
  for (const Row& row : rows()) {
    const Pattern pattern = pattern_of(row);
    if (pattern.hole != "N" || !message.address.starts_with(pattern.before)) {
      continue;
    }
    const auto input = find_input(message, instrument,
                                  std::string_view(message.address).substr(pattern.before.size()));
    if (!input) {
      return input.error();
    }
    std::vector<std::string> known;
    for (const Row& other : rows()) {
      if (pattern_of(other).hole == "N") {
        known.emplace_back(pattern_of(other).after);
      }
    }
    const std::string last = known.back();
    known.pop_back();
    return Error{message.address + ": an input knows " + joined(known, ", ") + " and " + last};
  }
  return Error{"unknown address '" + message.address + "'; /describe lists what there is"};
}

// One address may drive several inputs and parameters.
Events custom_events(const Said& said) {
  std::vector<Event> events;
  for (const CustomInfo& info : said.instrument.custom) {
    if (info.address == said.message.address) {
      events.push_back({.kind = EventKind::custom,
                        .index = static_cast<std::uint16_t>(info.row),
                        .model = said.serial,
                        .value = said.arguments[0]});
    }
  }
  return events;
}

// What a preset gives to one of its controls.
const Row custom_row{.arguments = {{"VALUE", "the value", 0, 1}}, .play = custom_events};

// Reads the arguments of a message; nothing where they are as the row wants them.
std::optional<std::string> read_arguments(const Row& row, const Message& message,
                                          std::array<double, most_arguments>& values) {
  std::size_t count = 0;
  for (const CallArgument& wanted : row.arguments) {
    if (wanted.word.empty()) {
      break;
    }
    const std::string meaning(wanted.meaning);
    if (count >= message.arguments.size()) {
      if (!wanted.otherwise) {
        return meaning + " is missing";
      }
      values[count++] = *wanted.otherwise;
      continue;
    }
    const double* const value = std::get_if<double>(&message.arguments[count]);
    if (value == nullptr || !std::isfinite(*value)) {
      return meaning + " must be a number" +
             (value == nullptr ? ", found '" + std::get<std::string>(message.arguments[count]) + "'"
                               : "");
    }
    if (*value < wanted.least || *value > wanted.most) {
      return meaning + " must lie between " + print_number(wanted.least) + " and " +
             print_number(wanted.most) + ", found " + print_number(*value);
    }
    values[count++] = *value;
  }
  const std::size_t said = message.arguments.size();
  return count >= said ? std::nullopt
                       : std::optional("too many arguments: " + std::to_string(said) +
                                       ", expected " + std::to_string(count));
}

}  // namespace

std::uint16_t Said::whole(std::size_t argument) const {
  return static_cast<std::uint16_t>(std::lround(arguments[argument]));
}

bool Row::may_omit(const CallArgument& argument) const {
  return argument.otherwise || (play != nullptr && answer != nullptr);
}

std::string Row::arguments_text() const {
  std::vector<std::string> texts;
  for (const CallArgument& argument : arguments) {
    if (!argument.word.empty()) {
      const std::string word(argument.word);
      texts.push_back(may_omit(argument) ? "[" + word + "]" : word);
    }
  }
  return joined(texts, " ");
}

const std::vector<Row>& rows() {
  static const std::vector<Row> made = make_rows();
  return made;
}

std::vector<const Row*> addresses() {
  std::vector<const Row*> found;
  for (const Row& row : rows()) {
    if (!row.address.empty()) {
      found.push_back(&row);
    }
  }
  return found;
}

std::vector<const Row*> commands() {
  std::vector<const Row*> found;
  for (const Row& row : rows()) {
    if (!row.command.empty()) {
      found.push_back(&row);
    }
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Row* a, const Row* b) { return a->group < b->group; });
  return found;
}

std::string_view heading(CommandGroup group) {
  constexpr std::string_view headings[] = {"Models", "Playing", "Parameters", "Looking", "Other"};
  return headings[static_cast<std::size_t>(group)];
}

FoundRow find_row(std::string_view address) {
  FoundRow found;
  std::size_t longest = 0;  // what follows NAME; of two that fit, that of the longer is meant
  for (const Row& row : rows()) {
    const auto [before, hole, after] = pattern_of(row);
    if (row.address.empty() || (hole.empty() && address != before)) {
      continue;
    }
    if (hole.empty()) {
      return {&row, ""};
    }
    if (address.size() >= before.size() + after.size() && address.starts_with(before) &&
        address.ends_with(after) && (found.row == nullptr || after.size() > longest)) {
      longest = after.size();
      found = {&row, address.substr(before.size(), address.size() - before.size() - after.size())};
    }
  }
  return found;
}

bool is_answer(std::string_view address) {
  return std::find(std::begin(answers), std::end(answers), address) != std::end(answers);
}

bool is_reserved(std::string_view address) {
  return is_answer(address) || std::any_of(rows().begin(), rows().end(), [&](const Row& row) {
           const Pattern pattern = pattern_of(row);
           return pattern.hole.empty() ? address == row.address
                                       : address.starts_with(pattern.before);
         });
}

Events to_events(const Message& message, const Instrument& instrument, std::uint32_t serial) {
  auto [row, name] = find_row(message.address);
  if (row == nullptr &&
      std::any_of(instrument.custom.begin(), instrument.custom.end(),
                  [&](const CustomInfo& info) { return info.address == message.address; })) {
    row = &custom_row;
  }
  if (row == nullptr || row->play == nullptr) {
    return unknown(message, instrument);
  }
  Said said{.message = message,
            .instrument = instrument,
            .serial = serial,
            .name = name,
            .gesture = row->gesture};
  if (pattern_of(*row).hole == "N") {
    if (!std::all_of(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; })) {
      return unknown(message, instrument);
    }
    const auto input = find_input(message, instrument, name);
    if (!input) {
      return input.error();
    }
    said.input = *input;
  }
  const auto wrong = read_arguments(*row, message, said.arguments);
  return wrong ? Events(Error{message.address + ": " + *wrong}) : row->play(said);
}

std::string describe_limit(const Message& message, const Event& event,
                           const Instrument& instrument) {
  if (event.kind != EventKind::parameter || message.arguments.empty()) {
    return "";
  }
  const double* const wanted = std::get_if<double>(message.arguments.data());
  const ParameterInfo& info = instrument.parameters[event.index];
  const bool is_changed = wanted != nullptr && event.value != *wanted;
  return is_changed && (event.value < *wanted ? info.is_lowered : info.is_raised)
             ? info.name + ": " + print_number(*wanted) + " is beyond what is stable, set to " +
                   print_number(event.value)
             : "";
}

}  // namespace ressort
