// app/session: detects changes of files. [one thread]
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "app/rooms.h"

namespace ressort::session {

// Uses inotify, which does not work on network file systems. Watches folders instead of files,
// because editors replace a file by a new one.
class FileWatch {
 public:
  FileWatch();
  ~FileWatch();
  FileWatch(const FileWatch&) = delete;
  FileWatch& operator=(const FileWatch&) = delete;

  bool is_open() const { return descriptor_ >= 0; }

  // Watches these files from now on, including links and their targets and files that do not exist
  // yet. Returns true if any file was not watched before and may have changed unnoticed.
  bool follow(const std::vector<std::string>& paths);

  // Returns true if any file was written and closed, or replaced, since the last call. Returns at
  // once.
  bool has_changed();

 private:
  using Names = std::set<std::string>;
  int descriptor_ = -1;
  std::map<std::string, int> folders_;  // watch descriptors
  std::map<int, Names> names_;          // [watch descriptor]
};

}  // namespace ressort::session
