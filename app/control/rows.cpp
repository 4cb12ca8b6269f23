#include "app/control/rows.h"

#include <algorithm>
#include <charconv>
#include <iterator>
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
Events one(const PlayCall& call, Event event) {
  event.channel = call.instrument.channel;
  return std::vector{event};
}

// Sets the parameters that a pattern matches.
Events set_parameters(const PlayCall& call) {
  std::vector<Event> events;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < call.instrument.parameters.size(); ++i) {
    const ParameterInfo& info = call.instrument.parameters[i];
    names.push_back(info.name);
    if (info.audio_input > 0 && call.name == info.name) {
      return Error{call.message.address + ": input " + std::to_string(info.audio_input) +
                   " sets it in every sample, so no message can"};
    }
    if (info.audio_input == 0 && fits(call.name, info.name)) {
      events.push_back({.kind = EventKind::parameter,
                        .index = static_cast<std::uint16_t>(i),
                        .model = call.serial,
                        .value = std::clamp(call.arguments[0], info.minimum, info.maximum)});
    }
  }
  if (events.empty()) {
    return Error{call.message.address + ": the model has no such parameter; it has " +
                 (names.empty() ? "none" : joined(names, ", ")) + did_you_mean(call.name, names)};
  }
  return events;
}

// Moves the named controllers that a pattern matches.
Events turn_knobs(const PlayCall& call) {
  std::vector<Event> events;
  std::vector<std::string> words;
  for (const KnobInfo& knob : call.instrument.knobs) {
    words.push_back(knob.word);
    if (fits(call.name, knob.word) && knob.controller < 0) {
      events.push_back({.kind = EventKind::parameter,
                        .index = static_cast<std::uint16_t>(*knob.parameter),
                        .model = call.serial,
                        .value = knob.range.value_at(call.arguments[0])});
    } else if (fits(call.name, knob.word)) {
      events.push_back({.kind = EventKind::controller,
                        .channel = call.instrument.channel,
                        .index = static_cast<std::uint16_t>(knob.controller),
                        .model = call.serial,
                        .value = call.arguments[0]});
    }
  }
  if (events.empty()) {
    return Error{call.message.address + ": the preset has no such control; it has " +
                 (words.empty() ? "none" : joined(words, ", ")) + did_you_mean(call.name, words)};
  }
  return events;
}

Events play_input(const PlayCall& call, const GestureRow& gesture) {
  const InputInfo& input = *call.input;
  std::string misfit;
  if (gesture.live == Live::by_preset && !input.knows(gesture.gesture)) {
    misfit = "has no " + std::string(gesture.name) + " in this preset";
  } else if (gesture.live != Live::by_preset &&
             input.is_force != (gesture.live == Live::on_forces)) {
    misfit = input.is_force ? "accepts a force, not a position: use /in/N/force"
                            : "accepts a position, not a force: use /in/N/position";
  }
  if (!misfit.empty()) {
    return Error{call.message.address + ": input " + std::to_string(input.number) + " " + misfit};
  }
  return one(call, {.kind = EventKind::gesture,
                    .gesture = gesture.gesture,
                    .index = static_cast<std::uint16_t>(input.number),
                    .model = call.serial,
                    .value = call.arguments[0],
                    .value2 = call.arguments[1]});
}

// Finds the mass NAME, the third mass of a macro as "NAME:3", or the place "NAME:0.3". Otherwise
// returns the reason why it does not exist.
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
                                  : Error{std::string(name) + " is fixed, or no output hears it"};
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

