// app/panel: what the page is told, as JSON: the registry's rows and what sounds.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/session/session.h"

namespace ressort::panel {

// As /describe of OSC, and what a page needs besides: {"name", "serial", "addresses": [{"address",
// "arguments", "does"}], "parameters": [{"name", "value", "minimum", "maximum", "lowest",
// "highest", "audio_input"}], "controls": ["/finger"], "inputs": [...], "models": [], "presets":
// [], "warnings": [], ...}; a limit that is none is null. [any thread but audio]
std::string describe_json(const Session& session);

// Every figure of `status` by its name, and what the sound is like: "centroid_hz", "spread_hz",
// "flatness"; numbers that are none are null.
std::string status_json(const Status& status, const std::optional<SpectralShape>& shape);

// What has changed since the last call, as server-sent events: `loaded`, `values`, then `news`.
class Changes {
 public:
  std::string since_last(const Session::Present& now);

 private:
  Session::Present told_;
};

// "event: NAME\ndata: ...\n\n"; the data has no line breaks.
std::string server_event(std::string_view name, const std::string& data);
std::string quoted(const std::string& text);  // as JSON

}  // namespace ressort::panel
