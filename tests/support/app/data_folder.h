// tests: temporary folders.
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>

#include "tests/support/catch.h"

namespace ressort {

// A folder that is removed with the object.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "ressort_test_XXXXXX").string();
    REQUIRE(mkdtemp(name.data()) != nullptr);
    path_ = name;
  }
  ~Folder() {
    std::error_code error;
    std::filesystem::remove_all(path_, error);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  std::string file(const std::string& name) const { return (path_ / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path_ / name, std::ios::binary) << text;
    return file(name);
  }
  std::string text(const std::string& name) const {
    std::ostringstream all;
    all << std::ifstream(path_ / name, std::ios::binary).rdbuf();
    return all.str();
  }
  std::set<std::string> names() const {
    std::set<std::string> all;
    for (const auto& entry : std::filesystem::directory_iterator(path_)) {
      all.insert(entry.path().filename().string());
    }
    return all;
  }

 private:
  std::filesystem::path path_;
};

// Replaces the program's data folder.
class DataFolder {
 public:
  DataFolder() {
    std::filesystem::create_directories(path_ / "models");
    std::filesystem::create_directories(path_ / "presets");
    setenv("RESSORT_DATA", path_.c_str(), 1);
    setenv("XDG_DATA_HOME", (path_ / "home").c_str(), 1);
  }
  ~DataFolder() {
    unsetenv("RESSORT_DATA");
    unsetenv("XDG_DATA_HOME");
    std::filesystem::remove_all(path_);
  }
  DataFolder(const DataFolder&) = delete;
  DataFolder& operator=(const DataFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path path(std::string_view name) const { return path_ / name; }

  void write(std::string_view name, std::string_view text) const {
    std::ofstream(path(name)) << text;
  }

 private:
  std::filesystem::path path_ =
      std::filesystem::temp_directory_path() / ("ressort_data_" + std::to_string(getpid()));
};

}  // namespace ressort
