// app/control: the strict check that stands between the network and liblo. Pure.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "app/control/message.h"
#include "core/result.h"

namespace ressort::control {

// A message of a packet and the time tag of the innermost bundle around it.
struct OscMessage {
  std::span<const std::uint8_t> bytes;  // of the whole message, within the packet
  std::uint64_t time_tag = 1;           // NTP, 1: at once
};

inline constexpr std::size_t max_osc_packet_bytes = 65507;
inline constexpr int max_osc_bundle_depth = 8;

// The messages of a packet, in order, after a check of everything in it: sizes are multiples of 4
// and add up; strings end and are padded with zeros; addresses start with '/' and are printable;
// type tags are known and their arguments are all there; bundles do not nest too deeply. Any
// fault refuses the whole packet. [any thread]
Result<std::vector<OscMessage>> check_packet(std::span<const std::uint8_t> packet);

// What a message that was checked says; nothing where an argument is neither a number nor a text.
// [any thread]
std::optional<Message> read_message(std::span<const std::uint8_t> bytes);

}  // namespace ressort::control
