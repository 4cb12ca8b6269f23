#include "app/control/rows.h"

#include <algorithm>
#include <charconv>
#include <iterator>
#include <optional>
#include <utility>

#include "app/control/console_commands.h"
#include "app/control/note_events.h"
#include "app/control/osc/answers.h"
#include "app/control/osc/subscribers.h"
#include "app/text.h"
#include "core/engine/midi/channels.h"

namespace ressort::control {
namespace {

// --- playing -------------------------------------------------------------------------------------

// Puts the event on the instrument's channel.
Events one(const Said& said, Event event) {
  event.channel = said.instrument.channel;
  return std::vector{event};
}

// Sets the parameters that a pattern matches.
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

// Finds the mass NAME, or "NAME:3", the third mass of a macro, or the place "NAME:0.3"; else
// returns the reason why there is none.
Result<std::uint32_t> find_mass(std::span<const StruckInfo> known, std::string_view name) {
  const auto find = [&](std::string_view wanted) {
    const auto found =
        std::lower_bound(known.begin(), known.end(), wanted,
                         [](const StruckInfo& info, std::string_view n) { return info.name < n; });
    return found != known.end() && found->name == wanted ? found : known.end();
  };
  if (const auto one = find(name); one != known.end() && one->moves.empty()) {
    return one->first;
  }
  const std::size_t colon = std::min(name.find(':'), name.size());
  const auto found = find(name.substr(0, colon));
  if (found != known.end() && !found->moves.empty()) {
    std::uint32_t at = 0;
    const char* const end = name.data() + name.size();
    const auto read = std::from_chars(std::min(name.data() + colon + 1, end), end, at);
    if (read.ec == std::errc{} && read.ptr == end && at >= 1 && at <= found->moves.size()) {
      return found->moves[at - 1] ? Result<std::uint32_t>(found->first + at - 1)
                                  : Error{std::string(name) + " is held, or nobody hears it"};
    }
  }
  constexpr std::size_t most_named = 8;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < std::min(known.size(), most_named); ++i) {
    const auto& [other, first, moves] = known[i];
    names.push_back(moves.empty() ? other
                                  : other + ":1 to " + other + ":" + std::to_string(moves.size()));
  }
  return Error{"the model has no such mass; it has " +
               (names.empty() ? "none" : joined(names, ", ")) +
               (known.size() > most_named ? " and others" : "")};
}

Events strike(const Said& said) {
  const auto mass = find_mass(said.instrument.struck, said.name);
  if (!mass) {
    return Error{said.message.address + ": " + mass.error().message};
  }
  return one(said, {.kind = EventKind::strike,
                    .model = said.serial,
                    .value = said.arguments[0] * said.instrument.blow,
                    .value2 = static_cast<double>(*mass)});
}

constexpr CallArgument key{
    .word = "KEY", .meaning = "the key", .least = 0, .most = 127, .is_whole = true};
constexpr CallArgument number{
    .word = "NUMBER", .meaning = "the number", .least = 0, .most = 127, .is_whole = true};
constexpr CallArgument id{
    .word = "ID", .meaning = "the ID", .least = 1, .most = most_note_ids, .is_whole = true};
// The optional ID of a note.
constexpr CallArgument own_id{.word = "ID",
                              .meaning = "the ID",
                              .least = 0,
                              .most = most_note_ids,
                              .otherwise = 0,
                              .is_whole = true};

// --- the table -----------------------------------------------------------------------------------

}  // namespace

