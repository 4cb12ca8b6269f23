// core: whose names each room finds without saying where they are. A room is a namespace; what
// stands beside the rooms is in ressort itself. A room finds the names of those that it may see and
// of no others: tests/rooms.sh holds this against its table. A directive passes on what the room
// that it names finds. Every header of a room includes this, or one that does.
#pragma once

namespace ressort {

namespace laws {}
namespace linear_algebra {}

namespace model {
using namespace laws;
}

namespace analysis {
using namespace linear_algebra;
using namespace model;
}  // namespace analysis

namespace identification {
using namespace linear_algebra;
}

namespace solids {
using namespace linear_algebra;
}

// The one form that sees linear_algebra says so itself: what stands here, the engine has too.
namespace kernels {
using namespace laws;
}

namespace engine {
using namespace kernels;
}

namespace compile {
using namespace analysis;
using namespace engine;
}  // namespace compile

}  // namespace ressort
