// app: what the console's commands do. [console thread]
#pragma once

#include <memory>
#include <span>
#include <string>

#include "app/control/console.h"

namespace ressort {

// What the commands work on; the console's own.
struct Desk {
  Process& process;
  Session& session;
  Console::Print print;
  Recorder recorder;
  Keyboard keyboard;
  bool has_quit = false;
};

using Words = std::span<const std::string>;

// What sounds; null before anything was loaded.
std::shared_ptr<const Loaded> loaded(const Desk& desk);

// The actions of the commands, named as they are. Each prints its answer or gives its error; the
// words have been counted.
namespace act {
Result<Done> note_on(Desk& desk, Words words);
Result<Done> note_off(Desk& desk, Words words);
Result<Done> panic(Desk& desk, Words words);
Result<Done> pluck(Desk& desk, Words words);
Result<Done> bow(Desk& desk, Words words);
Result<Done> keys(Desk& desk, Words words);
Result<Done> load(Desk& desk, Words words);
Result<Done> models(Desk& desk, Words words);
Result<Done> params(Desk& desk, Words words);
Result<Done> get(Desk& desk, Words words);
Result<Done> set(Desk& desk, Words words);
Result<Done> status(Desk& desk, Words words);
Result<Done> explain(Desk& desk, Words words);
Result<Done> record(Desk& desk, Words words);
Result<Done> quit(Desk& desk, Words words);
}  // namespace act

}  // namespace ressort
