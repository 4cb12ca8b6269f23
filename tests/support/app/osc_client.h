// tests: a client of the OSC server.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <optional>
#include <vector>

#include "app/control/osc/packet.h"
#include "app/control/osc/socket.h"
#include "tests/support/app/osc_bytes.h"
#include "tests/support/catch.h"
#include "tests/support/rooms.h"

namespace ressort {

class Client {
 public:
  explicit Client(int port, std::uint32_t address = INADDR_LOOPBACK)
      : socket_(socket(AF_INET, SOCK_DGRAM, 0)) {
    turn_to(port, address);
  }
  // Exchanges packets with this server from now on.
  void turn_to(int port, std::uint32_t address = INADDR_LOOPBACK) {
    sockaddr_in server{};
    server.sin_family = AF_INET;
    server.sin_port = htons(static_cast<std::uint16_t>(port));
    server.sin_addr.s_addr = htonl(address);
    REQUIRE(connect(socket_, reinterpret_cast<const sockaddr*>(&server), sizeof server) == 0);
  }
  ~Client() { close(socket_); }

  // Returns the port from which it sends.
  int port() const { return port_of(socket_); }

  void send(const Bytes& bytes) {
    REQUIRE(::send(socket_, bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size()));
  }

  // Returns the next reply; empty after a wait far longer than any reply takes.
  std::optional<Answer> receive(int most_ms = 20000) {
    pollfd wait{socket_, POLLIN, 0};
    if (poll(&wait, 1, most_ms) != 1) {
      return std::nullopt;
    }
    Bytes bytes(max_osc_packet_bytes);
    const ssize_t size = recv(socket_, bytes.data(), bytes.size(), 0);
    if (size <= 0) {
      return std::nullopt;
    }
    bytes.resize(static_cast<std::size_t>(size));
    bytes_received += bytes.size();
    REQUIRE(check_packet(bytes));  // Sent packets must pass the strict check, too.
    return read_answer(bytes);
  }

  Answer ask(const Bytes& bytes) {
    send(bytes);
    const auto answer = receive();
    REQUIRE(answer);
    return *answer;
  }

  // Waits until the server has processed everything sent; returns the earlier replies.
  std::vector<Answer> sync() {
    std::vector<Answer> before;
    for (int tries = 0; tries < 40; ++tries) {  // Packets sent into a full buffer are lost.
      send(message("/status"));
      while (auto answer = receive(500)) {
        if (answer->address == "/status.reply") {
          return before;
        }
        before.push_back(*std::move(answer));
      }
    }
    FAIL("the server does not answer");
    return before;
  }

  std::size_t bytes_received = 0;

 private:
  int socket_;
};

}  // namespace ressort
