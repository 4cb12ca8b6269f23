// app/commands: checks a model or a preset and prints a report.
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
  CheckAs as = CheckAs::report;        // model: the text in the current notation
  std::optional<ThirdArgument> third;  // empty: as the preset or the model says
  std::optional<Method> method;        // empty: the plan's choice
  std::optional<Budget> budget;        // empty: the preset's
  bool is_strict = false;              // treats warnings about the budget as errors
};

// Prints findings to stderr, with their source lines if it is a terminal. JSON is one object on
// stdout instead. Returns the exit code.
int check(const CheckOptions& options);

}  // namespace ressort::commands
