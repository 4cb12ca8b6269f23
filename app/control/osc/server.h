// app/control: OSC over UDP. Its own socket, bound to one address; a strict check of every packet
// before liblo may see it; a thread of its own. Whoever may not send is not answered. Packets that
// come another way, from the panel's page, go through the same check, thread and queue.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "app/control/osc/socket.h"
#include "app/session/session.h"

namespace ressort::control {

class OscServer {
 public:
  using Tell = std::function<void(const std::string&)>;

  // Fails where the port is taken, saying so. `tell` gets what goes wrong with others' packets, on
  // any thread; it must outlive the session. [control]
  static Result<std::unique_ptr<OscServer>> open(const OscOptions& options, Process& process,
                                                 Session& session, Tell tell);
  // Without UDP: only ask() is heard.
  static Result<std::unique_ptr<OscServer>> open_unheard(Process& process, Session& session,
                                                         Tell tell);
  ~OscServer();

  // Does what a packet says, as if it had come from this machine, and gives its answers. Those that
  // come later, of a load say, go to `later`, on any thread, as long as the session lives. Waits
  // for OSC's thread. [any thread but audio and OSC's]
  using Packets = std::vector<std::vector<std::uint8_t>>;
  Packets ask(std::vector<std::uint8_t> packet, std::function<void(Packets)> later);

  bool is_heard() const;       // by UDP
  int port() const;            // the one in use; another than asked for only if 0 was asked for
  std::string access() const;  // who may send, for a person

 private:
  struct Server;
  explicit OscServer(std::unique_ptr<Server> server);
  std::unique_ptr<Server> server_;
};

}  // namespace ressort::control