std::vector<Row> make_rows() {
  const Row first[] = {
      {.address = "/note/on",
       .arguments = {key, {"VELOCITY", "the velocity", 0, 127, 100}, own_id},
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
       .arguments = {key, {"VELOCITY", "the velocity", 0, 127, 63.5}, own_id},
       .does = "ends a note; the velocity is that of the release",
       .play = events::note_off,
       .command = "noteoff",
       .group = CommandGroup::playing,
       .words = "KEY",
       .details = "KEY is 0 to 127."},
      {.address = "/note/hz",
       .arguments = {id,
                     {"HZ", "the frequency", 1, 20000},
                     {"VELOCITY", "the velocity", 0, 127, 100}},
       .does = "starts a note of this frequency; ID 1-16; velocity as of /note/on",
       .play = events::note_hz},
      {.address = "/note/end",
       .arguments = {id},
       .does = "ends the notes of this ID",
       .play = events::note_end},
      {.address = "/note/bend",
       .arguments = {id, {"SEMITONES", "the bend", -note_bend_semitones, note_bend_semitones}},
       .does = "bends this note alone; semitones, -48 to 48; it stays for the ID's next note",
       .play = events::note_bend},
      {.address = "/note/pressure",
       .arguments = {id, {"VALUE", "the pressure", 0, 127}},
       .does = "presses this note alone, 0-127",
       .play = events::note_pressure},
      {.address = "/note/slide",
       .arguments = {id, {"VALUE", "the slide", 0, 127}},
       .does = "slides this note alone, as MPE does: controller 74, 0-127",
       .play = events::note_slide},
      {.command = "keys",
       .group = CommandGroup::playing,
       .command_does = "plays from the computer's keyboard",
       .details =
           "The letters are laid out as on a piano. A note lasts until the next, or a second.",
       .act = command::keys},
      {.address = "/cc",
       .arguments = {number, {"VALUE", "the value", 0, 127}},
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
      {.address = "/mass/NAME/strike",
       .arguments = {{"STRENGTH", "the strength", -1, 1, 0.8}},
       .does = "strikes a mass, named as in the model; NAME:3 is the third of a string or a mesh, "
               "NAME:0.3 a place there or on a waveguide, BELL:rim one of a body, that something "
               "in the model holds on to; 1 is a hard blow, -1 one from the other side",
       .play = strike,
       .command = "hit",
       .group = CommandGroup::playing,
       .words = "MASS [STRENGTH]",
       .command_does = "strikes a mass or a place by its name",
       .details = "MASS is its name in the model, of a string or a mesh NAME:3, its third, or of a "
                  "place NAME:0.3\nor BELL:rim. STRENGTH is -1 to 1, or 0.8.",
       .act = command::hit},
      {.address = "/panic",
       .does = "silence at once, whatever a button sends along",
       .play = [](const Said& said) { return one(said, {.kind = EventKind::panic}); },
       .ignores_more = true,
       .command = "panic",
       .group = CommandGroup::playing,
       .command_does = "silence at once",
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
      {.address = "/timbre",
       .arguments = {{"SECONDS", "the seconds", 0, Subscribers::longest_lease_s, 10}},
       .does = "sends /timbre.frame 94 times a second, for so long, at most 60 s (10): what the "
               "sound is like; again renews it",
       .answer = answer::timbre,
       .command = "timbre",
       .group = CommandGroup::looking,
       .command_does = "tells what the sound is like: bright or dark, hollow, noisy",
       .details =
           "Of the last frame of 2048 samples, the mean of all outputs. Asked again, it says "
           "what has become\nof it: brighter, hollower, steadier. 'ressort describe' tells "
           "more of a recording.",
       .act = command::timbre},
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
      {.address = "/timbre/target",
       .arguments = {{.word = "FIGURE VALUE ...", .is_text = true}},
       .does = "turns parameters until it sounds so: centroid 1800 t60 3; answers /done with the "
               "figures, or /fail",
       .answer = answer::shape,
       .command = "shape",
       .group = CommandGroup::parameters,
       .words = "FIGURE VALUE ...",
       .command_does = "turns parameters until it sounds so: centroid 1800 t60 3",
       .details =
           "FIGURE is t60 in s, attack in ms, centroid or spread in Hz, inharmonicity or "
           "odd_to_even, and f0\nin Hz where keys do not set the pitch, of a blow at the key "
           "that was played last. Parameters\nmove within their ranges. 'undo' takes it back, "
           "'save NAME' keeps it, 'timbre' tells what sounds.",
       .act = command::shape},
      {.address = "/subscribe",
       .arguments = {{"SECONDS", "the seconds", 0, Subscribers::longest_lease_s, 10}},
       .does =
           "sends every change, whoever makes it, for so long, at most 60 s (10): first all that "
           "is, then /loaded and /param/NAME; again renews it",
       .answer = answer::subscribe},
      {.address = "/unsubscribe", .does = "ends that, and /timbre", .answer = answer::unsubscribe},
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
      {.address = "/flight/save",
       .arguments = {{.word = "NAME", .is_text = true}},
       .does = "saves what was played among the user's flights, never over one that is there; "
               "answers /done or /fail",
       .answer = answer::flight,
       .command = "flight",
       .words = "FILE [--force]",
       .command_does = "keeps what was played, to be played back bit by bit",
       .details = "'ressort play FILE.ressort' and 'ressort render FILE.ressort -o out.wav' play "
                  "the last 30 s of\nit. It has all that was played since ressort was started, and "
                  "the texts of the models; not what\ncame in by audio. --force writes over a file "
                  "that is there.",
       .act = command::flight},
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

std::span<const std::string_view> answers() {
  static constexpr std::string_view all[] = {
      "/error",          "/done",         "/fail",         "/status.reply",
      "/describe.reply", "/describe.end", "/models.reply", "/models.end",
      "/presets.reply",  "/presets.end",  "/loaded",       "/subscribe.reply",
      "/modes.reply",    "/modes.end",    "/timbre.reply", "/timbre.frame"};
  return all;
}

}  // namespace ressort::control
