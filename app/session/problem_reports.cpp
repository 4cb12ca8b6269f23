#include "app/session/problem_reports.h"

#include <cmath>
#include <utility>

#include "app/session/timing.h"
#include "app/text.h"

namespace ressort::session {

std::string reset_cause(bool is_proved) {
  return is_proved ? "it was pushed too hard; lower the force"
                   : "it became unstable; lower its stiffness or damping, or raise its mass";
}

void ProblemReports::add_reset(const std::string& model, bool is_proved) {
  resets_.add(model + ": a voice was faded out, because " + reset_cause(is_proved));
}

void ProblemReports::add_overload(const Report& report, Precision precision) {
  overloads_.add("the load is " + std::to_string(std::lround(100.0 * report.value)) + " %" +
                 (report.index > 0 ? "; the quietest voices fade out, and at most " +
                                         counted(report.index, "voice sounds", "voices sound") +
                                         " until the load falls"
                                   : "") +
                 "; to lower the load, use a longer period, " +
                 ways_to_lower_load(report.index, precision));
}

void ProblemReports::add_lost_events(const Meters& now) {
  constexpr double least_lateness_s = 0.05;  // a shorter delay is hardly audible
  if (now.late != late_seen_ && now.late_s > least_lateness_s) {
    late_.add("an event came " + fixed(now.late_s, 3) + " s late",
              now.late - std::exchange(late_seen_, now.late));
  }
  if (now.dropped != dropped_seen_) {
    dropped_.add(
        "an event was dropped, because more events arrived than can be played, or a period was "
        "missed",
        now.dropped - std::exchange(dropped_seen_, now.dropped));
  }
}

void ProblemReports::report(const MessageHandler& on_message) {
  for (RateLimit* const limit : {&resets_, &overloads_, &late_, &dropped_}) {
    if (const auto message = limit->take()) {
      on_message(*message);
    }
  }
}

}  // namespace ressort::session
