// app: writes what sounds to a WAV file, from a thread of its own.
#pragma once

#include <memory>
#include <string>

#include "app/process.h"
#include "core/result.h"

namespace ressort {

class Recorder {
 public:
  explicit Recorder(Process& process);
  ~Recorder();

  // Starts a recording of everything that is heard; 24 bit. [control]
  Result<Done> start(const std::string& path);
  // Ends it, the file being complete, and says how long it is and how many chunks were lost.
  Result<std::string> stop();
  bool is_running() const;

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

}  // namespace ressort
