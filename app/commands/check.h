// app/commands: says what is in a model or a preset. The exit code comes back.
#pragma once

#include <optional>
#include <string>

#include "app/rooms.h"
#include "core/compile/plan.h"
#include "core/model/network.h"

namespace ressort::commands {

enum class CheckAs { report, json, model };

struct CheckOptions {
  std::string name;
  CheckAs as = CheckAs::report;        // model: the text in one clean dialect
  std::optional<ThirdArgument> third;  // whatever preset and model say
  std::optional<Method> method;        // without one, the plan's choice
  std::optional<Budget> budget;        // instead of the preset's
  bool is_strict = false;              // what only warns is an error
};

// Findings go to stderr, with their lines if that is a terminal; with json all is one object on
// stdout.
int check(const CheckOptions& options);

}  // namespace ressort::commands
