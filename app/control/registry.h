// app/control: the registry of messages. A row is an address of OSC and scores, a console command,
// or both, with arguments, help and function. OSC, scores, the console with its completion and
// help, /describe, presets and the documents all read these rows.
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

// A playing message whose arguments are complete and within their ranges.
struct PlayCall {
  const Message& message;
  const Instrument& instrument;
  std::uint32_t serial = 0;             // Serial number of the model that the events are for.
  std::string_view name;                // The text in place of NAME in the address: a pattern.
  const InputInfo* input = nullptr;     // The input in place of N.
  Gesture gesture = Gesture::position;  // Its gesture.
  std::array<double, most_arguments> arguments{};

  std::uint16_t whole(std::size_t argument) const;  // The argument, rounded.
};
using Events = Result<std::vector<Event>>;

// An OSC query.
struct Query {
  const Message& message;
  std::string_view name;  // The text in place of NAME in the address.
  Session& session;
  const OscClient& client;
  Subscribers& subscribers;
};

enum class CommandGroup : std::uint8_t { models, playing, parameters, looking, other };

struct Row {
  // Address in OSC and in scores. N stands for an input's number, NAME for the name of a mass or
  // parameter, or a pattern. Empty: console only.
  std::string address = {};
  CallArgument arguments[most_arguments] = {};  // Entries without a word are unused.
  std::string_view does = {};                   // Help text, one line.
  // Returns the events, all at frame 0. Null: plays nothing and is not valid in a score.
  Events (*play)(const PlayCall& call) = nullptr;
  Gesture gesture = Gesture::position;  // Gesture of an address of an input.
  bool ignores_more = false;            // Ignores further arguments, such as a button's value.
  // Replies by OSC. If the row also plays, a message without arguments is a query. [OSC's thread]
  void (*answer)(const Query& query) = nullptr;

  std::string_view command = {};  // Console command; empty: none.
  CommandGroup group = CommandGroup::other;
  // Words of the command: [X] is optional, ... repeats. MODEL, FIGURE, PRESET, PARAMETER, MASS,
  // COMMAND and FILE select the completion. A command that only plays takes the row's arguments and
  // INPUT.
  std::string words = {};
  std::string_view command_does = {};  // Help text of the command, one line; empty: same as `does`.
  std::string_view details = {};       // Further lines of help.
  bool needs_scene = false;            // An error until a scene is loaded.
  // Executes the command: prints its output or returns an error. The number of words has been
  // checked. Null: it plays. [console]
  Result<Done> (*act)(ConsoleContext& console, Words words) = nullptr;

  std::string arguments_text() const;  // Returns for example "KEY [VELOCITY]".
  bool may_omit(const CallArgument& argument) const;
};
const std::vector<Row>& rows();

// Return the rows with an address in the order of /describe, and the rows with a command by group.
std::vector<const Row*> addresses();
std::vector<const Row*> command_rows();
std::string_view heading(CommandGroup group);

// The row of an address, and the text in place of its N or NAME; the row is null if none matches.
struct FoundRow {
  const Row* row = nullptr;
  std::string_view name;
};
FoundRow find_row(std::string_view address);

// Returns the addresses that an OSC pattern means: the built-in ones, and those of the preset's
// controls. A name of a mass or parameter stays a pattern, which its row resolves. Returns the
// address itself if it has no pattern, or if nothing matches.
std::vector<std::string> addresses_meant(const std::string& pattern, const Instrument& instrument);

// Returns whether an address is a built-in address or a reply, so that a preset must not use it for
// a control.
bool is_reserved(std::string_view address);

// Returns whether the program itself sends messages with this address. Another instance may send
// such messages to us if a client has forged our address.
bool is_answer(std::string_view address);

// Returns the events of a playing message, all at frame 0. Parameter values are clamped to their
// ranges. An unknown name or a missing or wrong argument is an error that says what was expected.
// [any thread but audio]
Events to_events(const Message& message, const Instrument& instrument, std::uint32_t serial);

// Returns a message if a parameter's value was limited for stability, such as "m_K: 1.5 is beyond
// the stable range, set to 1.31568"; empty for any other event.
std::string describe_limit(const Message& message, const Event& event,
                           const Instrument& instrument);

}  // namespace ressort::control
