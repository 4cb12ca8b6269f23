// app/session: whether files have changed, as whoever edits them changes them. [one thread]
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "app/rooms.h"

namespace ressort::session {

// By inotify, so not on file systems of other machines. Folders are watched, not files: editors put
// a new file in the old one's place.
class FileWatch {
 public:
  FileWatch();
  ~FileWatch();
  FileWatch(const FileWatch&) = delete;
  FileWatch& operator=(const FileWatch&) = delete;

  bool is_open() const { return descriptor_ >= 0; }

  // These from now on, links and what they lead to; those too that are not there yet. True if any
  // of them was not followed before: what happened to it until now is not known.
  bool follow(const std::vector<std::string>& paths);

  // Whether any of them was written and closed, or put in its place, since the last call. Returns
  // at once.
  bool has_changed();

 private:
  using Names = std::set<std::string>;
  int descriptor_ = -1;
  std::map<std::string, int> folders_;  // watch descriptors
  std::map<int, Names> names_;          // [watch descriptor]
};

}  // namespace ressort::session
