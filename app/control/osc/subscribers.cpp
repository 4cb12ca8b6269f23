#include "app/control/osc/subscribers.h"

#include <algorithm>
#include <utility>

namespace ressort::control {
namespace {

// Returns the messages that bring a client from the state `before` to `now`: everything if the
// scene has changed.
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
  for (std::size_t i = 0; i < now.knobs.size(); ++i) {
    if (is_other || before.knobs[i] != now.knobs[i]) {
      rows.push_back(Reply(now.loaded->instrument.knobs[i].address()).real(now.knobs[i]));
    }
  }
  return rows;
}

}  // namespace

Result<Done> Subscribers::add(const OscClient& client, News news, double lease_s,
                              std::int64_t now_ns) {
  const auto until_ns = now_ns + static_cast<std::int64_t>(1e9 * lease_s);
  for (Subscriber& subscriber : all_) {
    if (subscriber.news == news && subscriber.client.is_same(client)) {
      subscriber.until_ns = until_ns;
      return Done{};
    }
  }
  std::erase_if(all_, [&](const Subscriber& subscriber) { return subscriber.until_ns <= now_ns; });
  if (all_.size() >= most) {
    return Error{"busy: " + std::to_string(most) + " have subscribed, try again later"};
  }
  all_.push_back({client, news, until_ns});
  return Done{};
}

bool Subscribers::remove(const OscClient& client) {
  return std::erase_if(all_, [&](const Subscriber& subscriber) {
           return subscriber.client.is_same(client);
         }) > 0;
}

int Subscribers::send_changes(Session& session, std::int64_t now_ns) {
  std::erase_if(all_, [&](const Subscriber& subscriber) { return subscriber.until_ns <= now_ns; });
  const auto wants = [&](News news) {
    return std::ranges::any_of(
        all_, [&](const Subscriber& subscriber) { return subscriber.news == news; });
  };
  if (wants(News::changes)) {
    tell_changes(session);
  }
  if (wants(News::timbre)) {
    tell_timbre(session.timbre());
  }
  return all_.empty() ? -1 : period_ms;
}

void Subscribers::tell_changes(const Session& session) {
  const Session::Present now = session.present();
  std::vector<Reply> changed = changes(told_, now);
  if (const Reload reload = session.last_reload();
      std::exchange(reloads_, reload.count) != reload.count) {
    changed.push_back(Reply(reload.is_done ? "/done" : "/fail").text("/watch").text(reload.news));
  }
  for (Subscriber& subscriber : all_) {
    if (subscriber.news == News::changes) {
      const std::vector<Reply> rows = subscriber.is_new ? changes({}, now) : changed;
      if (!rows.empty() && subscriber.client.may_have_rows("/subscribe")) {
        subscriber.client.answer_rows(rows);
      }
      subscriber.is_new = false;
    }
  }
  told_ = now;
}

void Subscribers::tell_timbre(const TimbreWatch& timbre) {
  const auto frames = timbre.since(told_frame_);
  if (frames.empty()) {
    return;
  }
  told_frame_ = frames.back().number;
  const std::size_t figures = figure_number("inharmonicity");  // Sends the figures before this one.
  std::vector<Reply> rows;
  for (const TimbreWatch::Heard& heard : frames) {
    Reply& row = rows.emplace_back("/timbre.frame").whole(heard.number);
    for (std::size_t i = 0; i < figures; ++i) {
      row.real(timbre_figures()[i].of(heard.timbre).value_or(0.0));
    }
  }
  for (const Subscriber& subscriber : all_) {
    if (subscriber.news == News::timbre && subscriber.client.may_have_rows("/timbre")) {
      subscriber.client.answer_rows(rows);
    }
  }
}

}  // namespace ressort::control
