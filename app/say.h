// app: prints messages while the program plays, without waiting for the reader.
#pragma once

#include <string>

namespace ressort {

// Print a line to stdout or stderr, in order. If a megabyte is unread, lines are dropped, and their
// number is printed when somebody reads again. [any thread but audio]
void say(const std::string& line);
void complain(const std::string& line);

// Returns the text as `say` prints it to a terminal: wrapped to its width, with the words error and
// warning in colour unless NO_COLOR is set. Elsewhere returns it unchanged.
std::string for_terminal(const std::string& text);

// Waits until everything is printed; returns false after 0.2 s if nobody reads.
bool flush_messages();

// Drops all unprinted lines and prints nothing more: the program ends.
void stop_messages();

}  // namespace ressort
