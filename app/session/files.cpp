#include "app/session/files.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <system_error>

#include "app/exit_code.h"
#include "app/text.h"
#include "core/ranges.h"

namespace ressort::session {
namespace {

namespace fs = std::filesystem;

// Returns RESSORT_DATA, the installed folder or the source tree, whichever exists first.
fs::path data_folder() {
  std::vector<fs::path> tried;
  if (const char* given = std::getenv("RESSORT_DATA")) {
    tried.emplace_back(given);
  }
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  tried.push_back(program.parent_path().parent_path() / "share" / "ressort");
  tried.emplace_back(RESSORT_SOURCE);
  for (const fs::path& path : tried) {
    if (fs::is_directory(path / "models", error)) {
      return path;
    }
  }
  return fs::current_path(error);
}

// Returns the folders that are searched for models and presets, in order.
std::vector<fs::path> known_folders() {
  std::vector<fs::path> folders = {data_folder()};
  if (const std::string user = user_folder(); !user.empty()) {
    folders.insert(folders.begin(), user);
  }
  return folders;
}

bool is_below(const fs::path& path, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first ==
         folder.end();
}

// The program's names come first, so that program change numbers do not depend on the user's files.
std::vector<std::string> names_in(const char* kind, const char* ending) {
  std::vector<std::string> all;
  std::vector<fs::path> folders = known_folders();
  std::ranges::reverse(folders);
  for (const fs::path& folder : folders) {
    std::set<std::string> names;
    std::error_code error;
    fs::directory_iterator entry(folder / kind, error);
    for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
      const std::string name = entry->path().stem().string();
      if (entry->path().extension() == ending && std::ranges::find(all, name) == all.end()) {
        names.insert(name);
      }
    }
    all.insert(all.end(), names.begin(), names.end());
  }
  return all;
}

std::string known_path(const char* kind, const std::string& file) {
  std::error_code error;
  for (const fs::path& folder : known_folders()) {
    if (const fs::path path = folder / kind / file; fs::is_regular_file(path, error)) {
      return path.string();
    }
  }
  return "";
}

std::string in_any_case(const std::string& name, const std::vector<std::string>& known) {
  const auto found = std::ranges::find_if(
      known, [&](const std::string& candidate) { return same_but_case(candidate, name); });
  return found == known.end() ? "" : *found;
}

// Finds a preset or a model by its name, with or without ending, ignoring case.
std::string known_scene(const std::string& name) {
  for (const auto& [kind, ending] :
       {std::pair("presets", std::string(".toml")), std::pair("models", std::string(".mdl"))}) {
    for (const std::string& file : {name + ending, name}) {
      if (std::string path = known_path(kind, file); !path.empty()) {
        return path;
      }
    }
  }
  for (const bool is_preset : {true, false}) {
    const std::string meant = in_any_case(name, is_preset ? known_presets() : known_models());
    if (!meant.empty()) {
      return is_preset ? preset_path(meant) : model_path(meant);
    }
  }
  return "";
}

// Returns an error if a name leads to something that is no file: a folder, a pipe, or a link to
// itself or to nothing.
std::optional<Error> odd_file(const std::string& name) {
  std::vector<fs::path> paths = {fs::path(name), fs::path(name + ".toml"), fs::path(name + ".mdl")};
  for (const fs::path& folder : known_folders()) {
    for (const char* const ending : {"", ".toml"}) {
      paths.push_back(folder / "presets" / (name + ending));
    }
    for (const char* const ending : {"", ".mdl"}) {
      paths.push_back(folder / "models" / (name + ending));
    }
  }
  for (const fs::path& path : paths) {
    std::error_code error;
    const bool is_link = fs::is_symlink(fs::symlink_status(path, error));
    const fs::file_status status = fs::status(path, error);
    if (fs::is_regular_file(status) || (!fs::exists(status) && !is_link)) {
      continue;
    }
    return Error{"'" + path.string() + "' is " +
                 (error == std::errc::too_many_symbolic_link_levels ? "a loop of links"
                  : !fs::exists(status)                             ? "a link to nothing"
                  : fs::is_directory(status)                        ? "a folder"
                  : fs::is_fifo(status)                             ? "a pipe"
                                                                    : "not a regular file") +
                 "; expected a .mdl model or a .toml preset"};
  }
  return std::nullopt;
}

std::string meant_by(const std::string& name) {
  std::vector<std::string> known = known_presets();
  const std::vector<std::string> models = known_models();
  known.insert(known.end(), models.begin(), models.end());
  return did_you_mean(name, known);
}

// Removes the byte order mark.
Result<std::string> unmarked(const std::string& path, std::string text) {
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff")) {
    return Error{"'" + path + "' is text in UTF-16; save it as UTF-8"};
  }
  if (text.starts_with("\xef\xbb\xbf")) {
    text.erase(0, 3);
  }
  return text;
}

