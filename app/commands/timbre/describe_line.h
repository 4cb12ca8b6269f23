// app/commands: the command line of `describe`.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "app/commands/timbre/describe.h"

namespace ressort {

// `run` does it; its exit code becomes `code`.
void add_describe(CLI::App& app, DescribeOptions& options,
                  const std::function<int(const DescribeOptions&)>& run, int& code);

}  // namespace ressort
