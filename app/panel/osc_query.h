// app/panel: the addresses of OSC as a tree in JSON, which OSCQuery programs read to know what can
// be turned (the OSCQuery proposal, github.com/Vidvox/OSCQueryProposal): TYPE, ACCESS, RANGE, VALUE
// and DESCRIPTION of every address, without LISTEN.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "app/session/session.h"

namespace ressort::panel {

// The node at a path, with all that is below it, or one of its attributes, if that is not empty.
struct OscQueryAnswer {
  int status = 200;  // 204: the node has no such attribute; 404: there is no such node
  std::string json;
};
OscQueryAnswer osc_query(const Session& session, std::string_view path, std::string_view attribute);

// Of HOST_INFO; without a port OSC is not heard by UDP.
std::string osc_host_info(std::optional<int> osc_port);

}  // namespace ressort::panel
