// core/model: what stands at the top of a program in FAUST: how large the network is and what its
// channels are.
#pragma once

#include <span>
#include <string>

#include "core/model/network.h"

namespace ressort::model {

// `masses` are their names in FAUST; the network is expanded.
std::string faust_header(const Network& network, std::span<const std::string> masses,
                         const std::string& name, int inputs);

}  // namespace ressort::model
