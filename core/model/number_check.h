// core/model: whether the numbers that a model comes to are numbers.
#pragma once

#include <optional>
#include <span>

#include "core/model/network.h"
#include "core/result.h"

namespace ressort::model {

// The first element, in the order of the network, of which an argument is no finite number with
// these values of the parameters, or which weighs nothing; with its line. What an audio input gives
// is not looked at. O(n). [any thread but audio]
std::optional<Error> find_invalid_number(const Network& network, std::span<const double> parameters,
                               double rate_ratio);

}  // namespace ressort::model
