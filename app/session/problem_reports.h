// app/session: messages about problems of the audio thread, limited in number.
#pragma once

#include <cstdint>
#include <string>

#include "app/realtime/process.h"
#include "app/realtime/rate_limit.h"
#include "app/session/load_progress.h"
#include "core/compile/compile.h"

namespace ressort::session {

// Returns why a voice was faded out, and what to do. In a model that is proved stable, a force was
// too large.
std::string reset_cause(bool is_proved);

// [worker]
class ProblemReports {
 public:
  // A voice of this model became unstable.
  void add_reset(const std::string& model, bool is_proved);
  // The load of a model with this precision is too high.
  void add_overload(const Report& report, Precision precision);
  // Adds late and dropped events since the last call.
  void add_lost_events(const Meters& now);
  // Reports what is due.
  void report(const MessageHandler& on_message);

 private:
  RateLimit resets_;
  RateLimit overloads_{std::chrono::seconds(10)};
  RateLimit late_;
  RateLimit dropped_;
  std::uint64_t late_seen_ = 0;
  std::uint64_t dropped_seen_ = 0;
};

}  // namespace ressort::session
