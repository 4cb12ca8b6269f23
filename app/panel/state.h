// app/panel: the data of the page as JSON: the registry's rows and the current scene.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "app/session/session.h"

namespace ressort::panel {

// Returns the data of OSC's /describe and everything else that the page needs: {"name", "serial",
// "addresses": [{"address", "arguments", "does"}], "parameters": [{"name", "value", "minimum",
// "maximum", "lowest", "highest", "audio_input"}], "controls": ["/finger"], "inputs": [...],
// "models": [], "presets": [], "warnings": [], ...}. A missing limit is null. [any thread but
// audio]
std::string describe_json(const Session& session);

// Returns every figure of `status` by its name, and the timbre: "centroid_hz", "spread_hz",
// "flatness". Numbers that are not finite are null.
std::string status_json(const Status& status, const std::optional<SpectralShape>& shape);

// Collects the changes since the last call as server-sent events: `loaded`, `values`, then
// `mapping`, {"waiting": "brightness", "rows": [{"from": "cc20", "to": "brightness", "learned",
// "relative"}]}.
class Changes {
 public:
  std::string since_last(const Session& session);

 private:
  Session::Present told_;
  std::string told_mapping_;
};

// Returns "event: NAME\ndata: ...\n\n"; the data has no line breaks.
std::string server_event(std::string_view name, const std::string& data);
std::string quoted(const std::string& text);  // Quotes as JSON.

}  // namespace ressort::panel
