// app/control: what the console's commands do; the rows of registry.h name them. [console thread]
#pragma once

#include <memory>

#include "app/control/console.h"
#include "app/control/registry.h"
#include "app/session/recorder.h"

namespace ressort {

// What the commands work on; the console's own.
struct ConsoleContext {
  Process& process;
  Session& session;
  Console::Print print;
  Recorder recorder;
  Keyboard keyboard = {};
  bool has_quit = false;
};

// What sounds; null before anything was loaded.
std::shared_ptr<const Loaded> loaded(const ConsoleContext& console);

// Carries out a command; the words have been counted.
Result<Done> act(ConsoleContext& console, const Row& row, Words words);

namespace command {
Result<Done> keys(ConsoleContext& console, Words words);
Result<Done> load(ConsoleContext& console, Words words);
Result<Done> models(ConsoleContext& console, Words words);
Result<Done> params(ConsoleContext& console, Words words);
Result<Done> get(ConsoleContext& console, Words words);
Result<Done> set(ConsoleContext& console, Words words);
Result<Done> status(ConsoleContext& console, Words words);
Result<Done> explain(ConsoleContext& console, Words words);
Result<Done> tuning(ConsoleContext& console, Words words);
Result<Done> record(ConsoleContext& console, Words words);
Result<Done> help(ConsoleContext& console, Words words);
Result<Done> quit(ConsoleContext& console, Words words);
}  // namespace command

}  // namespace ressort
