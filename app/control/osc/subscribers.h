// app/control: clients that subscribe to all changes, and until when. [OSC's thread]
#pragma once

#include <cstdint>
#include <vector>

#include "app/control/osc/client.h"
#include "app/session/session.h"

namespace ressort::control {

class Subscribers {
 public:
  static constexpr double longest_lease_s = 60.0;
  static constexpr std::size_t most = 16;
  static constexpr int period_ms = 20;  // Changes of a parameter within this time are sent as one.

  enum class News : std::uint8_t { changes, timbre };

  // Adds or renews a subscription from now on. The error: too many clients.
  Result<Done> add(const OscClient& client, News news, double lease_s, std::int64_t now_ns);
  bool remove(const OscClient& client);  // Removes the client from all kinds of news.

  // Sends the changes since the last call: "/loaded NAME" and then all parameters after a load,
  // else the changed ones as "/param/NAME VALUE" and "/control/NAME VALUE". A new subscriber gets
  // everything. Every new timbre frame is sent as "/timbre.frame NUMBER FIGURE...", with the
  // figures before the harmonic ones; an absent figure is 0. Returns the time until the next call
  // in ms, or -1 for never.
  int send_changes(Session& session, std::int64_t now_ns);

 private:
  struct Subscriber {
    OscClient client;
    News news = News::changes;
    std::int64_t until_ns = 0;
    bool is_new = true;
  };
  void tell_changes(const Session& session);
  void tell_timbre(const TimbreWatch& timbre);
  std::vector<Subscriber> all_;
  Session::Present told_;
  std::uint64_t told_frame_ = 0;
  std::uint64_t reloads_ = 0;  // Number of reloads already sent.
};

}  // namespace ressort::control
