// A libFuzzer target: the packet check never reads out of bounds, and neither does liblo
// afterwards.
#include <lo/lo.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "app/control/osc/packet.h"
#include "tests/support/rooms.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto messages = ressort::check_packet({data, size});
  if (!messages) {
    return 0;
  }
  std::size_t touched = 0;
  for (const ressort::OscMessage& message : *messages) {
    // A separate copy, so that the sanitizer detects a read past the end.
    std::vector<std::uint8_t> bytes(message.bytes.begin(), message.bytes.end());
    const lo_message read = lo_message_deserialise(bytes.data(), bytes.size(), nullptr);
    if (read == nullptr) {
      // liblo accepts whatever passes the check, except colours and blobs that it finds too large.
      const bool may_refuse = bytes.size() > 32768 || std::count(bytes.begin(), bytes.end(), 'r');
      if (!may_refuse) {
        std::abort();
      }
      continue;
    }
    const char* const types = lo_message_get_types(read);
    const lo_arg* const* const values = lo_message_get_argv(read);
    for (int i = 0; i < lo_message_get_argc(read); ++i) {
      if (types[i] == LO_STRING || types[i] == LO_SYMBOL) {
        touched += std::strlen(reinterpret_cast<const char*>(values[i]));
      }
    }
    lo_message_free(read);
  }
  if (touched > size) {
    std::abort();
  }
  return 0;
}