Events strike(const PlayCall& call) {
  const auto mass = find_mass(call.instrument.struck, call.name);
  if (!mass) {
    return Error{call.message.address + ": " + mass.error().message};
  }
  return one(call, {.kind = EventKind::strike,
                    .model = call.serial,
                    .value = call.arguments[0] * call.instrument.blow,
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
// The optional port of a receiver; without it, the sender's.
constexpr CallArgument port{.word = "PORT",
                            .meaning = "the port",
                            .least = 1,
                            .most = 65535,
                            .otherwise = 0,
                            .is_whole = true};

// --- the table -----------------------------------------------------------------------------------

}  // namespace

std::vector<Row> make_rows() {
  const Row first[] = {
      {.address = "/note/on",
       .arguments = {key, {"VELOCITY", "the velocity", 0, 127, 100}, own_id},
       .does =
           "starts a note; key 0-127, velocity 1-127 (100), or a float up to 1 as a share of full "
           "velocity; an ID of 1-16 gives the note its own bend, pressure and slide",
       .play = events::note_on,
       .command = "noteon",
       .group = CommandGroup::playing,
       .words = "KEY [VELOCITY]",
       .command_does = "starts a note; 60 is middle C",
       .details = "KEY is 0 to 127. VELOCITY is 1 to 127, or 100 if omitted."},
      {.address = "/note/off",
       .arguments = {key, {"VELOCITY", "the velocity", 0, 127, 63.5}, own_id},
       .does = "ends a note; VELOCITY is the release velocity",
       .play = events::note_off,
       .command = "noteoff",
       .group = CommandGroup::playing,
       .words = "KEY",
       .details = "KEY is 0 to 127."},
      {.address = "/note/hz",
       .arguments = {id,
                     {"HZ", "the frequency", 1, 20000},
                     {"VELOCITY", "the velocity", 0, 127, 100}},
       .does = "starts a note at this frequency; ID 1-16; velocity as for /note/on",
       .play = events::note_hz},
      {.address = "/note/end",
       .arguments = {id},
       .does = "ends the notes with this ID",
       .play = events::note_end},
      {.address = "/note/bend",
       .arguments = {id, {"SEMITONES", "the bend", -note_bend_semitones, note_bend_semitones}},
       .does = "bends this note only, -48 to 48 semitones; the bend stays for the ID's next note",
       .play = events::note_bend},
      {.address = "/note/pressure",
       .arguments = {id, {"VALUE", "the pressure", 0, 127}},
       .does = "sets the pressure of this note only, 0-127",
       .play = events::note_pressure},
      {.address = "/note/slide",
       .arguments = {id, {"VALUE", "the slide", 0, 127}},
       .does = "sets the slide of this note only, 0-127 (controller 74, as in MPE)",
       .play = events::note_slide},
      {.command = "keys",
       .group = CommandGroup::playing,
       .command_does = "plays from the computer's keyboard",
       .details = "The letters are laid out like a piano. A note lasts until the next one, at most "
                  "a second.",
       .act = command::keys},
      {.address = "/cc",
       .arguments = {number, {"VALUE", "the value", 0, 127}},
       .does = "sends a MIDI controller; value 0-127",
       .play =
           [](const PlayCall& call) {
             return one(call, {.kind = EventKind::controller,
                               .index = call.whole(0),
                               .value = call.arguments[1] / 127.0});
           }},
      {.address = "/pressure",
       .arguments = {{"VALUE", "the pressure", 0, 127}},
       .does = "sets the channel pressure, 0-127",
       .play =
           [](const PlayCall& call) {
             return one(call, {.kind = EventKind::pressure, .value = call.arguments[0] / 127.0});
           }},
      {.address = "/bend",
       .arguments = {{"VALUE", "the bend", -1, 1}},
       .does = "bends the pitch, -1 to 1 (two semitones)",
       .play =
           [](const PlayCall& call) {
             return one(call, {.kind = EventKind::bend, .value = call.arguments[0]});
           }},
      {.command = "params",
       .group = CommandGroup::parameters,
       .command_does = "lists the parameters, their values and ranges",
       .needs_scene = true,
       .act = command::params},
      {.command = "get",
       .group = CommandGroup::parameters,
       .words = "PARAMETER",
       .command_does = "prints a parameter's value",
       .details = "PARAMETER may be a pattern: 'get m_*' prints all that begin with m_.",
       .needs_scene = true,
       .act = command::get},
      {.address = "/param/NAME",
       .arguments = {{"VALUE", "the value"}},
       .does = "sets a parameter; without VALUE, replies with its value",
       .play = set_parameters,
       .answer = answer::parameters,
       .command = "set",
       .group = CommandGroup::parameters,
       .words = "PARAMETER VALUE",
       .command_does = "sets a parameter, limited to its range",
       .details = "PARAMETER may be a pattern: 'set *_Z 0.001' sets all that end with _Z.",
       .needs_scene = true,
       .act = command::set},
      {.address = "/control/NAME",
       .arguments = {{"VALUE", "the value", 0, 1}},
       .does = "moves a named control, 0-1; without VALUE, replies with its position",
       .play = turn_knobs,
       .answer = answer::knobs,
       .command = "control",
       .group = CommandGroup::playing,
       .words = "[CONTROL] [VALUE]",
       .command_does = "moves a named control, 0 to 1; alone, lists the controls",
       .details = "Every preset has its own, such as brightness and ring. 'control ring 0.8' is "
                  "the same as moving\nthe MIDI controller of that name.",
       .needs_scene = true,
       .act = command::control},
      {.address = "/learn",
       .arguments = {{.word = "TARGET", .is_text = true}},
       .does = "assigns the next knob that you turn to a control or a parameter; replies /done or "
               "/fail",
       .answer = answer::learn,
       .command = "learn",
       .group = CommandGroup::parameters,
       .words = "CONTROL|PARAMETER",
       .command_does = "assigns the next knob that you turn to a control or a parameter",
       .details =
           "Turn it to the right and back, so that encoders are recognised. It may also be an OSC "
           "address of\nthe preset, such as /finger. The knob loses its other function until "
           "'unlearn', in every preset\nthat has this target. The mapping of controllers keeps the "
           "assignment for the next start.",
       .needs_scene = true,
       .act = command::learn},
      {.address = "/unlearn",
       .arguments = {{.word = "TARGET", .is_text = true}},
       .does = "ends the assignment of the target's knobs; replies /done or /fail",
       .answer = answer::unlearn,
       .command = "unlearn",
       .group = CommandGroup::parameters,
       .words = "[CONTROL|PARAMETER]",
       .command_does = "ends the assignment of a knob, or of all knobs learned since the start",
       .needs_scene = true,
       .act = command::unlearn},
      {.command = "undo",
       .group = CommandGroup::parameters,
       .command_does = "undoes the last change of a parameter, or the last load",
       .details =
           "Changes by knob, OSC and console count alike. Changes within a second are one. A "
           "second 'undo'\nreverts the first.",
       .act = command::undo},
      {.address = "/param/NAME/range",
       .does = "replies with its minimum, maximum and stable range",
       .answer = answer::ranges},
  };
  std::vector<Row> rows(std::begin(first), std::end(first));
  for (const GestureRow& gesture : gestures) {
    if (gesture.live == Live::never) {
      continue;
    }
    Row row{.address = "/in/N/" + std::string(gesture.name),
            .does = gesture.live_does,
            .play = [](const PlayCall& call) { return play_input(call, row_of(call.gesture)); },
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
       .does = "strikes a mass by its name in the model; NAME:3 is the third mass of a string or "
               "mesh, NAME:0.3 a place on it or on a waveguide, BELL:rim a place of a body (a "
               "place needs a link in the model); 1 is a hard strike, -1 one from the other side",
       .play = strike,
       .command = "hit",
       .group = CommandGroup::playing,
       .words = "MASS [STRENGTH]",
       .command_does = "strikes a mass or a place by name",
       .details =
           "MASS is a name in the model, NAME:3 for the third mass of a string or mesh, or a "
           "place NAME:0.3\nor BELL:rim. STRENGTH is -1 to 1, or 0.8 if omitted.",
       .act = command::hit},
      {.address = "/panic",
       .does = "silences everything immediately; ignores a button's value",
       .play = [](const PlayCall& call) { return one(call, {.kind = EventKind::panic}); },
       .ignores_more = true,
       .command = "panic",
       .group = CommandGroup::playing,
       .command_does = "silences everything immediately",
       .details = "Every voice fades out."},
      {.address = "/model/load",
       .arguments = {{.word = "NAME", .is_text = true},
                     {.word = "ID", .otherwise = 0, .is_text = true}},
       .does = "loads a model or preset; replies /done or /fail",
       .answer = answer::load,
       .command = "load",
       .group = CommandGroup::models,
       .words = "MODEL [--force]",
       .command_does = "loads a model or a preset",
       .details =
           "MODEL is the name of an installed preset or model, or the path of a .mdl or .toml "
           "file. The\ncurrent sound continues until the new model is ready and then fades into "
           "it; after an error in\nthe file it continues unchanged. An unstable model is an "
           "error; --force plays it anyway and fades\nout voices that diverge.",
       .act = command::load},
      {.address = "/preset/load",
       .arguments = {{.word = "NAME", .is_text = true},
                     {.word = "ID", .otherwise = 0, .is_text = true}},
       .does = "loads a preset; replies /done or /fail",
       .answer = answer::load,
       .command = "preset",
       .group = CommandGroup::models,
       .words = "PRESET [--force]",
       .command_does = "loads a preset; Tab completes presets only",
       .details = "A preset is a model with parameter ranges and controls.",
       .act = command::load},
      {.address = "/preset/next",
       .does =
           "loads the next preset of the list; ignores a button's value; replies /done or /fail",
       .answer = answer::next_preset,
       .command = "next",
       .group = CommandGroup::models,
       .command_does = "loads the next preset of the list",
       .act = command::next_preset},
      {.address = "/preset/previous",
       .does = "loads the previous preset of the list; ignores a button's value; replies /done or "
               "/fail",
       .answer = answer::previous_preset,
       .command = "previous",
       .group = CommandGroup::models,
       .command_does = "loads the previous preset of the list",
       .act = command::previous_preset},
      {.address = "/preset/save",
       .arguments = {{.word = "NAME", .is_text = true}},
       .does = "saves the current sound as a user preset; never overwrites; replies /done or /fail",
       .answer = answer::save,
       .command = "save",
       .group = CommandGroup::models,
       .words = "NAME [--force]",
       .command_does = "saves the current sound as your own preset",
       .details =
           "Writes parameter values to NAME.toml in your preset folder, "
           "\n$XDG_DATA_HOME/ressort/presets or ~/.local/share/ressort/presets. 'load NAME' loads "
           "it. --force\noverwrites an existing preset.",
       .needs_scene = true,
       .act = command::save},
      {.command = "presets",
       .group = CommandGroup::models,
       .command_does = "lists all presets, yours included, with their descriptions",
       .act = command::presets},
      {.command = "models",
       .group = CommandGroup::models,
       .command_does = "lists all presets and models, yours included",
       .details = "Lists presets with their descriptions, then the models they are made of.",
       .act = command::models},
      {.address = "/status",
       .does = "replies with voices, CPU load, xruns, resets, rate and more",
       .answer = answer::status,
       .command = "status",
       .group = CommandGroup::looking,
       .command_does = "shows the current sound, its level and its cost",
       .details = "The peak and the limiter's largest reduction count from the previous 'status'.",
       .act = command::status},
      {.command = "explain",
       .group = CommandGroup::looking,
       .command_does = "shows how the model is computed and which controls it has",
       .needs_scene = true,
       .act = command::explain},
      {.address = "/modes",
       .arguments = {{"COUNT", "how many modes", 1, 10000, 32}},
       .does = "replies with number, frequency, T60 and levels of each of the lowest modes, then "
               "their count",
       .answer = answer::modes,
       .command = "modes",
       .group = CommandGroup::looking,
       .words = "[COUNT]",
       .command_does = "lists the lowest modes: frequency, note, T60 and level",
       .details = "Levels are in dB below the loudest mode. The modes are those of the current "
                  "parameters at the pitch\nwritten in the model.",
       .needs_scene = true,
       .act = command::modes},
      {.address = "/timbre",
       .arguments = {{"SECONDS", "the seconds", 0, Subscribers::longest_lease_s, 10}, port},
       .does =
           "sends descriptors of the sound as /timbre.frame, 94 times a second, for SECONDS, at "
           "most 60 (10), to PORT (the sender's); repeat it to renew",
       .answer = answer::timbre,
       .command = "timbre",
       .group = CommandGroup::looking,
       .command_does = "describes the sound: bright or dark, hollow, noisy",
       .details =
           "Analyses the last frame of 2048 samples, the mean of all outputs. Repeated, it also "
           "prints what\nhas changed: brighter, hollower, steadier. 'ressort describe' analyses "
           "recordings.",
       .needs_scene = true,
       .act = command::timbre},
      {.address = "/tune",
       .arguments = {{"MODE", "the mode", 1, 10000},
                     {.word = "NOTE|HZ [T60] [PART]", .is_text = true}},
       .does = "tunes a mode to a pitch and a decay; replies /done or /fail",
       .answer = answer::tune,
       .command = "tune",
       .group = CommandGroup::parameters,
       .words = "MODE NOTE|HZ [T60] [PART]",
       .command_does = "tunes a mode to a pitch and a decay",
       .details =
           "Scales the stiffness, and with a T60 in seconds the damping, of the whole model, or "
           "of the part\nconnected to the mass, string, mesh or link PART. 'modes' lists "
           "the modes, 'undo' reverts the\nchange, 'save NAME' saves it.",
       .needs_scene = true,
       .act = command::tune},
      {.address = "/timbre/target",
       .arguments = {{.word = "FIGURE VALUE ...", .is_text = true}},
       .does = "adjusts parameters to reach a timbre, such as centroid 1800 t60 3; replies /done "
               "with the figures reached, or /fail",
       .answer = answer::shape,
       .command = "shape",
       .group = CommandGroup::parameters,
       .words = "FIGURE VALUE ...",
       .command_does = "adjusts parameters to reach a timbre: centroid 1800 t60 3",
       .details =
           "FIGURE is t60 in s, attack in ms, centroid or spread in Hz, inharmonicity, "
           "odd_to_even, or f0\nin Hz if keys do not set the pitch, for a strike at the last "
           "key played. Parameters stay within\ntheir ranges. 'undo' reverts the change, 'save "
           "NAME' saves it, 'timbre' describes the sound.",
       .needs_scene = true,
       .act = command::shape},
      {.address = "/subscribe",
       .arguments = {{"SECONDS", "the seconds", 0, Subscribers::longest_lease_s, 10}, port},
       .does = "sends the current state, then every change as /loaded, /param/NAME and "
               "/control/NAME, for SECONDS, at most 60 (10), to PORT (the sender's); repeat it to "
               "renew",
       .answer = answer::subscribe},
      {.address = "/unsubscribe",
       .arguments = {port},
       .does = "ends the subscriptions of /subscribe and /timbre",
       .answer = answer::unsubscribe},
      {.address = "/models",
       .does = "replies with the name of each model, then their count",
       .answer = answer::models},
      {.address = "/presets",
       .does = "replies with the name and description of each preset, then their count",
       .answer = answer::presets},
      {.address = "/describe",
       .does = "replies with a row for everything that can be set or queried",
       .answer = answer::describe},
      {.command = "tuning",
       .group = CommandGroup::playing,
       .words = "TUNING|off [TUNING]",
       .command_does = "tunes all keys by Scala files; 'off' restores the preset's tuning",
       .details =
           "TUNING is a scale, NAME.scl, a keyboard map, NAME.kbm, or both. Sounding notes change "
           "at once;\nmodels loaded later keep the tuning.",
       .needs_scene = true,
       .act = command::tuning},
      {.command = "rec",
       .words = "FILE|stop [--force]",
       .command_does = "records the output to a file; 'rec stop' ends it",
       .details =
           "The extension selects the format: .wav, .w64, .flac, .ogg, .aiff, .au or .caf, with 24 "
           "bits per\nsample at the current rate. --force overwrites an existing file.",
       .act = command::record},
      {.address = "/song/play",
       .arguments = {{"SECONDS", "the second", 0, 86400, 0}},
       .does = "plays the MIDI file, from this second of it or from where it is",
       .answer = answer::song,
       .command = "song",
       .group = CommandGroup::playing,
       .words = "play|pause|tempo|loop [NUMBER] [NUMBER]",
       .command_does = "plays, pauses or repeats the MIDI file of --midi",
       .details =
           "song play [SECONDS] continues, or plays from this second; song tempo PERCENT, 10 "
           "to 1000,\nor clock, a MIDI clock's; song loop FROM TO repeats these seconds, song loop "
           "ends that.",
       .act = command::song},
      {.address = "/song/pause", .does = "pauses the MIDI file", .answer = answer::song},
      {.address = "/song/tempo",
       .arguments = {{"PERCENT", "the tempo", 10, 1000}},
       .does =
           "sets the tempo of the MIDI file in percent of its own, or to that of a MIDI 'clock'",
       .answer = answer::song},
      {.address = "/song/loop",
       .arguments = {{"FROM", "the first second", 0, 86400, 0}, {"TO", "the last", 0, 86400, 0}},
       .does = "repeats these seconds of the MIDI file; without numbers, no longer",
       .answer = answer::song},
      {.address = "/flight/save",
       .arguments = {{.word = "NAME", .is_text = true}},
       .does =
           "saves the performance in the user's folder; never overwrites; replies /done or /fail",
       .answer = answer::flight,
       .command = "flight",
       .words = "FILE [--force]",
       .command_does = "saves the performance, for bit-exact playback",
       .details =
           "'ressort play FILE.ressort' and 'ressort render FILE.ressort -o out.wav' play its "
           "last 30 s.\nThe file holds everything played since ressort was started and the "
           "texts of the models, but no\naudio input. --force overwrites an existing file.",
       .act = command::flight},
      {.command = "wait",
       .words = "SECONDS",
       .command_does = "pauses a script: noteon 60, wait 0.5, noteoff 60",
       .act = command::wait},
      {.command = "help",
       .words = "[COMMAND]",
       .command_does = "explains a command",
       .act = command::help},
      {.command = "quit", .command_does = "ends the program", .act = command::quit},
  };
  rows.insert(rows.end(), std::begin(last), std::end(last));
  for (Row& row : rows) {
    if (row.words.empty() && row.act == nullptr) {
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
