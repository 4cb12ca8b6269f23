// app/control: strict validation of OSC packets before liblo reads them. Pure.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "app/control/message.h"
#include "core/result.h"

namespace ressort::control {

// A message of a packet, and the time tag of the innermost bundle around it.
struct OscMessage {
  std::span<const std::uint8_t> bytes;  // The whole message, a part of the packet.
  std::uint64_t time_tag = 1;           // NTP time; 1: immediately.
};

inline constexpr std::size_t max_osc_packet_bytes = 65507;
inline constexpr int max_osc_bundle_depth = 8;

// Validates a whole packet and returns its messages in order. Sizes must be multiples of 4 and add
// up; strings must end and be padded with zeros; addresses must start with '/' and be printable;
// type tags must be known and their arguments present; bundles must not nest too deeply. Any fault
// rejects the whole packet. [any thread]
Result<std::vector<OscMessage>> check_packet(std::span<const std::uint8_t> packet);

// Reads a validated message. Empty if an argument is neither a number nor a text. [any thread]
std::optional<Message> read_message(std::span<const std::uint8_t> bytes);

}  // namespace ressort::control
