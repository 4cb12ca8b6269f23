// app: the namespaces that each room sees, like core/rooms.h.
#pragma once

#include "core/rooms.h"

namespace ressort {

// Figures depend on no other room.
namespace plot {}

namespace realtime {
using namespace engine;
}

namespace devices {
using namespace realtime;
}

namespace session {
using namespace compile;
using namespace realtime;
}  // namespace session

namespace control {
using namespace devices;
using namespace session;
}  // namespace control

namespace panel {
using namespace control;
}

namespace commands {
using namespace identification;
using namespace solids;
using namespace panel;
using namespace plot;
}  // namespace commands

namespace command_line {
using namespace commands;
}

}  // namespace ressort
