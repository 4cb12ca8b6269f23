// tests: a data folder of the program's, for as long as this lives, instead of its own.
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace ressort {

class DataFolder {
 public:
  DataFolder() {
    std::filesystem::create_directories(path_ / "models");
    std::filesystem::create_directories(path_ / "presets");
    setenv("RESSORT_DATA", path_.c_str(), 1);
  }
  ~DataFolder() {
    unsetenv("RESSORT_DATA");
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
