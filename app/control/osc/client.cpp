#include "app/control/osc/client.h"

#include <cmath>

#include "core/model/language/expression.h"
#include "core/ranges.h"

namespace ressort::control {

void OscClient::send(std::vector<OscOutlet::Bytes> answers) const {
  if (post_) {
    post_(std::move(answers));
  } else {
    outlet_->answer(sender_, std::move(answers));
  }
}

bool OscClient::is_within_budget() const {
  if (post_ || outlet_->may_answer(sender_)) {
    return true;
  }
  if (const double pause_s = outlet_->reply_pause_s(sender_); pause_s > 0.0) {
    const double ms = std::ceil(1e3 * pause_s);
    outlet_->answer(sender_, {Reply("/error")
                                  .text("")
                                  .text("too many queries: no replies for " + print_number(ms) +
                                        " ms; notes are still played")
                                  .bytes()});
  }
  return false;
}

void OscClient::answer(const Reply& reply) const {
  if (is_within_budget()) {
    send({reply.bytes()});
  }
}

void OscClient::error(const std::string& about, const std::string& message) const {
  answer(Reply("/error").text(about).text(message));
  outlet_->log_failure("OSC: " + (message.starts_with(about) ? "" : about + ": ") + message);
}

bool OscClient::may_have_rows(const std::string& about) const {
  if (!is_within_budget()) {
    return false;
  }
  if (!outlet_->has_room()) {
    error(about, "busy: too many replies are pending; try again");
    return false;
  }
  return true;
}

void OscClient::answer_rows(const std::vector<Reply>& rows) const {
  send(mapped(rows, &Reply::bytes));
}

}  // namespace ressort::control
