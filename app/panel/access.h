// app/panel: access control of the panel. Pure: takes request headers, returns yes or no.
//
// A page from elsewhere in the same browser can send requests to this machine and, by rebinding its
// own name to 127.0.0.1 (DNS rebinding), read the replies. It cannot forge Host and Origin, so both
// are compared, whole, with a list of allowed values.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "app/rooms.h"

namespace ressort::panel {

class PanelAccess {
 public:
  // `hosts`: names and addresses of the panel besides those of this machine. `needs_token`:
  // requests without the token are refused.
  PanelAccess(int port, const std::vector<std::string>& hosts, std::string token, bool needs_token);

  bool is_host(std::string_view host) const;  // Value of the Host header: "127.0.0.1:9788".
  // Value of the Origin header: "http://127.0.0.1:9788".
  bool is_origin(std::string_view origin) const;
  // Compares in constant time.
  bool is_token(std::string_view token) const;
  bool needs_token() const { return needs_token_; }
  const std::string& token() const { return token_; }

 private:
  std::vector<std::string> hosts_;
  std::string token_;
  bool needs_token_;
};

// Returns 128 random bits as 32 hexadecimal digits.
std::string make_token();

// Returns the value of this cookie in a Cookie header; empty if it is missing.
std::string_view cookie_of(std::string_view header, std::string_view name);

bool is_loopback(std::string_view address);  // True for 127.0.0.1 and localhost.

}  // namespace ressort::panel
