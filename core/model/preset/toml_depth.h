// core/model: how deep a TOML text nests, looked at before a parser that recurses takes it apart.
#pragma once

#include <optional>
#include <string_view>

#include "core/result.h"
#include "core/rooms.h"

namespace ressort::model {

inline constexpr int deepest_toml = 8;  // brackets in brackets, or dots in a key

// The place where the text first nests deeper than that, by arrays, inline tables, headers or
// dotted keys; nothing if nowhere. O(n), without recursion. [any thread]
std::optional<Error> too_deep(std::string_view toml);

}  // namespace ressort::model
