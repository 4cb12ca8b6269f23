#include "app/session/watch/file_watch.h"

#include <sys/inotify.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>

namespace ressort::session {
namespace {

namespace fs = std::filesystem;

// A link is complete at once; a new file is written and closed later.
bool is_link(const fs::path& path) {
  struct stat status {};
  return lstat(path.c_str(), &status) == 0 && (S_ISLNK(status.st_mode) || status.st_nlink > 1);
}

}  // namespace

FileWatch::FileWatch() : descriptor_(inotify_init1(IN_NONBLOCK | IN_CLOEXEC)) {}

FileWatch::~FileWatch() {
  if (is_open()) {
    close(descriptor_);
  }
}

bool FileWatch::follow(const std::vector<std::string>& paths) {
  std::map<std::string, Names> wanted;  // names by folder
  const auto want = [&](const fs::path& path) {
    const fs::path folder = path.parent_path();
    wanted[folder.empty() ? "." : folder.string()].insert(path.filename().string());
  };
  for (const std::string& path : paths) {
    std::error_code error;
    want(path);
    if (const fs::path there = fs::canonical(path, error); !error) {
      want(there);
    }
  }
  bool is_any_new = false;
  std::map<std::string, int> folders;
  std::map<int, Names> names;
  for (const auto& [folder, its_names] : wanted) {
    const int watch = inotify_add_watch(descriptor_, folder.c_str(),
                                        IN_CLOSE_WRITE | IN_MOVED_TO | IN_CREATE | IN_ONLYDIR);
    if (watch < 0) {
      continue;  // the folder does not exist
    }
    const auto before = names_.find(watch);
    for (const std::string& name : its_names) {
      is_any_new = is_any_new || before == names_.end() || !before->second.contains(name);
      names[watch].insert(name);
    }
    folders[folder] = watch;
  }
  for (const auto& [watch, its_names] : names_) {
    if (!names.contains(watch)) {
      inotify_rm_watch(descriptor_, watch);
    }
  }
  folders_ = std::move(folders);
  names_ = std::move(names);
  return is_any_new;
}

bool FileWatch::has_changed() {
  bool has_changed = false;
  alignas(inotify_event) std::array<char, 4096> buffer;
  for (ssize_t got = 0; (got = read(descriptor_, buffer.data(), buffer.size())) > 0;) {
    for (std::size_t at = 0; at < static_cast<std::size_t>(got);) {
      inotify_event event;
      std::memcpy(&event, buffer.data() + at, sizeof event);
      const char* const name = buffer.data() + at + sizeof event;
      at += sizeof event + event.len;
      if ((event.mask & IN_Q_OVERFLOW) != 0) {
        has_changed = true;  // overflow: assume that a file has changed
        continue;
      }
      const auto names = names_.find(event.wd);
      if (names == names_.end() || event.len == 0 || !names->second.contains(name)) {
        continue;
      }
      const auto is_here = [watch = event.wd, name](const auto& folder) {
        return folder.second == watch && is_link(fs::path(folder.first) / name);
      };
      has_changed =
          has_changed || (event.mask & IN_CREATE) == 0 || std::ranges::any_of(folders_, is_here);
    }
  }
  return has_changed;
}

}  // namespace ressort::session
