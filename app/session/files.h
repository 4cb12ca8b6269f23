// app/session: text files, and the folders of models and presets.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/session/new_file.h"
#include "core/result.h"

namespace ressort::session {

// Reads a text file of at most `max_bytes`, without its byte order mark. The error says why it
// cannot be read: missing, a directory, too large, unreadable, UTF-16.
Result<std::string> read_text(const std::string& path, std::size_t max_bytes);

// Reads a binary file of at most `max_bytes`. Errors like read_text().
Result<std::string> read_bytes(const std::string& path, std::size_t max_bytes);

// Writes a file atomically: the old content stays until the new text is complete.
Result<Done> write_text(const std::string& path, const std::string& text, Existing existing);

// The same for a command's --output. Prints errors to stderr and returns the command's exit code.
int write_output(const std::string& path, const std::string& text, bool force);

// The files that a name may refer to. A person at this machine can name any file. An OSC packet can
// name only models and presets below the program's and the user's folders, after links and ".." are
// resolved.
enum class Reach { any_file, own_folders };

// Returns the file that `name` refers to: a path, with or without its ending, or the name of a
// preset or model in any case. Presets come before models, and the user's before the program's.
Result<std::string> find_scene(const std::string& name, Reach reach);

// Returns the canonical path of a regular model, preset or tuning file below the program's or the
// user's folders.
std::optional<std::string> own_file(const std::string& path);

// Return the names of all presets and models: the program's, sorted, then the ones that only the
// user has, sorted.
std::vector<std::string> known_presets();
std::vector<std::string> known_models();

// Returns the preset that is `step` places after this name in the list of presets, in which the
// first follows the last: any other name lies between the two. Empty if there are no presets.
std::string preset_beside(const std::string& name, int step);

// Return the file of a preset or model with exactly this name, or an empty string.
std::string preset_path(const std::string& name);
std::string model_path(const std::string& name);

// Returns the folder of the program's models. The presets are in a folder beside it.
std::string models_folder();

// Returns the user's folder of models and presets, ressort in $XDG_DATA_HOME or in ~/.local/share.
// It may not exist. Empty if the home folder is unknown.
std::string user_folder();

// Returns the path to save a flight of this name, and creates its folder. Errors like
// path_to_save().
Result<std::string> path_of_flight(const std::string& name);

// Returns the folder for results that can be computed again, ressort in $XDG_CACHE_HOME or in
// ~/.cache. It may not exist. Empty if the home folder is unknown.
std::string cache_folder();

// Returns the file of the user's mapping of controllers, ressort/controllers.toml in
// $XDG_CONFIG_HOME or in ~/.config. It may not exist. Empty if the home folder is unknown.
std::string controllers_path();

// Returns the path to save a preset of this name, and creates its folder. A valid name has 1 to 64
// letters, digits, spaces and ._- and does not begin with a dot.
Result<std::string> path_to_save(const std::string& name);

}  // namespace ressort::session
