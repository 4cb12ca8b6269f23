#include "app/panel/access.h"

#include <algorithm>
#include <random>

namespace ressort::panel {

PanelAccess::PanelAccess(int port, const std::vector<std::string>& hosts, std::string token,
                         bool needs_token)
    : token_(std::move(token)), needs_token_(needs_token) {
  const std::string suffix = ":" + std::to_string(port);
  hosts_ = {"127.0.0.1" + suffix, "localhost" + suffix, "[::1]" + suffix};
  for (const std::string& host : hosts) {
    hosts_.push_back(host + suffix);
  }
}

bool PanelAccess::is_host(std::string_view host) const {
  return std::ranges::find(hosts_, host) != hosts_.end();
}

bool PanelAccess::is_origin(std::string_view origin) const {
  constexpr std::string_view scheme = "http://";
  return origin.starts_with(scheme) && is_host(origin.substr(scheme.size()));
}

bool PanelAccess::is_token(std::string_view token) const {
  unsigned difference = token.size() == token_.size() ? 0 : 1;
  for (std::size_t i = 0; i < token_.size(); ++i) {
    const char other = i < token.size() ? token[i] : '\0';
    difference |= static_cast<unsigned char>(token_[i] ^ other);
  }
  return difference == 0;
}

std::string make_token() {
  constexpr std::string_view digits = "0123456789abcdef";
  std::random_device random;
  std::string token;
  for (int word = 0; word < 4; ++word) {
    for (unsigned bits = random(), i = 0; i < 8; ++i, bits >>= 4) {
      token += digits[bits & 15];
    }
  }
  return token;
}

std::string_view cookie_of(std::string_view header, std::string_view name) {
  while (!header.empty()) {
    const std::size_t end = std::min(header.find(';'), header.size());
    std::string_view pair = header.substr(0, end);
    header.remove_prefix(std::min(end + 1, header.size()));
    pair.remove_prefix(std::min(pair.find_first_not_of(' '), pair.size()));
    if (pair.starts_with(name) && pair.substr(name.size()).starts_with('=')) {
      return pair.substr(name.size() + 1);
    }
  }
  return {};
}

bool is_loopback(std::string_view address) {
  return address == "localhost" || address == "127.0.0.1";
}

}  // namespace ressort::panel
