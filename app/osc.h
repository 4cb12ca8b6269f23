// app: OSC over UDP. Its own socket, bound to one address; a strict check of every packet before
// liblo may see it; a thread of its own.
#pragma once

#include <memory>
#include <string>

#include "app/session.h"

namespace ressort {

struct OscOptions {
  std::string bind_address = "127.0.0.1";
  int port = 9777;
};

class OscServer {
 public:
  // Fails where the port is taken, saying so. [control]
  static Result<std::unique_ptr<OscServer>> open(const OscOptions& options, Process& process,
                                                 Session& session);
  ~OscServer();
  int port() const;  // the one in use; another than asked for only if 0 was asked for

 private:
  struct Server;
  explicit OscServer(std::unique_ptr<Server> server);
  std::unique_ptr<Server> server_;
};

}  // namespace ressort
