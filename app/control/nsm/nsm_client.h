// app/control: a client of the New Session Manager (NSM API 1.1), by OSC. [one thread]
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "app/control/message.h"
#include "app/control/osc/senders.h"
#include "core/result.h"

namespace ressort::control {

// A project that the manager asks to open.
struct NsmProject {
  std::string path;       // Path prefix for all files of the project: a folder and our name.
  std::string client_id;  // Required name of the JACK client.
};

class NsmClient {
 public:
  // Their results are sent to the manager; errors are reported there.
  using Open = std::function<Result<Done>(const NsmProject&)>;
  using Save = std::function<Result<Done>()>;
  // Returns the state that save would write, as a text for comparison; empty: nothing yet.
  using State = std::function<std::string()>;

  // Announces the program to the manager at `url`, "osc.udp://HOST:PORT/". The error: not an
  // address. poll() finds out whether the manager answers.
  static Result<std::unique_ptr<NsmClient>> announce(const std::string& url, Open open, Save save,
                                                     State state);
  ~NsmClient();
  NsmClient(const NsmClient&) = delete;
  NsmClient& operator=(const NsmClient&) = delete;

  // Handles the manager's requests since the last call, and reports whether there are unsaved
  // changes. Does not wait.
  void poll();

  // The manager's reply to the announcement, once there is one: its name, or its error.
  const std::string& manager() const { return manager_; }
  const std::string& refusal() const { return refusal_; }

 private:
  NsmClient(int socket, OscSender manager, Open open, Save save, State state);
  void tell_state();
  void handle(const Message& message);
  void answer(const std::string& address, const Result<Done>& result);
  void send(const std::vector<std::uint8_t>& bytes) const;

  int socket_;
  OscSender address_;
  Open open_;
  Save save_;
  State state_;
  bool is_open_ = false;
  bool is_dirty_ = false;
  std::string kept_;  // The last saved state; empty: the first state counts as saved.
  std::string manager_;
  std::string refusal_;
};

}  // namespace ressort::control
