// app: which ressort this is. Filled in by commit.cmake when the program is built.
#pragma once

namespace ressort {

extern const char* const version;  // "0.1.0"
extern const char* const commit;   // ten digits, with a '+' where files had been changed since;
                                   //   "unknown" outside a checkout

}  // namespace ressort
