// app/control: the UDP socket of OSC and its access list.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "app/control/osc/senders.h"
#include "core/result.h"

namespace ressort::control {

struct OscOptions {
  std::string bind_address = "127.0.0.1";
  int port = 9777;     // 0: any free port.
  int reply_port = 0;  // Port of the senders that gets the replies; 0: the one they send from.
  std::string allow;   // Remote senders that are allowed: "192.168.1.0/24,10.0.0.5".
};

// Returns the allowed senders besides this machine. If the socket is reachable from other machines
// and none is named, returns an error that explains how.
Result<std::vector<Subnet>> allowed_senders(const OscOptions& options);

// open_osc_socket() fails if the port is in use or if the address does not belong to this machine.
Result<int> open_osc_socket(const OscOptions& options);
int port_of(int socket);

// A received packet.
struct Arrival {
  OscSender from;
  std::size_t bytes = 0;  // Number of bytes in the buffer.
  // Packets that the system has dropped so far because its buffer was full.
  std::uint32_t lost = 0;
};

// Receives a packet without waiting.
std::optional<Arrival> receive_packet(int socket, std::span<std::uint8_t> buffer);

}  // namespace ressort::control
