// A libFuzzer target: after any packets the OSC server still replies and the sound continues. One
// byte gives the length of the next packet; its highest bit multiplies it by four. Only the
// program's own files are named.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <string_view>

#include "app/control/osc/server.h"
#include "app/session/session.h"
#include "tests/fuzz/player.h"

namespace {

class Sender {
 public:
  explicit Sender(int port) {
    sockaddr_in server{};
    server.sin_family = AF_INET;
    server.sin_port = htons(static_cast<std::uint16_t>(port));
    server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    ressort::fuzz::require(
        connect(socket_, reinterpret_cast<const sockaddr*>(&server), sizeof server) == 0);
  }
  ~Sender() { close(socket_); }
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;

  void send(std::span<const std::uint8_t> packet) {
    ::send(socket_, packet.data(), packet.size(), 0);
  }

  // Waits until /status is answered, skipping earlier replies; false after ten seconds of silence.
  bool is_answered() {
    static constexpr std::uint8_t status[] = {'/', 's', 't', 'a', 't', 'u', 's', 0, ',', 0, 0, 0};
    std::array<char, 65507> answer{};
    for (int tries = 0; tries < 20; ++tries) {  // The reply budget may be used up for a while.
      send(status);
      pollfd wait{socket_, POLLIN, 0};
      while (poll(&wait, 1, 500) == 1) {
        const ssize_t size = recv(socket_, answer.data(), answer.size(), 0);
        const std::string_view text(answer.data(),
                                    static_cast<std::size_t>(std::max<ssize_t>(0, size)));
        if (text.starts_with("/status.reply")) {
          return true;
        }
      }
    }
    return false;
  }

 private:
  const int socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ressort;
  using fuzz::require;
  const auto ignore = [](const std::string&) {};
  fuzz::Harness harness;
  Session session(harness.process, {.compile = {.rate_hz = fuzz::Harness::rate_hz}, .third = {}},
                  ignore);
  require(static_cast<bool>(session.load_and_wait("IPlayTheTriangle")));
  harness.block(256);
  const auto server = OscServer::open({.port = 0, .allow = ""}, harness.process, session, ignore);
  require(static_cast<bool>(server));
  std::span<const std::uint8_t> rest(data, size);
  Sender sender((*server)->port());
  while (!rest.empty()) {
    const std::size_t length = (rest[0] & 0x80) != 0 ? 4 * (rest[0] & 0x7f) : rest[0];
    sender.send(rest.subspan(1, std::min(rest.size() - 1, length)));
    rest = rest.subspan(std::min(rest.size(), 1 + length));
    harness.block(64);
  }
  require(sender.is_answered());
  harness.block(512);
  harness.block(512);
  return 0;
}
