// app/session: texts, read and written, and where the models and presets are.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/session/new_file.h"
#include "core/result.h"

namespace ressort::session {

// A whole text file of at most `max_bytes`, without the byte order mark that it may begin with. The
// error says what is in the way: missing, a directory, too large, unreadable, UTF-16.
Result<std::string> read_text(const std::string& path, std::size_t max_bytes);

// A whole file of at most `max_bytes`, as it is; errors as of read_text().
Result<std::string> read_bytes(const std::string& path, std::size_t max_bytes);

// All or nothing: what was there stays until the text is whole.
Result<Done> write_text(const std::string& path, const std::string& text, Existing existing);

// The same for a command's --output, complaining on stderr; the command's exit code.
int put_text(const std::string& path, const std::string& text, bool force);

// What names may lead to: whoever sits at the machine names any file, whoever sends a packet what
// is below the program's and the user's own models and presets, wherever links and ".." lead.
enum class Reach { any_file, own_folders };

// The file that a person means by `name`: a path, with or without its ending, or the name, in any
// case, of a preset or a model of the user's or of the program's. Presets go before models, and the
// user's before the program's.
Result<std::string> find_scene(const std::string& name, Reach reach);

// The path without links and "..", where it is that of an ordinary file, a model, a preset or a
// tuning below the program's or the user's own folders.
std::optional<std::string> own_file(const std::string& path);

// All presets and models by name: the program's, sorted, then what the user alone has, sorted.
std::vector<std::string> known_presets();
std::vector<std::string> known_models();

// The file of a preset or model that is known by this very name; empty: there is none.
std::string preset_path(const std::string& name);
std::string model_path(const std::string& name);

// The folder where the program's own models are; the presets are beside it.
std::string models_folder();

// The same of the user's, ressort in $XDG_DATA_HOME or in ~/.local/share, which may not be there
// yet: with models and presets in it. Empty: nobody's home is known.
std::string user_folder();

// Where a flight of this name is to be saved, below the user's folder, which is made; errors as of
// path_to_save().
Result<std::string> path_of_flight(const std::string& name);

// What can be computed again: ressort in $XDG_CACHE_HOME or in ~/.cache, which may not be there
// yet. Empty: nobody's home is known.
std::string cache_folder();

// Where a preset of this name is to be saved, below the user's folder, which is made. The error
// says why that cannot be, as for a name that is none: letters, digits, blanks and ._- but no . at
// its beginning, 1 to 64 of them.
Result<std::string> path_to_save(const std::string& name);

}  // namespace ressort::session
