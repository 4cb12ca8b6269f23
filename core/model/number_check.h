// core/model: checks that the numbers of a model are finite.
#pragma once

#include <optional>
#include <span>

#include "core/model/network.h"
#include "core/result.h"

namespace ressort::model {

// Returns an error for the first element with an argument that is not finite with these parameters,
// or with a mass that is not above 0. Ignores arguments that audio inputs set. O(n). [any thread
// but audio]
std::optional<Error> find_invalid_number(const Network& network, std::span<const double> parameters,
                                         double rate_ratio);

}  // namespace ressort::model
