// app/control: OSC over UDP. Its own socket, bound to one address; a strict check of every packet
// before liblo may see it; a thread of its own. Whoever may not send is not answered.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "app/control/osc/socket.h"
#include "app/session/session.h"

namespace ressort {

class OscServer {
 public:
  using Tell = std::function<void(const std::string&)>;

  // Fails where the port is taken, saying so. `tell` gets what goes wrong with others' packets, on
  // any thread; it must outlive the session. [control]
  static Result<std::unique_ptr<OscServer>> open(const OscOptions& options, Process& process,
                                                 Session& session, Tell tell);
  ~OscServer();
  int port() const;            // the one in use; another than asked for only if 0 was asked for
  std::string access() const;  // who may send, for a person

 private:
  struct Server;
  explicit OscServer(std::unique_ptr<Server> server);
  std::unique_ptr<Server> server_;
};

}  // namespace ressort
