// tests: makes the names of all rooms visible.
#pragma once

#include "app/rooms.h"

namespace ressort {

using namespace command_line;

}  // namespace ressort
