// app/control: who has sent an OSC packet, and is answered now or, by a copy, later. [any thread
// but audio]
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
  // Of a packet that came by another way than UDP, and whose answers go back there.
  using Post = std::function<void(std::vector<OscOutlet::Bytes>)>;
  OscClient(std::shared_ptr<OscOutlet> outlet, Post post)
      : outlet_(std::move(outlet)), post_(std::move(post)) {}

  void answer(const Reply& reply) const;
  // The person at this machine hears it too, once in a while.
  void error(const std::string& about, const std::string& message) const;

  // Whether an answer of many rows may begin, before anything is gathered; if not, the client has
  // been told why. The rows are all sent or none.
  bool may_have_rows(const std::string& about) const;
  void answer_rows(const std::vector<Reply>& rows) const;

  bool is_same(const OscClient& other) const {
    return !post_ && !other.post_ && sender_.address == other.sender_.address &&
           sender_.port == other.sender_.port;
  }

  OscOutlet& outlet() const { return *outlet_; }

 private:
  // Whether he is answered now; if not, he is told so once.
  bool is_heard() const;
  void send(std::vector<OscOutlet::Bytes> answers) const;

  std::shared_ptr<OscOutlet> outlet_;
  OscSender sender_;
  Post post_;  // null: answers go to the sender
};

}  // namespace ressort::control
