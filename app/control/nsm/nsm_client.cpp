#include "app/control/nsm/nsm_client.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <utility>

#include "app/control/osc/packet.h"
#include "app/control/osc/reply.h"
#include "app/control/osc/socket.h"
#include "core/model/language/expression.h"

namespace ressort::control {
namespace {

constexpr int bad_project = -4;  // Error code of the NSM API for a project that cannot be opened.
constexpr int save_failed = -11;

// Parses host and port of "osc.udp://HOST:PORT/".
Result<OscSender> address_of(const std::string& url) {
  const Error no_address{"NSM_URL is not the address of a session manager: '" + url +
                         "'; expected osc.udp://HOST:PORT/"};
  constexpr std::string_view scheme = "osc.udp://";
  if (!url.starts_with(scheme)) {
    return no_address;
  }
  std::string host = url.substr(scheme.size());
  host.resize(std::min(host.find('/'), host.size()));
  const std::size_t colon = host.rfind(':');
  double port = 0.0;
  if (colon == host.npos || !parse_number(host.substr(colon + 1), port) || port < 1.0 ||
      port > 65535.0) {
    return no_address;
  }
  host.resize(colon);
  addrinfo wanted{};
  wanted.ai_family = AF_INET;
  wanted.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(host.c_str(), nullptr, &wanted, &found) != 0 || found == nullptr) {
    return no_address;
  }
  const auto* const address = reinterpret_cast<const sockaddr_in*>(found->ai_addr);
  const OscSender manager{ntohl(address->sin_addr.s_addr), static_cast<std::uint16_t>(port)};
  freeaddrinfo(found);
  return manager;
}

const std::string* text_at(const Message& message, std::size_t i) {
  return i < message.arguments.size() ? std::get_if<std::string>(&message.arguments[i]) : nullptr;
}

}  // namespace

NsmClient::NsmClient(int socket, OscSender manager, Open open, Save save, State state)
    : socket_(socket),
      address_(manager),
      open_(std::move(open)),
      save_(std::move(save)),
      state_(std::move(state)) {}

NsmClient::~NsmClient() {
  close(socket_);
}

Result<std::unique_ptr<NsmClient>> NsmClient::announce(const std::string& url, Open open, Save save,
                                                       State state) {
  const auto manager = address_of(url);
  if (!manager) {
    return manager.error();
  }
  const bool is_here = is_this_machine((*manager).address);
  const auto socket =
      open_osc_socket({.bind_address = is_here ? "127.0.0.1" : "0.0.0.0", .port = 0, .allow = ""});
  if (!socket) {
    return socket.error();
  }
  auto client = std::unique_ptr<NsmClient>(
      new NsmClient(*socket, *manager, std::move(open), std::move(save), std::move(state)));
  client->send(Reply("/nsm/server/announce")
                   .text("ressort")
                   .text(":switch:dirty:")
                   .text("ressort")
                   .whole(1)
                   .whole(1)
                   .whole(static_cast<std::uint64_t>(getpid()))
                   .bytes());
  return client;
}

void NsmClient::poll() {
  std::vector<std::uint8_t> buffer(max_osc_packet_bytes + 1);
  while (const auto arrived = receive_packet(socket_, buffer)) {
    if (arrived->from.address != address_.address || arrived->from.port != address_.port) {
      continue;  // Ignores senders other than the manager.
    }
    const auto messages = check_packet({buffer.data(), arrived->bytes});
    if (!messages) {
      continue;
    }
    for (const OscMessage& message : *messages) {
      if (const auto said = read_message(message.bytes)) {
        handle(*said);
      }
    }
  }
  tell_state();
}

void NsmClient::tell_state() {
  const std::string state = is_open_ ? state_() : "";
  if (state.empty()) {
    return;
  }
  if (kept_.empty()) {
    kept_ = state;
  }
  if (const bool is_dirty = state != kept_; is_dirty != is_dirty_) {
    is_dirty_ = is_dirty;
    send(Reply(is_dirty ? "/nsm/client/is_dirty" : "/nsm/client/is_clean").bytes());
  }
}

void NsmClient::handle(const Message& message) {
  const std::string* const first = text_at(message, 0);
  if (message.address == "/reply" && first != nullptr && *first == "/nsm/server/announce") {
    const std::string* const name = text_at(message, 2);
    manager_ = name != nullptr ? *name : "the session manager";
  } else if (message.address == "/error" && first != nullptr && *first == "/nsm/server/announce") {
    const std::string* const why = text_at(message, 2);
    refusal_ = why != nullptr ? *why : "no reason given";
  } else if (message.address == "/nsm/client/open") {
    const std::string* const path = first;
    const std::string* const id = text_at(message, 2);
    if (path == nullptr || path->empty() || id == nullptr || id->empty()) {
      answer(message.address, Error{"expected PATH, NAME and ID"});
      return;
    }
    const auto opened = open_({*path, *id});
    is_open_ = is_open_ || opened;
    kept_ = opened ? "" : kept_;
    answer(message.address, opened);
  } else if (message.address == "/nsm/client/save") {
    const auto saved = save_();
    kept_ = saved ? "" : kept_;
    answer(message.address, saved);
  }
}

void NsmClient::answer(const std::string& address, const Result<Done>& result) {
  if (result) {
    send(Reply("/reply").text(address).text("OK").bytes());
    return;
  }
  const int code = address == "/nsm/client/save" ? save_failed : bad_project;
  send(Reply("/error").text(address).signed_whole(code).text(result.error().message).bytes());
}

void NsmClient::send(const std::vector<std::uint8_t>& bytes) const {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_addr.s_addr = htonl(address_.address);
  to.sin_port = htons(address_.port);
  // A failed send means that the manager is gone, which needs no action.
  static_cast<void>(sendto(socket_, bytes.data(), bytes.size(), MSG_DONTWAIT,
                           reinterpret_cast<const sockaddr*>(&to), sizeof to));
}

}  // namespace ressort::control
