// app/control: what is told of the program while it plays. One row a figure: the console's
// `status`, /status.reply and the documents read these rows.
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
  std::string_view does;  // what it says, in a line
  std::variant<double Status::*, int Status::*, std::int64_t Status::*, std::uint64_t Status::*,
               bool Status::*, std::string Status::*>
      figure;
  int place = not_in_reply;  // in /status.reply, from 0
  std::string_view line;     // of the console's `status`; empty: it is told with another figure
  // What the line says of it, nothing at times; null: name, figure and unit.
  std::string (*tell)(const Status& status) = nullptr;
};
std::span<const StatusRow> status_rows();

// "/status.reply" and the figures that have a place in it: of doubles a float, but for the rate.
Reply status_reply(const Status& status);

// The console's table: a line's name and what its figures say.
std::vector<std::vector<std::string>> status_lines(const Status& status);

}  // namespace ressort::control
