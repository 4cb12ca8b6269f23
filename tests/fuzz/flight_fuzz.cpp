// A libFuzzer target: any bytes are read as a flight or rejected with a line and a message. A
// flight that is read and printed reads back the same.
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "app/session/flight/flight.h"
#include "tests/support/rooms.h"

namespace {

void require(bool holds) {
  if (!holds) {
    std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ressort;
  const auto flight = parse_flight({reinterpret_cast<const char*>(data), size});
  if (!flight) {
    require(!flight.error().message.empty() && flight.error().line > 0);
    return 0;
  }
  const std::string text = print_flight(*flight);
  const auto again = parse_flight(text);
  require(static_cast<bool>(again) && print_flight(*again) == text);
  return 0;
}
