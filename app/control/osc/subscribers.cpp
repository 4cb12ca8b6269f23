#include "app/control/osc/subscribers.h"

#include <algorithm>
#include <utility>

namespace ressort {
namespace {

// What is to be told to who knows `before`; all of it where it is of another scene.
std::vector<Reply> changes(const Session::Present& before, const Session::Present& now) {
  const bool is_other = before.loaded == nullptr || before.loaded->serial != now.loaded->serial;
  std::vector<Reply> rows;
  if (is_other) {
    rows.push_back(Reply("/loaded").text(now.loaded->name));
  }
  for (std::size_t i = 0; i < now.values.size(); ++i) {
    if (is_other || before.values[i] != now.values[i]) {
      rows.push_back(
          Reply("/param/" + now.loaded->instrument.parameters[i].name).real(now.values[i]));
    }
  }
  return rows;
}

}  // namespace

Result<Done> Subscribers::add(const OscClient& client, double lease_s, std::int64_t now_ns) {
  const auto until_ns = now_ns + static_cast<std::int64_t>(1e9 * lease_s);
  for (Subscriber& subscriber : all_) {
    if (subscriber.client.is_same(client)) {
      subscriber.until_ns = until_ns;
      return Done{};
    }
  }
  std::erase_if(all_, [&](const Subscriber& subscriber) { return subscriber.until_ns <= now_ns; });
  if (all_.size() >= most) {
    return Error{"busy: " + std::to_string(most) + " have subscribed, try again later"};
  }
  all_.push_back({client, until_ns});
  return Done{};
}

bool Subscribers::remove(const OscClient& client) {
  return std::erase_if(all_, [&](const Subscriber& subscriber) {
           return subscriber.client.is_same(client);
         }) > 0;
}

int Subscribers::tell(const Session& session, std::int64_t now_ns) {
  std::erase_if(all_, [&](const Subscriber& subscriber) { return subscriber.until_ns <= now_ns; });
  if (all_.empty()) {
    return -1;
  }
  const Session::Present now = session.present();
  std::vector<Reply> changed = changes(told_, now);
  if (const Reload reload = session.last_reload();
      std::exchange(reloads_, reload.count) != reload.count) {
    changed.push_back(Reply(reload.is_done ? "/done" : "/fail").text("/watch").text(reload.news));
  }
  for (Subscriber& subscriber : all_) {
    const std::vector<Reply> rows = subscriber.is_new ? changes({}, now) : changed;
    if (!rows.empty() && subscriber.client.may_have_rows("/subscribe")) {
      subscriber.client.answer_rows(rows);
    }
    subscriber.is_new = false;
  }
  told_ = now;
  return period_ms;
}

}  // namespace ressort
