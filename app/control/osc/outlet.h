// app/control: the way back of OSC. Lives as long as somebody may have something to answer: a load
// may end after the server has.
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
  using Tell = std::function<void(const std::string&)>;

  // Takes the socket. `tell` gets what the person at this machine should know, on any thread; it
  // must outlive the session.
  OscOutlet(int socket, Tell tell);
  ~OscOutlet();
  OscOutlet(const OscOutlet&) = delete;
  OscOutlet& operator=(const OscOutlet&) = delete;

  // All of this: [any thread but audio]
  void received(const OscSender& from, std::size_t bytes);
  bool may_answer(const OscSender& to);      // as AnswerBudget says
  double tell_pause_s(const OscSender& to);  // the same
  // Whether there is room for answers of many rows.
  bool has_room();
  // Sends the answers in this order. Many go in portions: a receiver holds only so many.
  void answer(const OscSender& to, std::vector<Bytes> answers);
  // Sends the portions that are due, the first of an answer at once; gives back in how many ms the
  // next one is, -1 for never.
  int send_due();

  void tell(const std::string& news) const;
  // What failed, in more words than the asker may read; once in a while.
  void tell_failure(const std::string& news);
  // Nothing is sent any more.
  void close();

  // False when enough loads wait for their answer already.
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
  const Tell tell_;
  AnswerBudget budget_;
  std::map<std::pair<std::uint32_t, std::uint16_t>, Waiting> waiting_;  // by address and port
  std::size_t waiting_bytes_ = 0;
  int loads_waiting_ = 0;
  RateLimit failures_;
};

}  // namespace ressort::control
