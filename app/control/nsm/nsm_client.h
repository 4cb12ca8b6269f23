// app/control: a client of the New Session Manager (NSM API 1.1), by OSC. [one thread]
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "app/control/message.h"
#include "app/control/osc/senders.h"
#include "core/result.h"

namespace ressort::control {

// What the manager wants to be opened.
struct NsmProject {
  std::string path;       // where all of it is to be kept: a name that is ours, in a folder
  std::string client_id;  // the name that our JACK client has to have
};

class NsmClient {
 public:
  // Both answer for the manager: an error is told there.
  using Open = std::function<Result<Done>(const NsmProject&)>;
  using Save = std::function<Result<Done>()>;
  // What save would keep, told apart by its text; empty: nothing yet.
  using State = std::function<std::string()>;

  // Says to the manager at `url`, "osc.udp://HOST:PORT/", that we are there. The error: that is no
  // address. Whether anybody answers, poll() will tell.
  static Result<std::unique_ptr<NsmClient>> announce(const std::string& url, Open open, Save save,
                                                     State state);
  ~NsmClient();
  NsmClient(const NsmClient&) = delete;
  NsmClient& operator=(const NsmClient&) = delete;

  // Does what the manager has asked for since the last call, and tells it whether there is anything
  // to save; does not wait.
  void poll();

  // The manager's answer to the announcement, once there is one: its name, or its error.
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
  std::string kept_;  // the state; empty: that which comes first
  std::string manager_;
  std::string refusal_;
};

}  // namespace ressort::control