// Rounds up, so that a file that is one byte too large does not seem to fit.
std::string in_bytes(std::uintmax_t size) {
  const auto whole = [&](int bits) {
    return std::to_string((size + (std::uintmax_t{1} << bits) - 1) >> bits);
  };
  return size >> 20 == 0 ? whole(10) + " KiB" : whole(20) + " MiB";
}

}  // namespace

Result<std::string> read_bytes(const std::string& path, std::size_t max_bytes) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) {
    return Error{"there is no file '" + path + "'"};
  }
  if (fs::is_directory(status)) {
    return Error{"'" + path + "' is a folder, not a file"};
  }
  if (!fs::is_regular_file(status)) {
    return Error{"'" + path + "' is not a regular file"};
  }
  const auto size = fs::file_size(path, error);
  if (!error && size > max_bytes) {
    return Error{"'" + path + "' has " + in_bytes(size) + "; the limit is " + in_bytes(max_bytes)};
  }
  std::ifstream file(path, std::ios::binary);
  std::string text(static_cast<std::size_t>(size), '\0');
  if (!file || !file.read(text.data(), static_cast<std::streamsize>(text.size()))) {
    return Error{"'" + path + "' cannot be read: " + std::generic_category().message(errno)};
  }
  return text;
}

Result<std::string> read_text(const std::string& path, std::size_t max_bytes) {
  auto text = read_bytes(path, max_bytes);
  return text ? unmarked(path, *std::move(text)) : std::move(text);
}

Result<Done> write_text(const std::string& path, const std::string& text, Existing existing) {
  auto file = NewFile::open(path, existing);
  if (!file) {
    return file.error();
  }
  const auto written = file->write(text);
  // Flush before the rename, so that the file is complete even after a power failure.
  static_cast<void>(fsync(file->descriptor()));
  return written ? file->keep() : written;
}

int write_output(const std::string& path, const std::string& text, bool force) {
  const auto complain = [](const Error& error, int code) {
    std::fprintf(stderr, "%s\n", error.message.c_str());
    return code;
  };
  auto file = NewFile::open(path, force ? Existing::replace : Existing::refuse);
  if (!file) {
    return complain(file.error(), exit_code::wrong_use);
  }
  auto written = file->write(text);
  written = written ? file->keep() : written;
  return written ? exit_code::done : complain(written.error(), exit_code::our_failure);
}

Result<std::string> find_scene(const std::string& name, Reach reach) {
  if (name.empty()) {
    return Error{"expected the name of a model or a preset"};
  }
  std::error_code error;
  const std::string presets = joined(known_presets(), ", ");
  if (reach == Reach::own_folders) {
    const std::string path = fs::path(name).is_relative() ? known_scene(name) : "";
    if (const auto found = own_file(path)) {
      return *found;
    }
    return Error{"there is no model or preset '" + name +
                 "' in the program's folders, and OSC cannot load others; there are " +
                 (presets.empty() ? "none" : presets) + meant_by(name)};
  }
  for (const fs::path& path : {fs::path(name), fs::path(name + ".toml"), fs::path(name + ".mdl")}) {
    if (fs::is_regular_file(path, error)) {
      return path.string();
    }
  }
  if (std::string path = known_scene(name); !path.empty()) {
    return path;
  }
  if (const auto odd = odd_file(name)) {
    return *odd;
  }
  return Error{"there is no model or preset '" + name + "'; there are " +
               (presets.empty() ? "none in '" + data_folder().string() + "'" : presets) +
               ", or give the path of a .mdl or .toml file" + meant_by(name)};
}

