// app/control: the figures of the running program, one row each. The console's `status`,
// /status.reply and the documents read these rows.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "app/control/osc/reply.h"
#include "app/session/session.h"

namespace ressort::control {

inline constexpr int not_in_reply = -1;

struct StatusRow {
  std::string_view name;
  std::string_view unit;
  std::string_view does;  // Meaning in one line.
  std::variant<double Status::*, int Status::*, std::int64_t Status::*, std::uint64_t Status::*,
               bool Status::*, std::string Status::*>
      figure;
  int place = not_in_reply;  // Position in /status.reply, from 0.
  std::string_view line;     // Line of the console's `status`; empty: shown with another figure.
  // Returns the text of the line, empty at times; null: name, figure and unit.
  std::string (*text)(const Status& status) = nullptr;
};
std::span<const StatusRow> status_rows();

// Builds "/status.reply" with the figures that have a position; doubles are sent as floats, except
// the rate.
Reply status_reply(const Status& status);

// Returns the console's table: each line's name and text.
std::vector<std::vector<std::string>> status_lines(const Status& status);

}  // namespace ressort::control
