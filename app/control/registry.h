// app/control: all that can be said to the program. A row is an address of OSC and of scores, a
// command of the console, or both, with its arguments, its help and what it does. OSC, scores, the
// console, its completion and help, /describe, presets and documents read these rows and act
// through them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "app/control/message.h"
#include "core/compile/compile.h"
#include "core/engine/event.h"
#include "core/result.h"

namespace ressort::session {
class Session;
}

namespace ressort::control {

struct ConsoleContext;
class OscClient;
class Subscribers;

inline constexpr std::size_t most_arguments = 3;

using Words = std::span<const std::string>;

// A playing message whose arguments are there and within their ranges.
struct Said {
  const Message& message;
  const Instrument& instrument;
  std::uint32_t serial = 0;             // of the model that events are for
  std::string_view name;                // what stands for NAME in the address: a pattern
  const InputInfo* input = nullptr;     // what stands for N,
  Gesture gesture = Gesture::position;  // and what plays it
  std::array<double, most_arguments> arguments{};

  std::uint16_t whole(std::size_t argument) const;  // rounded
};
using Events = Result<std::vector<Event>>;

// What OSC asks.
struct Question {
  const Message& message;
  std::string_view name;  // what stands for NAME in the address
  Session& session;
  const OscClient& client;
  Subscribers& subscribers;
};

enum class CommandGroup : std::uint8_t { models, playing, parameters, looking, other };

struct Row {
  // In OSC and in scores; N stands for an input's number, NAME for a mass's name, or a parameter's
  // or a pattern of those. Empty: said at the console only.
  std::string address = {};
  CallArgument arguments[most_arguments] = {};  // those that have a word
  std::string_view does = {};                   // one line
  // Gives its events, all at frame 0. Null: it plays nothing, and a score cannot say it.
  Events (*play)(const Said& said) = nullptr;
  Gesture gesture = Gesture::position;  // of an address of an input
  bool ignores_more = false;            // what comes behind its arguments, as a button's value
  // Answers OSC; where the row plays, too, a message without arguments asks. [OSC's thread]
  void (*answer)(const Question& question) = nullptr;

  std::string_view command = {};  // at the console; empty: it is not said there
  CommandGroup group = CommandGroup::other;
  // [X] may be left out, ... is more of them; MODEL, FIGURE, PRESET, PARAMETER, MASS, COMMAND and
  // FILE say what completes a word. Of a command that only plays, those are the row's arguments,
  // and INPUT.
  std::string words = {};
  std::string_view command_does = {};  // one line; empty: as `does`
  std::string_view details = {};       // more lines
  // Prints its answer or gives its error; the words have been counted. Null: it plays. [console]
  Result<Done> (*act)(ConsoleContext& console, Words words) = nullptr;

  std::string arguments_text() const;  // "KEY [VELOCITY]"
  bool may_omit(const CallArgument& argument) const;
};
const std::vector<Row>& rows();

// The rows with an address, in the order of /describe; those with a command, by their groups.
std::vector<const Row*> addresses();
std::vector<const Row*> command_rows();
std::string_view heading(CommandGroup group);

// The row of an address and what stands for its N or NAME; a null row if there is none.
struct FoundRow {
  const Row* row = nullptr;
  std::string_view name;
};
FoundRow find_row(std::string_view address);

// An address that no preset may use for a control: it is the program's own, or an answer's.
bool is_reserved(std::string_view address);

// Addresses that we send. Others of our kind send these to us when somebody lies about who he is.
bool is_answer(std::string_view address);

// The events of a playing message, all at frame 0. Values of parameters are clamped to their
// ranges; a name that the model does not have, a missing or a wrong argument is an error that says
// what was expected. [any thread but audio]
Events to_events(const Message& message, const Instrument& instrument, std::uint32_t serial);

// That a parameter's value would not have been stable, as "m_K: 1.5 is beyond what is stable, set
// to 1.31568"; nothing for any other event of the message.
std::string describe_limit(const Message& message, const Event& event,
                           const Instrument& instrument);

}  // namespace ressort::control
