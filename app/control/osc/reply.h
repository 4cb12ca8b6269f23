// app/control: builds an OSC message: big-endian, padded to four bytes. Pure.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "app/control/message.h"

namespace ressort::control {

class Reply {
 public:
  static constexpr std::size_t max_text_bytes = 4096;
  static constexpr std::int32_t most_whole = std::numeric_limits<std::int32_t>::max();

  explicit Reply(std::string_view address) { put(address_, address); }

  Reply& text(std::string_view text) {
    put(values_, text.substr(0, std::min(max_text_bytes, text.find('\0'))));
    return typed('s');
  }
  Reply& whole(std::uint64_t count) {
    return word('i', std::min<std::uint64_t>(count, most_whole));
  }
  Reply& signed_whole(std::int32_t value) { return word('i', static_cast<std::uint32_t>(value)); }
  Reply& real(double value) {
    return word('f', std::bit_cast<std::uint32_t>(static_cast<float>(value)));
  }
  Reply& precise(double value) {
    put(values_, std::bit_cast<std::uint64_t>(value), 8);
    return typed('d');
  }
  // Adds an argument in its original type.
  Reply& argument(const Argument& argument) {
    if (const std::string* const word = std::get_if<std::string>(&argument)) {
      return text(*word);
    }
    const double value = std::get<double>(argument);
    return value == std::rint(value) && std::fabs(value) <= most_whole
               ? word('i', static_cast<std::uint32_t>(static_cast<std::int32_t>(value)))
               : precise(value);
  }

  std::vector<std::uint8_t> bytes() const {
    std::vector<std::uint8_t> all = address_;
    put(all, types_);
    all.insert(all.end(), values_.begin(), values_.end());
    return all;
  }

 private:
  using Bytes = std::vector<std::uint8_t>;

  static void put(Bytes& bytes, std::uint64_t value, int size) {
    for (int shift = 8 * (size - 1); shift >= 0; shift -= 8) {
      bytes.push_back(static_cast<std::uint8_t>(value >> shift));
    }
  }
  // Adds one to four zeros after the text.
  static void put(Bytes& bytes, std::string_view text) {
    bytes.insert(bytes.end(), text.begin(), text.end());
    bytes.resize(bytes.size() / 4 * 4 + 4);
  }
  Reply& word(char type, std::uint64_t value) {
    put(values_, value, 4);
    return typed(type);
  }
  Reply& typed(char type) {
    types_ += type;
    return *this;
  }

  Bytes address_;
  std::string types_ = ",";
  Bytes values_;
};

}  // namespace ressort::control
