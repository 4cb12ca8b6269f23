// app/control: the functions behind the console's commands; the rows of registry.h refer to them.
// [console thread]
#pragma once

#include <memory>

#include "app/control/console.h"
#include "app/control/registry.h"
#include "app/session/recorder.h"

namespace ressort::control {

// The objects that the commands work on.
struct ConsoleContext {
  Process& process;
  Session& session;
  Console::Print print;
  Recorder recorder;
  Keyboard keyboard = {};
  bool has_quit = false;
  FigureValues timbre = {};  // Values of the last `timbre` command.
};

// Returns the current scene; null before the first load.
std::shared_ptr<const Loaded> loaded(const ConsoleContext& console);

// Sends a playing message to the audio thread; all of its events act together.
Result<std::vector<Event>> play(ConsoleContext& console, const Message& message);

// Returns the name of the parameter that a word means: an exact match, or one in another case.
std::string meant_parameter(const Instrument& instrument, const std::string& word);

// Executes a command. The number of words has been checked.
Result<Done> run_command(ConsoleContext& console, const Row& row, Words words);

// Parse the arguments about modes that console and OSC share: a count; MODE NOTE|HZ [T60] [PART].
Result<std::size_t> mode_count(const Argument& argument);
Result<TuneTarget> tune_target(std::span<const Argument> arguments);
// Parses the pairs FIGURE VALUE of a target timbre.
Result<std::vector<TimbreTarget>> timbre_targets(std::span<const Argument> arguments);

// Controls the MIDI file that plays: WORD [NUMBER]..., where WORD is play, pause, tempo or loop.
Result<Done> control_song(Session& session, const std::string& word,
                          std::span<const Argument> numbers);

namespace command {
Result<Done> keys(ConsoleContext& console, Words words);
Result<Done> load(ConsoleContext& console, Words words);
Result<Done> next_preset(ConsoleContext& console, Words words);
Result<Done> previous_preset(ConsoleContext& console, Words words);
Result<Done> models(ConsoleContext& console, Words words);
Result<Done> presets(ConsoleContext& console, Words words);
Result<Done> save(ConsoleContext& console, Words words);
Result<Done> learn(ConsoleContext& console, Words words);
Result<Done> unlearn(ConsoleContext& console, Words words);
Result<Done> undo(ConsoleContext& console, Words words);
Result<Done> song(ConsoleContext& console, Words words);
Result<Done> wait(ConsoleContext& console, Words words);
Result<Done> control(ConsoleContext& console, Words words);
Result<Done> params(ConsoleContext& console, Words words);
Result<Done> get(ConsoleContext& console, Words words);
Result<Done> set(ConsoleContext& console, Words words);
Result<Done> hit(ConsoleContext& console, Words words);
Result<Done> status(ConsoleContext& console, Words words);
Result<Done> explain(ConsoleContext& console, Words words);
Result<Done> modes(ConsoleContext& console, Words words);
Result<Done> tune(ConsoleContext& console, Words words);
Result<Done> timbre(ConsoleContext& console, Words words);
Result<Done> shape(ConsoleContext& console, Words words);
Result<Done> tuning(ConsoleContext& console, Words words);
Result<Done> record(ConsoleContext& console, Words words);
Result<Done> flight(ConsoleContext& console, Words words);
Result<Done> help(ConsoleContext& console, Words words);
Result<Done> quit(ConsoleContext& console, Words words);
}  // namespace command

}  // namespace ressort::control
