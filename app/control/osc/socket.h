// app/control: the UDP socket of OSC, and who may send to it.
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
  int port = 9777;    // 0: any that is free
  std::string allow;  // who may send from elsewhere: "192.168.1.0/24,10.0.0.5"
};

// Who may send besides this machine. Where others can, somebody has to be named: else it is an
// error that says how.
Result<std::vector<Subnet>> allowed_senders(const OscOptions& options);

// Fails where the port is taken, or the address is none of this machine's.
Result<int> open_osc_socket(const OscOptions& options);
int port_of(int socket);

// A packet that has come.
struct Arrival {
  OscSender from;
  std::size_t bytes = 0;   // of the buffer
  std::uint32_t lost = 0;  // so many the system had lost for want of room, in all
};

// Does not wait.
std::optional<Arrival> receive_packet(int socket, std::span<std::uint8_t> buffer);

}  // namespace ressort::control
