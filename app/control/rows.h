// app/control: the rows of the registry, as they are written down. Only registry.cpp asks for them;
// whoever wants to find or read one asks the registry.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "app/control/registry.h"

namespace ressort::control {

std::vector<Row> make_rows();  // in the order of /describe

// The addresses that we send.
std::span<const std::string_view> answers();

}  // namespace ressort::control
