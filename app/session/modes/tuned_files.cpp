#include "app/session/modes/tuned_files.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>

#include "core/model/language/mdl.h"

namespace ressort::session {
namespace {

namespace fs = std::filesystem;

fs::path folder_of_tuned() {
  const std::string cache = cache_folder();
  return cache.empty() ? fs::path() : fs::path(cache) / "tuned";
}

}  // namespace

Result<TunedFiles> tuned_files(const std::string& name, const std::string& model_text) {
  const fs::path folder = folder_of_tuned();
  if (folder.empty()) {
    return Error{
        "there is no cache folder for tuned models: neither XDG_CACHE_HOME nor HOME is set"};
  }
  const fs::path place = folder / digest(model_text);
  std::error_code error;
  fs::create_directories(place, error);
  if (error) {
    return Error{"cannot create the folder '" + place.string() + "': " + error.message()};
  }
  return TunedFiles{(place / (name + ".mdl")).string(), (place / (name + ".toml")).string()};
}

bool is_tuned(const std::string& model) {
  const fs::path folder = folder_of_tuned();
  const fs::path path = model;
  return !folder.empty() &&
         std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first ==
             folder.end();
}

Result<std::string> keep_tuned(const std::string& model, const std::string& name,
                               Existing existing) {
  const auto text = read_text(model, max_model_bytes);
  if (!text) {
    return text.error();
  }
  const fs::path folder = fs::path(user_folder()) / "models";
  std::error_code error;
  fs::create_directories(folder, error);
  const std::string path = (folder / (name + ".mdl")).string();
  if (existing == Existing::refuse && fs::exists(path, error)) {
    return Error{"'" + path + "' exists already; type 'save " + name +
                 " --force' at the console to overwrite it"};
  }
  const auto written = write_text(path, *text, existing);
  return written ? Result<std::string>(path) : written.error();
}

// Returns two 64-bit FNV-1a hashes with different offset bases, in hexadecimal.
std::string digest(const std::string& text) {
  std::string out;
  for (std::uint64_t hash : {0xcbf29ce484222325u, 0x9ae16a3b2f90404fu}) {
    for (const char c : text) {
      hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
    }
    char digits[20];
    std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(hash));
    out += digits;
  }
  return out;
}

}  // namespace ressort::session
