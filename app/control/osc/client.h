// app/control: the sender of an OSC packet, who gets replies now or later. [any thread but audio]
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "app/control/osc/outlet.h"
#include "app/control/osc/reply.h"

namespace ressort::control {

class OscClient {
 public:
  OscClient(std::shared_ptr<OscOutlet> outlet, const OscSender& sender)
      : outlet_(std::move(outlet)), sender_(sender) {}
  // Delivers the replies to a packet that did not come by UDP.
  using Post = std::function<void(std::vector<OscOutlet::Bytes>)>;
  OscClient(std::shared_ptr<OscOutlet> outlet, Post post)
      : outlet_(std::move(outlet)), post_(std::move(post)) {}

  // Returns the same client with another port for the replies.
  OscClient at_port(std::uint16_t port) const {
    OscClient other = *this;
    other.sender_.port = port;
    return other;
  }

  void answer(const Reply& reply) const;
  // Sends an error. It is also logged for the local user, rate-limited.
  void error(const std::string& about, const std::string& message) const;

  // Returns whether a reply of many rows may begin, before the rows are collected; if not, the
  // client has got an error. All rows are sent, or none.
  bool may_have_rows(const std::string& about) const;
  void answer_rows(const std::vector<Reply>& rows) const;

  bool is_same(const OscClient& other) const {
    return !post_ && !other.post_ && sender_.address == other.sender_.address &&
           sender_.port == other.sender_.port;
  }

  OscOutlet& outlet() const { return *outlet_; }

 private:
  // Returns whether replies to this client are within the limit; if not, the client gets one
  // message.
  bool is_within_budget() const;
  void send(std::vector<OscOutlet::Bytes> answers) const;

  std::shared_ptr<OscOutlet> outlet_;
  OscSender sender_;
  Post post_;  // Null: replies go to the sender.
};

}  // namespace ressort::control
