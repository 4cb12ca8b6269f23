// app: version of the program. commit.cmake fills it in at build time.
#pragma once

namespace ressort {

extern const char* const version;  // "1.0.0"
extern const char* const commit;   // ten digits, with '+' for a modified checkout, or "unknown"

}  // namespace ressort
