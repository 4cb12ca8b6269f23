// tests: what is tested is found by its name alone, whichever room it is of.
#pragma once

#include "app/rooms.h"

namespace ressort {

using namespace command_line;

}  // namespace ressort
