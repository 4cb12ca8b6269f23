// app/session: files that are written. One takes its place when it is whole; until then, and if it
// never is, what was there before stays as it was.
#pragma once

#include <span>
#include <string>

#include "app/rooms.h"
#include "core/result.h"

namespace ressort::session {

enum class Existing { refuse, replace };  // what a file that is already there is for a new one

class NewFile {
 public:
  // `is_shown`: where nothing is there yet it is written under its own name from the start, so that
  // even what is killed is found there. Otherwise it is NAME.part.ENDING until it is kept. Links
  // stay: what they lead to is replaced. A device or a pipe is written as it is.
  static Result<NewFile> open(const std::string& path, Existing existing, bool is_shown = false);
  NewFile(NewFile&& other) noexcept;
  NewFile& operator=(NewFile&&) = delete;
  ~NewFile();  // what was not kept is gone

  int descriptor() const { return descriptor_; }
  Result<Done> write(const std::string& text);
  // It is whole.
  Result<Done> keep();

 private:
  NewFile() = default;

  std::string path_;     // as it was asked for
  std::string place_;    // behind all links
  std::string written_;  // its name so far; empty: a device's or a pipe's, not to be removed
  Existing existing_ = Existing::refuse;
  int descriptor_ = -1;
};

// Fails where `output` is one of the files that were read, under whatever name. Empty names are
// passed over.
Result<Done> spare(const std::string& output, std::span<const std::string> read);

}  // namespace ressort::session
