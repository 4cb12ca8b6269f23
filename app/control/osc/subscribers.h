// app/control: who wants to hear of every change, whoever makes it, and until when. [OSC's thread]
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "app/control/osc/client.h"
#include "app/session/session.h"

namespace ressort::control {

class Subscribers {
 public:
  static constexpr double longest_lease_s = 60.0;
  static constexpr std::size_t most = 16;
  static constexpr int period_ms = 20;  // changes of one parameter within it are told as one

  enum class News : std::uint8_t { changes, timbre };

  // For so long, from now; a subscription of the same sender is renewed. The error: too many.
  Result<Done> add(const OscClient& client, News news, double lease_s, std::int64_t now_ns);
  bool remove(const OscClient& client);  // from all news

  // Tells what has changed since the last call: "/loaded NAME", if a scene was, and all parameters
  // then, else those that differ, as "/param/NAME VALUE". Whoever has just come is told all. And
  // every frame of timbre that there was, as "/timbre.frame NUMBER FIGURE...", the figures being
  // those before the harmonic ones; one that is absent is 0. Gives back in how many ms it is to be
  // called again, -1 for never.
  int tell(Session& session, std::int64_t now_ns);

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
  std::uint64_t reloads_ = 0;  // that were told
};

}  // namespace ressort::control
