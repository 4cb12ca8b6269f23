// app/control: OSC over UDP: a socket bound to one address, a strict check of every packet before
// liblo reads it, and a thread. Senders that are not allowed get no reply. Packets from the web
// panel go through the same check, thread and queue.
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
  using Log = std::function<void(const std::string&)>;

  // Opens the socket and starts the thread; fails if the port is in use. `log` receives messages
  // about faulty packets, on any thread; it must outlive the session. [control]
  static Result<std::unique_ptr<OscServer>> open(const OscOptions& options, Process& process,
                                                 Session& session, Log log);
  // Starts the thread without UDP; only ask() reaches it.
  static Result<std::unique_ptr<OscServer>> open_without_udp(Process& process, Session& session,
                                                             Log log);
  ~OscServer();

  // Executes a packet as if it came from this machine, and returns its replies. Later replies, for
  // example of a load, go to `later`, on any thread, while the session lives. Waits for OSC's
  // thread. [any thread but audio and OSC's]
  using Packets = std::vector<std::vector<std::uint8_t>>;
  Packets ask(std::vector<std::uint8_t> packet, std::function<void(Packets)> later);

  bool listens_on_udp() const;  // True if it listens on UDP.
  int port() const;  // The port in use; differs from the requested one only if that was 0.
  std::string access() const;  // Describes who may send.

 private:
  struct Server;
  explicit OscServer(std::unique_ptr<Server> server);
  std::unique_ptr<Server> server_;
};

}  // namespace ressort::control
