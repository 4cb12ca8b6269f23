// app/commands: errors, progress, figures and temporary files of the commands.
#pragma once

#include <string>

#include "app/plot/plot.h"
#include "core/progress.h"
#include "core/result.h"

namespace ressort::commands {

// Prints a line to stderr.
void print_error(const std::string& message);

// Prints an error in the arguments or the input. Returns its exit code.
int reject(const std::string& message);

// Returns the program's version and the date, for the captions of figures.
std::string made_today();

// Returns a Progress that prints the stages of slow work. It never stops: Ctrl-C ends the process.
Progress report_stages(const std::string& name);

// Draws a figure and writes it, as PNG if the path ends with .png, else as SVG; prints errors.
// Returns the exit code. [control]
int put_figure(const std::string& path, const plot::Figure& figure, bool force);

// A folder that is deleted with this object.
class TemporaryFolder {
 public:
  static Result<TemporaryFolder> make();
  TemporaryFolder(TemporaryFolder&& other) noexcept;
  TemporaryFolder& operator=(TemporaryFolder&&) = delete;
  ~TemporaryFolder();
  const std::string& path() const { return path_; }
  std::string file(const std::string& name) const { return path_ + "/" + name; }

 private:
  explicit TemporaryFolder(std::string path) : path_(std::move(path)) {}
  std::string path_;
};

}  // namespace ressort::commands
