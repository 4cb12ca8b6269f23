// A libFuzzer target: after any request the page is still served and the sound continues. The first
// byte selects how much of a valid request surrounds the data: nothing, the host, or all but a
// body.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <string>
#include <string_view>

#include "app/panel/panel.h"
#include "tests/fuzz/player.h"

namespace {

using namespace ressort;

// One program for all requests, as for a browser.
struct Stage {
  Stage() {
    session.on_engine(
        [this](Engine& engine, const Network& network) { return feed.watch(engine, network); });
    fuzz::require(static_cast<bool>(session.load_and_wait("IPlayTheTriangle")));
    auto opened = OscServer::open_without_udp(harness.process, session, [](const std::string&) {});
    fuzz::require(static_cast<bool>(opened));
    osc = *std::move(opened);
    auto made = WebPanel::open({.port = 0}, harness.process, session, feed, *osc);
    fuzz::require(static_cast<bool>(made));
    panel = *std::move(made);
    const std::string address = panel->address();
    host = address.substr(7, address.find("/?") - 7);
  }

  fuzz::Harness harness;
  Session session{harness.process,
                  {.compile = {.rate_hz = fuzz::Harness::rate_hz}, .third = {}},
                  [](const std::string&) {}};
  MotionFeed feed{harness.process};
  std::unique_ptr<OscServer> osc;
  std::unique_ptr<WebPanel> panel;
  std::string host;
};

// Returns the first kilobytes of the reply. An incomplete request gets none, and is not waited for.
std::string ask(const Stage& stage, std::string_view request, bool is_whole) {
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in server{};
  server.sin_family = AF_INET;
  server.sin_port =
      htons(static_cast<std::uint16_t>(std::stoi(stage.host.substr(stage.host.find(':') + 1))));
  server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const timeval patience{is_whole ? 20 : 0, is_whole ? 0 : 30'000};
  setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  fuzz::require(connect(socket, reinterpret_cast<const sockaddr*>(&server), sizeof server) == 0);
  send(socket, request.data(), request.size(), MSG_NOSIGNAL);
  std::string answer;
  std::array<char, 4096> bytes{};
  for (ssize_t got = 0;
       answer.size() < 8192 && (got = recv(socket, bytes.data(), bytes.size(), 0)) > 0;) {
    answer.append(bytes.data(), static_cast<std::size_t>(got));
  }
  close(socket);
  return answer;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Stage& stage = *new Stage();  // Its threads live as long as the program.
  if (size == 0) {
    return 0;
  }
  const std::string rest(reinterpret_cast<const char*>(data) + 1, size - 1);
  const std::string host = "Host: " + stage.host + "\r\n";
  std::string request = rest;
  if (data[0] % 3 == 1) {  // The request line, the host, and the data.
    const std::size_t line = std::min(rest.find('\n'), rest.size());
    request = rest.substr(0, line) + " HTTP/1.1\r\n" + host +
              rest.substr(std::min(line + 1, rest.size())) + "\r\n\r\n";
  } else if (data[0] % 3 == 2) {
    request =
        "POST /osc HTTP/1.1\r\n" + host +
        "Content-Type: application/octet-stream\r\nContent-Length: " + std::to_string(rest.size()) +
        "\r\n\r\n" + rest;
  }
  const bool is_packet = data[0] % 3 == 2;
  const std::string answer = ask(stage, request, is_packet);
  fuzz::require(!is_packet || answer.starts_with("HTTP/1.1 200"));
  stage.harness.block(256);
  fuzz::require(
      ask(stage, "GET /icon.svg HTTP/1.1\r\n" + host + "\r\n", true).starts_with("HTTP/1.1 200"));
  return 0;
}
