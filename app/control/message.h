// app/control: a message as text: an address and its arguments, from OSC, from a line of a score or
// from words of the console. Pure; registry.h defines the effect of a message.
#pragma once

#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "app/rooms.h"
#include "core/result.h"

namespace ressort::control {

using Argument = std::variant<double, std::string>;

struct Message {
  std::string address;  // Such as "/note/on".
  std::vector<Argument> arguments;
  std::string types = {};  // OSC type tags of the arguments; empty for a line of text.
};

// One line of a score: TIME_SECONDS ADDRESS ARG... Blank lines and # comments have no message.
struct ScoreLine {
  int line = 0;    // Counted from 1.
  int column = 1;  // Column of its address.
  double time_s = 0.0;
  Message message;
};
Result<std::vector<ScoreLine>> parse_score(std::string_view text);

// Splits a text at blanks; "..." is one word. Sets `is_open`, if given, to whether the last quote
// is not closed.
std::vector<std::string> split_words(std::string_view text, bool* is_open = nullptr);
inline constexpr const char* open_quote = "this quote is not closed; expected another \" behind it";

// Returns a number if the word is one, else the word.
Argument to_argument(const std::string& word);

// Returns whether an OSC address pattern (* ? [a-z] {x,y}) matches an address.
bool fits(std::string_view pattern, std::string_view address);

}  // namespace ressort::control
