// core/model: the user's mapping of controllers, which holds for all presets.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/controller.h"
#include "core/model/preset/preset.h"

namespace ressort::model {

inline constexpr std::size_t most_controllers = 128;

struct ControllerSetting {
  ControllerInput input;
  // "cc0" to "cc119", "next", "previous", "load NAME", "panic", "sustain", or the name of a
  // parameter or control, which a preset may have or not.
  std::string target;
  bool operator==(const ControllerSetting&) const = default;

  // Returns whether a learned row takes the place of another: it has its source or its target.
  bool replaces(const ControllerSetting& other) const;
};

// Returns whether a target is an action of a button: next, previous, load or panic.
bool is_action(std::string_view target);

// Returns the number of a target "cc0" to "cc119", 64 for "sustain", or -1.
int controller_number(std::string_view target);

// Returns the source as the mapping names it, such as "cc20" or "nrpn 1234 on channel 2".
std::string name_of(const ControllerInput& input);

// Returns the mode as the mapping names it, such as "offset".
std::string_view name_of(ControllerMode mode);

// Returns the keys of a mapping, for its reader and its document.
std::span<const PresetKey> controller_keys();

struct ParsedControllers {
  std::vector<ControllerSetting> rows;
  std::vector<Error> errors;  // in the order of the lines
  bool ok() const { return errors.empty(); }
};

// Reads a mapping. Continues after an error, to report all of them. [any thread but audio]
ParsedControllers parse_controllers(std::string_view toml);

// Returns the text of a mapping without the rows that `is_dropped` selects, and with the row
// `added`, if any, in the place of the first of them or at the end. Keeps all comments. Fails if
// the text is no mapping, or has a form that cannot be changed. [any thread but audio]
Result<std::string> edit_controllers(
    std::string_view toml, const std::function<bool(const ControllerSetting&)>& is_dropped,
    const std::optional<ControllerSetting>& added);

}  // namespace ressort::model
