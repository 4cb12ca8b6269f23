#include "app/session/files.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <system_error>

#include "app/exit_code.h"

namespace ressort {
namespace {

namespace fs = std::filesystem;

// The installed place or the source tree, whichever is there; RESSORT_DATA goes before both.
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

bool is_below(const fs::path& path, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first ==
         folder.end();
}

std::string names_of_presets() {
  std::string names;
  for (const std::string& preset : known_presets()) {
    names += (names.empty() ? "" : ", ") + preset;
  }
  return names;
}

std::vector<std::string> names_in(const fs::path& folder, const char* ending) {
  std::set<std::string> names;
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    if (entry->path().extension() == ending) {
      names.insert(entry->path().stem().string());
    }
  }
  return {names.begin(), names.end()};
}

// A text without the mark that some editors put before it.
Result<std::string> unmarked(const std::string& path, std::string text) {
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff")) {
    return Error{"'" + path + "' is text in UTF-16; save it as UTF-8"};
  }
  if (text.starts_with("\xef\xbb\xbf")) {
    text.erase(0, 3);
  }
  return text;
}

// Rounded up: what is a byte too large shall not seem to fit.
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
    return Error{"'" + path + "' is no ordinary file"};
  }
  const auto size = fs::file_size(path, error);
  if (!error && size > max_bytes) {
    return Error{"'" + path + "' has " + in_bytes(size) + "; at most " + in_bytes(max_bytes) +
                 " are read"};
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
  return written ? file->keep() : written;
}

int put_text(const std::string& path, const std::string& text, bool force) {
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
  const fs::path data = data_folder();
  const std::vector<fs::path> own = {data / "presets" / (name + ".toml"), data / "presets" / name,
                                     data / "models" / (name + ".mdl"), data / "models" / name};
  if (reach == Reach::own_folders) {
    for (const fs::path& path : own) {
      if (const auto found = own_file(path.string()); found && fs::path(name).is_relative()) {
        return *found;
      }
    }
    const std::string presets = names_of_presets();
    return Error{"there is no model or preset '" + name +
                 "' in the program's own folders, and OSC loads no others; there are " +
                 (presets.empty() ? "none" : presets)};
  }
  for (const fs::path& path : {fs::path(name), fs::path(name + ".toml"), fs::path(name + ".mdl")}) {
    if (fs::exists(path, error) && !fs::is_directory(path, error)) {
      return path.string();
    }
  }
  for (const fs::path& path : own) {
    if (fs::exists(path, error) && !fs::is_directory(path, error)) {
      return path.string();
    }
  }
  if (fs::is_directory(name, error)) {
    return Error{"'" + name + "' is a folder; expected a .mdl model or a .toml preset"};
  }
  const std::string presets = names_of_presets();
  return Error{"there is no model or preset '" + name + "'; there are " +
               (presets.empty() ? "none in '" + data.string() + "'" : presets) +
               ", or give the path of a .mdl or .toml file"};
}

std::optional<std::string> own_file(const std::string& path) {
  std::error_code error;
  const fs::path found = fs::canonical(path, error);
  if (error || !fs::is_regular_file(found, error) ||
      (found.extension() != ".mdl" && found.extension() != ".toml")) {
    return std::nullopt;
  }
  for (const char* const name : {"models", "presets"}) {
    const fs::path folder = fs::canonical(data_folder() / name, error);
    if (!error && is_below(found, folder)) {
      return found.string();
    }
  }
  return std::nullopt;
}

std::vector<std::string> known_presets() {
  return names_in(data_folder() / "presets", ".toml");
}
std::vector<std::string> known_models() {
  return names_in(data_folder() / "models", ".mdl");
}
std::string models_folder() {
  return (data_folder() / "models").string();
}

}  // namespace ressort
