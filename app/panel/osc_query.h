// app/panel: the OSC addresses as a JSON tree, from which OSCQuery programs learn what can be
// controlled (the OSCQuery proposal, github.com/Vidvox/OSCQueryProposal): TYPE, ACCESS, RANGE,
// VALUE and DESCRIPTION of every address, without LISTEN.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "app/session/session.h"

namespace ressort::panel {

// Returns the node at a path with everything below it, or one of its attributes if that is not
// empty.
struct OscQueryAnswer {
  int status = 200;  // 204: the node lacks the attribute; 404: no such node.
  std::string json;
};
OscQueryAnswer osc_query(const Session& session, std::string_view path, std::string_view attribute);

// Returns HOST_INFO; without a port OSC does not listen on UDP.
std::string osc_host_info(std::optional<int> osc_port);

}  // namespace ressort::panel
