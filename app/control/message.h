// app/control: a message as people write it: an address and its arguments, in OSC, in a line of a
// score or in words. Pure text; what a message does stands in registry.h.
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
  std::string address;  // "/note/on"
  std::vector<Argument> arguments;
  std::string types = {};  // of the arguments, as OSC has them; empty: of a line of text
};

// One line of a score: TIME_SECONDS ADDRESS ARG... ; blank lines and # comments have no message.
struct ScoreLine {
  int line = 0;    // from 1
  int column = 1;  // of its address
  double time_s = 0.0;
  Message message;
};
Result<std::vector<ScoreLine>> parse_score(std::string_view text);

// Words divided by blanks, "..." for a word with blanks in it; says whether the last one's quote is
// open, if it is asked.
std::vector<std::string> split_words(std::string_view text, bool* is_open = nullptr);
inline constexpr const char* open_quote = "this quote is not closed; expected another \" behind it";

// A number where the word is one, else the word.
Argument to_argument(const std::string& word);

// Whether an OSC address pattern (* ? [a-z] {x,y}) fits an address.
bool fits(std::string_view pattern, std::string_view address);

}  // namespace ressort::control
