// core/engine: the forms in which a Program may be computed, each the tables of one kernel beside
// the Program's own. Pure data, made by the compile room, shared by all voices.
#pragma once

#include <variant>

namespace ressort {

// As it is written, mass by mass and link by link; one voice in each lane. Every Program.
struct Direct {};

using Form = std::variant<Direct>;

}  // namespace ressort
