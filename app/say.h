// app: what the program says while it plays. Nobody waits for who reads it.
#pragma once

#include <string>

namespace ressort {

// A line to stdout, to stderr. Lines keep their order. Where nobody has read the last megabyte, a
// line is left out, and how many were is said when somebody reads again. [any thread but audio]
void say(const std::string& line);
void complain(const std::string& line);

// The text as `say` puts it on a terminal: lines broken at its width, and the words error and
// warning in colour unless NO_COLOR is set; elsewhere as it is.
std::string for_terminal(const std::string& text);

// Until all of it is out: true; or false, a fifth of a second later, if nobody reads it.
bool wait_until_said();

// At the end, when nobody reads: what is not out never will be, and nothing more is said.
void fall_silent();

}  // namespace ressort
