#include "app/session/wisdom.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "app/session/files.h"
#include "app/session/modes/tuned_files.h"
#include "app/version.h"

namespace ressort::session {
namespace {

using nlohmann::json;

constexpr std::size_t most_file_bytes = std::size_t{4} << 20;
// If there are more, only the entries of this run are kept.
constexpr std::size_t most_entries = 20'000;

std::string cpu_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.starts_with("model name")) {
      return line;
    }
  }
  return "";
}

std::string digest_of(const std::string& key) {
  static const std::string machine = std::string(version) + " " + commit + "\n" + cpu_name() + "\n";
  return digest(machine + key);
}

std::map<std::string, double> read_entries(const std::string& path) {
  std::map<std::string, double> entries;
  const auto text = read_text(path, most_file_bytes);
  const json read = text ? json::parse(*text, nullptr, false) : json();
  if (!read.is_object()) {
    return entries;
  }
  for (const auto& [key, value] : read.items()) {
    if (value.is_number() && value.get<double>() > 0.0 && std::isfinite(value.get<double>())) {
      entries.emplace(key, value.get<double>());
    }
  }
  return entries;
}

}  // namespace

std::string wisdom_path() {
  const std::string folder = cache_folder();
  return folder.empty() ? "" : folder + "/wisdom.json";
}

std::optional<double> Wisdom::recall(const std::string& key) {
  const auto& entries = known();
  const auto found = entries.find(digest_of(key));
  return found == entries.end() ? std::nullopt : std::optional(found->second);
}

void Wisdom::keep(const std::string& key, double ns) {
  if (!(ns > 0.0) || !std::isfinite(ns)) {
    return;
  }
  const std::string short_key = digest_of(key);
  added_[short_key] = ns;
  known()[short_key] = ns;
}

std::map<std::string, double>& Wisdom::known() {
  if (!known_) {
    known_ = path_.empty() ? std::map<std::string, double>() : read_entries(path_);
  }
  return *known_;
}

void Wisdom::save() {
  if (added_.empty() || path_.empty()) {
    return;
  }
  std::map<std::string, double> all = read_entries(path_);
  if (all.size() > most_entries) {
    all.clear();
  }
  for (const auto& [key, ns] : added_) {
    all[key] = ns;
  }
  added_.clear();
  std::error_code error;
  std::filesystem::create_directories(std::filesystem::path(path_).parent_path(), error);
  static_cast<void>(write_text(path_, json(all).dump(), Existing::replace));
}

}  // namespace ressort::session