std::optional<std::string> own_file(const std::string& path) {
  std::error_code error;
  const fs::path found = fs::canonical(path, error);
  const fs::path endings[] = {".mdl", ".toml", ".scl", ".ascl", ".kbm"};
  if (error || !fs::is_regular_file(found, error) ||
      std::ranges::find(endings, found.extension()) == std::end(endings)) {
    return std::nullopt;
  }
  for (const fs::path& known : known_folders()) {
    for (const char* const name : {"models", "presets"}) {
      const fs::path folder = fs::canonical(known / name, error);
      if (!error && is_below(found, folder)) {
        return found.string();
      }
    }
  }
  return std::nullopt;
}

std::vector<std::string> known_presets() {
  return names_in("presets", ".toml");
}
std::vector<std::string> known_models() {
  return names_in("models", ".mdl");
}

std::string preset_beside(const std::string& name, int step) {
  const std::vector<std::string> presets = known_presets();
  if (presets.empty()) {
    return "";
  }
  const auto found = std::ranges::find(presets, in_any_case(name, presets));
  const int count = static_cast<int>(presets.size());
  const int at =
      found != presets.end() ? static_cast<int>(found - presets.begin()) : (step > 0 ? -1 : count);
  return presets[static_cast<std::size_t>(((at + step) % count + count) % count)];
}
std::string preset_path(const std::string& name) {
  return known_path("presets", name + ".toml");
}
std::string model_path(const std::string& name) {
  return known_path("models", name + ".mdl");
}
std::string models_folder() {
  return (data_folder() / "models").string();
}

namespace {

std::string folder_of(const char* variable, const fs::path& below_home) {
  if (const char* given = std::getenv(variable); given != nullptr && *given == '/') {
    return (fs::path(given) / "ressort").string();
  }
  if (const char* home = std::getenv("HOME"); home != nullptr && *home == '/') {
    return (fs::path(home) / below_home / "ressort").string();
  }
  return "";
}

}  // namespace

std::string user_folder() {
  return folder_of("XDG_DATA_HOME", fs::path(".local") / "share");
}

std::string cache_folder() {
  return folder_of("XDG_CACHE_HOME", ".cache");
}

std::string controllers_path() {
  const std::string folder = folder_of("XDG_CONFIG_HOME", ".config");
  return folder.empty() ? "" : folder + "/controllers.toml";
}

namespace {

// Returns the path of a user's file and creates its folder.
Result<std::string> users_file(const std::string& name, const char* kind, const char* ending) {
  constexpr std::size_t longest = 64;
  const bool is_name =
      !name.empty() && name.size() <= longest && name[0] != '.' && name[0] != ' ' &&
      name.back() != ' ' && std::ranges::all_of(name, [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
               c == ' ' || c == '.' || c == '_' || c == '-';
      });
  if (!is_name) {
    return Error{
        "a " + std::string(kind) +
        "'s name has 1 to 64 letters, digits, spaces and ._- and does not begin with a dot"};
  }
  const fs::path user = user_folder();
  if (user.empty()) {
    return Error{"there is no folder to save to: neither XDG_DATA_HOME nor HOME is set"};
  }
  const fs::path folder = user / (kind + std::string("s"));
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    return Error{"cannot create the folder '" + folder.string() + "': " + error.message()};
  }
  return (folder / (name + ending)).string();
}

}  // namespace

Result<std::string> path_to_save(const std::string& name) {
  return users_file(name, "preset", ".toml");
}

Result<std::string> path_of_flight(const std::string& name) {
  return users_file(name, "flight", ".ressort");
}

}  // namespace ressort::session
