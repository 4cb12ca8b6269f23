#include "app/control/osc/packet.h"

#include <lo/lo.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>
#include <string_view>
#include <type_traits>

namespace ressort::control {
namespace {

// lo_message is void* in liblo 0.31 and a pointer to a struct in 0.32.
using LoMessage = std::unique_ptr<std::remove_pointer_t<lo_message>, decltype(&lo_message_free)>;

using Bytes = std::span<const std::uint8_t>;
using Fault = std::optional<Error>;

constexpr std::string_view bundle_head("#bundle\0", 8);
constexpr std::size_t bundle_start = 16;  // Length of the header and the time tag.

std::uint32_t read_u32(Bytes bytes) {
  return std::uint32_t{bytes[0]} << 24 | std::uint32_t{bytes[1]} << 16 |
         std::uint32_t{bytes[2]} << 8 | std::uint32_t{bytes[3]};
}

std::uint64_t read_u64(Bytes bytes) {
  return std::uint64_t{read_u32(bytes)} << 32 | read_u32(bytes.subspan(4));
}

std::size_t padded(std::size_t size) {
  return (size + 3) / 4 * 4;
}

// Takes a padded string from the front of `left`.
Fault take_string(Bytes& left, const char* what, std::string_view& text) {
  const auto end = std::ranges::find(left, std::uint8_t{0});
  if (end == left.end()) {
    return Error{std::string(what) + " does not end within its message"};
  }
  const auto length = static_cast<std::size_t>(end - left.begin());
  const std::size_t size = padded(length + 1);
  if (size > left.size() || std::any_of(end, left.begin() + static_cast<std::ptrdiff_t>(size),
                                        [](std::uint8_t byte) { return byte != 0; })) {
    return Error{std::string(what) + " is not padded with zeros to a multiple of 4 bytes"};
  }
  text = {reinterpret_cast<const char*>(left.data()), length};
  left = left.subspan(size);
  return std::nullopt;
}

Fault take_blob(Bytes& left) {
  if (left.size() < 4) {
    return Error{"a blob's size is missing"};
  }
  // A negative size becomes a huge unsigned one.
  const std::size_t size = read_u32(left);
  left = left.subspan(4);
  if (size > left.size() || padded(size) > left.size()) {
    return Error{"a blob is longer than its message"};
  }
  const Bytes padding = left.subspan(size, padded(size) - size);
  if (std::ranges::any_of(padding, [](std::uint8_t byte) { return byte != 0; })) {
    return Error{"a blob is not padded with zeros to a multiple of 4 bytes"};
  }
  left = left.subspan(padded(size));
  return std::nullopt;
}

Fault take_argument(Bytes& left, char tag) {
  std::size_t size = 0;
  switch (tag) {
    case 'T':
    case 'F':
    case 'N':
    case 'I':
      return std::nullopt;
    case 'i':
    case 'f':
    case 'c':
    case 'r':
    case 'm':
      size = 4;
      break;
    case 'h':
    case 'd':
    case 't':
      size = 8;
      break;
    case 's':
    case 'S': {
      std::string_view text;
      return take_string(left, "a string argument", text);
    }
    case 'b':
      return take_blob(left);
    default:
      return Error{"an argument's type is not one of i f d h T F N I s S b t c r m"};
  }
  if (size > left.size()) {
    return Error{"a message has fewer arguments than type tags"};
  }
  left = left.subspan(size);
  return std::nullopt;
}

Fault check_message(Bytes left) {
  std::string_view address;
  std::string_view tags;
  if (auto fault = take_string(left, "an address", address)) {
    return fault;
  }
  if (!address.starts_with('/') ||
      std::ranges::any_of(address, [](char c) { return c < ' ' || c > '~'; })) {
    return Error{"an address must begin with '/' and be printable ASCII"};
  }
  if (left.empty()) {
    return Error{"a message has no type tags; without arguments they are a single ','"};
  }
  if (auto fault = take_string(left, "a type tag string", tags)) {
    return fault;
  }
  if (!tags.starts_with(',')) {
    return Error{"a type tag string must begin with ','"};
  }
  for (const char tag : tags.substr(1)) {
    if (auto fault = take_argument(left, tag)) {
      return fault;
    }
  }
  if (!left.empty()) {
    return Error{"a message is longer than its type tags say"};
  }
  return std::nullopt;
}

// Checks a message or a bundle with its contents; `depth` is the number of bundles around it.
Fault check_element(Bytes bytes, int depth, std::uint64_t time_tag,
                    std::vector<OscMessage>& messages) {
  if (bytes.empty() || bytes.size() % 4 != 0) {
    return Error{"a size of " + std::to_string(bytes.size()) +
                 " bytes: it must be a multiple of 4 and not 0"};
  }
  if (bytes[0] != '#') {
    messages.push_back({bytes, time_tag});
    return check_message(bytes);
  }
  if (bytes.size() < bundle_start ||
      std::memcmp(bytes.data(), bundle_head.data(), bundle_head.size()) != 0) {
    return Error{"a bundle must begin with #bundle and a time tag"};
  }
  if (depth == max_osc_bundle_depth) {
    return Error{"bundles can be nested to a depth of " + std::to_string(max_osc_bundle_depth)};
  }
  const std::uint64_t inner_tag = read_u64(bytes.subspan(bundle_head.size()));
  Bytes left = bytes.subspan(bundle_start);
  while (!left.empty()) {
    // All sizes are multiples of 4, so this one fits.
    const std::size_t size = read_u32(left);
    left = left.subspan(4);
    if (size > left.size()) {
      return Error{"an element of a bundle is longer than the bundle"};
    }
    if (auto fault = check_element(left.first(size), depth + 1, inner_tag, messages)) {
      return fault;
    }
    left = left.subspan(size);
  }
  return std::nullopt;
}

}  // namespace

Result<std::vector<OscMessage>> check_packet(std::span<const std::uint8_t> packet) {
  if (packet.size() > max_osc_packet_bytes) {
    return Error{"a packet has at most " + std::to_string(max_osc_packet_bytes) + " bytes"};
  }
  std::vector<OscMessage> messages;
  if (const auto fault = check_element(packet, 0, 1, messages)) {
    return *fault;
  }
  return messages;
}

std::optional<Message> read_message(std::span<const std::uint8_t> bytes) {
  // liblo copies the bytes before it swaps them; its parameter only lacks the const.
  const LoMessage read(
      lo_message_deserialise(const_cast<std::uint8_t*>(bytes.data()), bytes.size(), nullptr),
      lo_message_free);
  if (read == nullptr) {
    return std::nullopt;
  }
  Message message{reinterpret_cast<const char*>(bytes.data()), {}};
  const char* const types = lo_message_get_types(read.get());
  lo_arg** const values = lo_message_get_argv(read.get());
  const int count = lo_message_get_argc(read.get());
  for (int i = 0; i < count; ++i) {
    const auto type = static_cast<lo_type>(types[i]);
    message.types += types[i];
    if (lo_is_numerical_type(type)) {
      // liblo reads it, because the bytes are not aligned to 8.
      message.arguments.emplace_back(static_cast<double>(lo_hires_val(type, values[i])));
    } else if (lo_is_string_type(type)) {
      message.arguments.emplace_back(std::string(reinterpret_cast<const char*>(values[i])));
    } else if (type == LO_TRUE || type == LO_FALSE) {
      message.arguments.emplace_back(type == LO_TRUE ? 1.0 : 0.0);
    } else {
      return std::nullopt;
    }
  }
  return message;
}

}  // namespace ressort::control
