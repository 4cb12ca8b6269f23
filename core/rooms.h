// core: whose names each room uses as its own: those of the rooms that it may see, and no others'.
// Each room is a namespace; what stands beside the rooms is in ressort itself. tests/rooms.sh holds
// this against its table. Every header finds it: one that includes no other room's includes this.
#pragma once

namespace ressort {

namespace laws {}
namespace linear_algebra {}

namespace model {
using namespace laws;
}

namespace analysis {
using namespace laws;
using namespace linear_algebra;
using namespace model;
}  // namespace analysis

namespace identification {
using namespace linear_algebra;
}

namespace solids {
using namespace linear_algebra;
}

// One form of the modal kernel sees linear_algebra, and says so: else the engine, which may not,
// would find its names here.
namespace kernels {
using namespace laws;
}

namespace engine {
using namespace laws;
using namespace kernels;
}  // namespace engine

namespace compile {
using namespace laws;
using namespace linear_algebra;
using namespace model;
using namespace analysis;
using namespace kernels;
using namespace engine;
}  // namespace compile

}  // namespace ressort
