#include "app/control/osc/socket.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <system_error>

namespace ressort::control {

constexpr int receive_buffer_bytes = 1 << 20;

Result<std::vector<Subnet>> allowed_senders(const OscOptions& options) {
  const auto address = parse_subnets(options.bind_address);
  if (!address || address->size() != 1 || (*address)[0].prefix_bits != 32) {
    return Error{
        "'" + options.bind_address +
        "' is not an address that OSC can listen on; use 127.0.0.1 for this machine only, 0.0.0.0 "
        "for every network"};
  }
  auto allowed = parse_subnets(options.allow);
  if (!allowed) {
    return Error{"--osc-allow: " + allowed.error().message};
  }
  const bool is_open = !is_this_machine((*address)[0].address);
  if (is_open && allowed->empty()) {
    return Error{"-B " + options.bind_address +
                 " accepts packets from the network: name the allowed senders with --osc-allow, "
                 "such as --osc-allow "
                 "192.168.1.23 for one machine or 192.168.1.0/24 for a network"};
  }
  if (!is_open && !allowed->empty()) {
    return Error{"--osc-allow " + options.allow + " needs -B too: at " + options.bind_address +
                 " only this machine can send; -B 0.0.0.0 listens on every network"};
  }
  return allowed;
}

Result<int> open_osc_socket(const OscOptions& options) {
  if (options.port < 0 || options.port > 65535) {
    return Error{"the OSC port must lie between 0 and 65535, found " +
                 std::to_string(options.port)};
  }
  sockaddr_in address{};
  address.sin_family = AF_INET;
  inet_pton(AF_INET, options.bind_address.c_str(), &address.sin_addr);
  address.sin_port = htons(static_cast<std::uint16_t>(options.port));
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket < 0) {
    return Error{std::string("no socket for OSC: ") + std::generic_category().message(errno)};
  }
  if (bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    const int failure = errno;
    close(socket);
    const std::string place =
        "port " + std::to_string(options.port) + " of " + options.bind_address;
    return failure == EADDRINUSE
               ? Error{place + " is taken, perhaps by another ressort; choose another with -u " +
                       std::to_string(options.port % 65535 + 1)}
               : Error{"OSC cannot use " + place + ": " + std::generic_category().message(failure)};
  }
  // Enlarges the buffer for bursts. The system may grant less, so it is asked to count lost
  // packets.
  constexpr int counts = 1;
  setsockopt(socket, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes, sizeof receive_buffer_bytes);
  setsockopt(socket, SOL_SOCKET, SO_RXQ_OVFL, &counts, sizeof counts);
  return socket;
}

std::optional<Arrival> receive_packet(int socket, std::span<std::uint8_t> buffer) {
  sockaddr_in address{};
  iovec place{buffer.data(), buffer.size()};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(std::uint32_t))> control{};
  msghdr header{};
  header.msg_name = &address;
  header.msg_namelen = sizeof address;
  header.msg_iov = &place;
  header.msg_iovlen = 1;
  header.msg_control = control.data();
  header.msg_controllen = control.size();
  const ssize_t size = recvmsg(socket, &header, MSG_DONTWAIT);
  if (size < 0) {
    return std::nullopt;
  }
  Arrival arrived{{ntohl(address.sin_addr.s_addr), ntohs(address.sin_port)},
                  static_cast<std::size_t>(size)};
  for (cmsghdr* item = CMSG_FIRSTHDR(&header); item != nullptr; item = CMSG_NXTHDR(&header, item)) {
    if (item->cmsg_level == SOL_SOCKET && item->cmsg_type == SO_RXQ_OVFL) {
      std::memcpy(&arrived.lost, CMSG_DATA(item), sizeof arrived.lost);
    }
  }
  return arrived;
}

int port_of(int socket) {
  sockaddr_in address{};
  socklen_t length = sizeof address;
  getsockname(socket, reinterpret_cast<sockaddr*>(&address), &length);
  return ntohs(address.sin_port);
}

}  // namespace ressort::control
