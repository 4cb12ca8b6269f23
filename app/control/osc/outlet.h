// app/control: sends OSC replies. It lives as long as any reply may be sent, because a load may end
// after the server has.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "app/control/osc/senders.h"
#include "app/realtime/rate_limit.h"

namespace ressort::control {

class OscOutlet {
 public:
  using Bytes = std::vector<std::uint8_t>;
  using Log = std::function<void(const std::string&)>;

  // Takes ownership of the socket. `log` receives messages for the local user, on any thread; it
  // must outlive the session.
  OscOutlet(int socket, Log log);
  ~OscOutlet();
  OscOutlet(const OscOutlet&) = delete;
  OscOutlet& operator=(const OscOutlet&) = delete;

  // All of these: [any thread but audio]
  void received(const OscSender& from, std::size_t bytes);
  bool may_answer(const OscSender& to);       // Applies AnswerBudget.
  double reply_pause_s(const OscSender& to);  // Applies AnswerBudget.
  // Returns whether there is room for a reply of many rows.
  bool has_room();
  // Queues replies in this order. Long ones are sent in portions, because a receiver's buffer is
  // limited.
  void answer(const OscSender& to, std::vector<Bytes> answers);
  // Sends the portions that are due, the first one of a reply immediately. Returns the time until
  // the next one in ms, or -1 for none.
  int send_due();

  void log(const std::string& news) const;
  // Logs a failure in more detail than the client may see; rate-limited.
  void log_failure(const std::string& news);
  // Stops sending.
  void close();

  // Returns false if too many loads are waiting for their reply.
  bool begin_load();
  void end_load();

 private:
  struct Waiting {
    std::deque<Bytes> answers;
    std::int64_t due_ns = 0;
  };

  void send(const OscSender& to, const Bytes& bytes);

  std::mutex mutex_;
  int socket_;
  const Log log_;
  AnswerBudget budget_;
  // Keyed by address and port.
  std::map<std::pair<std::uint32_t, std::uint16_t>, Waiting> waiting_;
  std::size_t waiting_bytes_ = 0;
  int loads_waiting_ = 0;
  RateLimit failures_;
};

}  // namespace ressort::control
