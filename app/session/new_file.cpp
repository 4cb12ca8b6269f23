#include "app/session/new_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

namespace ressort::session {
namespace {

namespace fs = std::filesystem;

constexpr int most_links = 40;       // the kernel's limit
constexpr int most_leftovers = 100;  // temporary files left by killed programs

Error cannot_write(const std::string& path) {
  return {"'" + path + "' cannot be written: " + std::generic_category().message(errno)};
}

// Resolves links, even if their target does not exist.
std::string behind_links(const std::string& path) {
  fs::path place = path;
  std::error_code error;
  for (int i = 0; i < most_links && fs::is_symlink(place, error); ++i) {
    const fs::path next = fs::read_symlink(place, error);
    place = next.is_absolute() ? next : place.parent_path() / next;
  }
  return place.string();
}

// "take.wav" is "take.part.wav" until it is complete, so that the ending stays.
std::string part_of(const std::string& place, int number) {
  const fs::path path = place;
  const std::string part = number == 1 ? ".part" : ".part" + std::to_string(number);
  return (path.parent_path() / (path.stem().string() + part + path.extension().string())).string();
}

int open_new(const std::string& path, mode_t mode) {
  return ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, mode);
}

}  // namespace

NewFile::NewFile(NewFile&& other) noexcept
    : path_(std::move(other.path_)),
      place_(std::move(other.place_)),
      written_(std::exchange(other.written_, {})),
      existing_(other.existing_),
      descriptor_(std::exchange(other.descriptor_, -1)) {}

NewFile::~NewFile() {
  if (descriptor_ >= 0) {
    close(descriptor_);
  }
  if (!written_.empty()) {
    unlink(written_.c_str());
  }
}

Result<NewFile> NewFile::open(const std::string& path, Existing existing, bool is_shown) {
  NewFile file;
  file.path_ = path;
  file.place_ = behind_links(path);
  file.existing_ = existing;
  struct stat there {};
  const bool is_there = stat(file.place_.c_str(), &there) == 0;
  if (is_there && S_ISDIR(there.st_mode)) {
    return Error{"'" + path + "' is a folder"};
  }
  if (is_there && !S_ISREG(there.st_mode)) {
    file.descriptor_ = ::open(file.place_.c_str(), O_WRONLY | O_CLOEXEC);
    return file.descriptor_ >= 0 ? Result<NewFile>(std::move(file)) : cannot_write(path);
  }
  if (is_there && existing == Existing::refuse) {
    return Error{"'" + path + "' exists already; --force overwrites it"};
  }
  if (is_there && access(file.place_.c_str(), W_OK) != 0) {
    return cannot_write(path);
  }
  std::string name = file.place_;
  if (is_shown && !is_there) {
    file.descriptor_ = open_new(name, 0666);
  } else {
    for (int number = 1; file.descriptor_ < 0 && number <= most_leftovers; ++number) {
      name = part_of(file.place_, number);
      file.descriptor_ = open_new(name, 0666);
      if (file.descriptor_ < 0 && errno != EEXIST) {
        break;
      }
    }
  }
  if (file.descriptor_ < 0) {
    return cannot_write(path);
  }
  file.written_ = std::move(name);
  if (is_there) {  // keep the permissions
    static_cast<void>(!fchmod(file.descriptor_, there.st_mode & 07777));
  }
  return file;
}

Result<Done> NewFile::write(const std::string& text) {
  for (std::size_t at = 0; at < text.size();) {
    const ssize_t count = ::write(descriptor_, text.data() + at, text.size() - at);
    if (count < 0 && errno != EINTR) {
      return cannot_write(path_);
    }
    at += count > 0 ? static_cast<std::size_t>(count) : 0;
  }
  return Done{};
}

Result<Done> NewFile::keep() {
  const int closed = close(std::exchange(descriptor_, -1));
  if (closed != 0) {
    return cannot_write(path_);
  }
  if (written_.empty() || written_ == place_) {
    written_.clear();
    return Done{};
  }
  // Do not overwrite a file that was created meanwhile, if the file system supports that.
  const bool may_replace = existing_ == Existing::replace;
  int failed = renameat2(AT_FDCWD, written_.c_str(), AT_FDCWD, place_.c_str(),
                         may_replace ? 0 : RENAME_NOREPLACE);
  if (failed != 0 && errno == EINVAL && !may_replace) {
    failed = std::rename(written_.c_str(), place_.c_str());
  }
  if (failed != 0) {
    return cannot_write(path_);
  }
  written_.clear();
  return Done{};
}

Result<Done> check_not_input(const std::string& output, std::span<const std::string> read) {
  for (const std::string& input : read) {
    std::error_code error;
    if (!input.empty() && fs::equivalent(output, input, error)) {
      return Error{"'" + output + "' " +
                   (output == input ? "is an input" : "is the input '" + input + "'") +
                   ", so it cannot be the output"};
    }
  }
  return Done{};
}

}  // namespace ressort::session
