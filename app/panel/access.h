// app/panel: who may see the panel. Pure: what a browser says goes in, yes or no comes out.
//
// A page from elsewhere, open in the same browser, can send requests to this machine and, by
// rebinding its own name to 127.0.0.1, read the answers. What it cannot do is send another Host and
// Origin than its own: so both are compared, whole, with a list of ours.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "app/rooms.h"

namespace ressort::panel {

class PanelAccess {
 public:
  // `hosts`: names and addresses that the panel is called by, besides this machine's own.
  // `needs_token`: whoever does not know it is refused.
  PanelAccess(int port, const std::vector<std::string>& hosts, std::string token, bool needs_token);

  bool is_host(std::string_view host) const;      // "127.0.0.1:9788", as it stands in Host
  bool is_origin(std::string_view origin) const;  // "http://127.0.0.1:9788"
  // Takes as long whatever is wrong with it.
  bool is_token(std::string_view token) const;
  bool needs_token() const { return needs_token_; }
  const std::string& token() const { return token_; }

 private:
  std::vector<std::string> hosts_;
  std::string token_;
  bool needs_token_;
};

// 128 random bits as 32 digits.
std::string make_token();

// What a cookie of this name says, in a Cookie header; empty if it is not there.
std::string_view cookie_of(std::string_view header, std::string_view name);

bool is_loopback(std::string_view address);  // "127.0.0.1", "localhost"

}  // namespace ressort::panel
