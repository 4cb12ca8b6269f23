// app: what people ask for, whatever the way: an OSC message, a line of a score, a console
// command. Pure: text and numbers in, events out.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/compile/compile.h"
#include "core/engine/event.h"
#include "core/result.h"

namespace ressort {

using Argument = std::variant<double, std::string>;

struct Call {
  std::string address;  // "/note/on"
  std::vector<Argument> arguments;
};

// One row for every address. OSC, scores, /describe and the help read this table.
struct AddressRow {
  std::string_view address;    // N and NAME stand for a number and a name
  std::string_view arguments;  // as a person writes them
  std::string_view does;
  bool plays;  // becomes events; the others are the session's
};
std::span<const AddressRow> addresses();

// Whether the call becomes events: a playing address with the arguments to act. A parameter's
// address without arguments asks.
bool plays(const Call& call, const Instrument& instrument);

// The events of a playing call, all at frame 0. Values are clamped to their ranges; a name that
// the model does not have, a missing or a wrong argument is an error that says what was expected.
Result<std::vector<Event>> to_events(const Call& call, const Instrument& instrument,
                                     std::uint32_t serial);

// What became of a parameter's value that would not have been stable, as "m_K: 1.5 is beyond what
// is stable, set to 1.31568"; nothing for any other event of the call.
std::string told_limit(const Call& call, const Event& event, const Instrument& instrument);

// One line of a score: TIME_SECONDS ADDRESS ARG... ; blank lines and # comments have no call.
struct ScoreLine {
  int line = 0;    // from 1
  int column = 1;  // of its address
  double time_s = 0.0;
  Call call;
};
Result<std::vector<ScoreLine>> parse_score(std::string_view text);

// Words divided by blanks, "..." for a word with blanks in it.
std::vector<std::string> split_words(std::string_view text);

// A number where the word is one, else the word.
Argument to_argument(const std::string& word);

// Whether an OSC address pattern (* ? [a-z] {x,y}) fits an address.
bool fits(std::string_view pattern, std::string_view address);

}  // namespace ressort
