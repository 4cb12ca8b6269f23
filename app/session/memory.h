// app/session: free memory.
#pragma once

#include <cstdint>

#include "app/rooms.h"

namespace ressort::session {

// Returns the memory in bytes that the machine, `ulimit -v` and the control group leave free. [any
// thread but audio]
std::uint64_t free_memory_bytes();

}  // namespace ressort::session
