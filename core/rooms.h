// core: the using directives between rooms. A room is a namespace; files outside the rooms use
// ressort itself. A room finds the names of exactly the rooms that it may see, which tests/rooms.sh
// checks. Directives are transitive. Every header of a room includes this file, directly or not.
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

// One form sees linear_algebra and has its own directive; a directive here would reach the engine.
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
