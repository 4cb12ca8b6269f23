// app/session: records the output to a sound file, on a thread of its own.
#pragma once

#include <memory>
#include <string>

#include "app/realtime/process.h"
#include "app/session/load_progress.h"
#include "app/session/new_file.h"
#include "core/result.h"

namespace ressort::session {

class Recorder {
 public:
  // `on_message` receives the error if a recording ends by itself; on the recorder's thread.
  Recorder(Process& process, MessageHandler on_message);
  ~Recorder();

  // Starts a 24-bit recording of the output. If the program is killed, the file is readable up to
  // that moment. [control]
  Result<Done> start(const std::string& path, Existing existing);
  // Ends the recording and completes the file. Returns its length and the number of lost chunks.
  // Returns the error of a recording that ended by itself, once.
  Result<std::string> stop();
  bool is_running() const;

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

}  // namespace ressort::session
