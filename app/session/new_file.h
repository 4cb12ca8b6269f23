// app/session: writes files atomically. A file gets its name when it is complete; until then, the
// previous file stays.
#pragma once

#include <span>
#include <string>

#include "app/rooms.h"
#include "core/result.h"

namespace ressort::session {

enum class Existing { refuse, replace };  // whether to overwrite an existing file

class NewFile {
 public:
  // Opens a file for writing. `is_shown`: a new file has its own name from the start, so that it
  // can be found if the program is killed. Otherwise it is NAME.part.ENDING until keep(). Links are
  // followed. Devices and pipes are written directly.
  static Result<NewFile> open(const std::string& path, Existing existing, bool is_shown = false);
  NewFile(NewFile&& other) noexcept;
  NewFile& operator=(NewFile&&) = delete;
  ~NewFile();  // deletes the file unless it was kept

  int descriptor() const { return descriptor_; }
  Result<Done> write(const std::string& text);
  // Gives the complete file its name.
  Result<Done> keep();

 private:
  NewFile() = default;

  std::string path_;     // path as requested
  std::string place_;    // path with links resolved
  std::string written_;  // temporary name; empty for devices and pipes
  Existing existing_ = Existing::refuse;
  int descriptor_ = -1;
};

// Fails if `output` is one of the files that were read, by any name. Ignores empty names.
Result<Done> check_not_input(const std::string& output, std::span<const std::string> read);

}  // namespace ressort::session
