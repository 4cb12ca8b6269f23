// app/session: writes what sounds to a sound file, from a thread of its own.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "app/realtime/process.h"
#include "app/session/new_file.h"
#include "core/result.h"

namespace ressort::session {

class Recorder {
 public:
  using Tell = std::function<void(const std::string&)>;

  // `tell` gets what ends a recording by itself; on the recorder's thread.
  Recorder(Process& process, Tell tell);
  ~Recorder();

  // Starts a recording of everything that is heard; 24 bit. What is killed can be read as far as it
  // went. [control]
  Result<Done> start(const std::string& path, Existing existing);
  // Ends it, the file being complete, and says how long it is and how many chunks were lost. An
  // error after one that ended by itself, once.
  Result<std::string> stop();
  bool is_running() const;

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

}  // namespace ressort::session
