// app: whose names each room uses as its own, as core/rooms.h says it of core. Each takes what the
// one before it has: `using namespace` passes on what that namespace uses.
#pragma once

#include "core/rooms.h"

namespace ressort {

namespace realtime {
using namespace kernels;
using namespace engine;
}  // namespace realtime

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
}  // namespace commands

namespace command_line {
using namespace commands;
}

namespace mpi {
using namespace command_line;
}

}  // namespace ressort
