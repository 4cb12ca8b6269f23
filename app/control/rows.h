// app/control: the table of the registry. Only registry.cpp uses it; everyone else asks the
// registry.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "app/control/registry.h"

namespace ressort::control {

std::vector<Row> make_rows();  // Returns the rows in the order of /describe.

// The addresses that the program sends.
std::span<const std::string_view> answers();

}  // namespace ressort::control
