// app/control: what the console's commands do; the rows of registry.h name them. [console thread]
#pragma once

#include <memory>

#include "app/control/console.h"
#include "app/control/registry.h"
#include "app/session/recorder.h"

namespace ressort::control {

// What the commands work on; the console's own.
struct ConsoleContext {
  Process& process;
  Session& session;
  Console::Print print;
  Recorder recorder;
  Keyboard keyboard = {};
  bool has_quit = false;
  FigureValues timbre = {};  // as it was told last
};

// What sounds; null before anything was loaded.
std::shared_ptr<const Loaded> loaded(const ConsoleContext& console);

extern const Error nothing_loaded;

// Sends a playing message to the audio thread; all of its events act together.
Result<std::vector<Event>> play(ConsoleContext& console, const Message& message);

// The name of the parameter that a person means by a word: as it is, or in another case.
std::string meant_parameter(const Instrument& instrument, const std::string& word);

// Carries out a command; the words have been counted.
Result<Done> act(ConsoleContext& console, const Row& row, Words words);

// What is said of modes at the console and by OSC: how many; MODE NOTE|HZ [T60] [PART].
Result<std::size_t> mode_count(const Argument& argument);
Result<TuneTarget> tune_target(std::span<const Argument> arguments);
// The same of a timbre that is asked for: FIGURE VALUE, as many as there are.
Result<std::vector<TimbreTarget>> timbre_targets(std::span<const Argument> arguments);

namespace command {
Result<Done> keys(ConsoleContext& console, Words words);
Result<Done> load(ConsoleContext& console, Words words);
Result<Done> models(ConsoleContext& console, Words words);
Result<Done> presets(ConsoleContext& console, Words words);
Result<Done> save(ConsoleContext& console, Words words);
Result<Done> learn(ConsoleContext& console, Words words);
Result<Done> unlearn(ConsoleContext& console, Words words);
Result<Done> undo(ConsoleContext& console, Words words);
Result<Done> wait(ConsoleContext& console, Words words);
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
