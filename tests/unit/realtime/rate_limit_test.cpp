// Limits on repeated messages.
#include "app/realtime/rate_limit.h"

#include "tests/support/catch.h"
#include "tests/support/rooms.h"

namespace ressort::rate_limit_test {

using namespace std::chrono_literals;

TEST_CASE("the first message passes at once, later ones once an interval, and all are counted",
          "[rate_limit]") {
  RateLimit limit(5s);
  const RateLimit::Clock::time_point start = RateLimit::Clock::now();
  CHECK_FALSE(limit.take(start));
  limit.add("one");
  CHECK(limit.take(start) == "one");
  CHECK_FALSE(limit.take(start));
  for (int i = 0; i < 412; ++i) {
    limit.add("another");
  }
  limit.add("the newest", 2);
  CHECK_FALSE(limit.take(start + 5s - 1ns));
  CHECK(limit.take(start + 5s) == "the newest (and 413 more)");
  CHECK_FALSE(limit.take(start + 20s));
  limit.add("much later");
  CHECK(limit.take(start + 20s) == "much later");
}

}  // namespace ressort::rate_limit_test
