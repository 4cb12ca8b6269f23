// app/session: how much memory there is to take.
#pragma once

#include <cstdint>

#include "app/rooms.h"

namespace ressort::session {

// What the machine has free, or what `ulimit -v` and the control group leave of it, in bytes.
// [any thread but audio]
std::uint64_t free_memory_bytes();

}  // namespace ressort::session
