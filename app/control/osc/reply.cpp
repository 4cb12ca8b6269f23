#include "app/control/osc/reply.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace ressort {
namespace {

constexpr std::size_t max_text_bytes = 4096;
constexpr std::int32_t most_whole = std::numeric_limits<std::int32_t>::max();

void put(std::vector<std::uint8_t>& bytes, std::uint64_t value, int size) {
  for (int shift = 8 * (size - 1); shift >= 0; shift -= 8) {
    bytes.push_back(static_cast<std::uint8_t>(value >> shift));
  }
}

// With one to four zeros after it.
void put(std::vector<std::uint8_t>& bytes, std::string_view text) {
  bytes.insert(bytes.end(), text.begin(), text.end());
  bytes.resize(bytes.size() / 4 * 4 + 4);
}

}  // namespace

Reply& Reply::text(std::string_view text) {
  types_ += 's';
  put(values_, text.substr(0, std::min(max_text_bytes, text.find('\0'))));
  return *this;
}

Reply& Reply::whole(std::uint64_t count) {
  types_ += 'i';
  put(values_, std::min<std::uint64_t>(count, most_whole), 4);
  return *this;
}

Reply& Reply::real(double value) {
  types_ += 'f';
  put(values_, std::bit_cast<std::uint32_t>(static_cast<float>(value)), 4);
  return *this;
}

Reply& Reply::precise(double value) {
  types_ += 'd';
  put(values_, std::bit_cast<std::uint64_t>(value), 8);
  return *this;
}

Reply& Reply::argument(const Argument& same) {
  if (const std::string* const word = std::get_if<std::string>(&same)) {
    return text(*word);
  }
  const double value = std::get<double>(same);
  if (value == std::rint(value) && std::fabs(value) <= most_whole) {
    types_ += 'i';
    put(values_, static_cast<std::uint32_t>(static_cast<std::int32_t>(value)), 4);
    return *this;
  }
  return precise(value);
}

std::vector<std::uint8_t> Reply::bytes() const {
  std::vector<std::uint8_t> bytes;
  put(bytes, std::string_view(address_));
  put(bytes, std::string_view(types_));
  bytes.insert(bytes.end(), values_.begin(), values_.end());
  return bytes;
}

}  // namespace ressort
