// app: an OSC message as it is written: big-endian, everything padded to four bytes. Pure.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "app/control/message.h"

namespace ressort {

class Reply {
 public:
  explicit Reply(std::string address) : address_(std::move(address)) {}

  Reply& text(std::string_view text);     // s: at most 4096 bytes, to the first zero
  Reply& whole(std::uint64_t count);      // i: at most what fits
  Reply& real(double value);              // f
  Reply& precise(double value);           // d
  Reply& argument(const Argument& same);  // as it came

  std::vector<std::uint8_t> bytes() const;

 private:
  std::string address_;
  std::string types_ = ",";
  std::vector<std::uint8_t> values_;
};

}  // namespace ressort
