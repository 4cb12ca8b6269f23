#include "app/control/osc/server.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <future>
#include <iterator>
#include <map>
#include <mutex>
#include <system_error>
#include <thread>

#include "app/control/osc/client.h"
#include "app/control/osc/packet.h"
#include "app/control/osc/senders.h"
#include "app/control/osc/subscribers.h"
#include "app/control/osc/time_tags.h"
#include "app/control/registry.h"
#include "app/devices/audio.h"
#include "app/realtime/rate_limit.h"
#include "app/text.h"
#include "core/model/language/expression.h"
#include "core/ranges.h"

namespace ressort::control {
namespace {

constexpr std::size_t max_address_bytes = 255;
constexpr int max_malformed_answers = 10;  // Per second.
constexpr std::size_t max_bundle_events = std::min(Process::max_now, Process::max_ahead);
constexpr std::int64_t second_ns = 1'000'000'000;

}  // namespace

// --- the server ---------------------------------------------------------------------------------

struct OscServer::Server {
  // The playing messages with one time tag.
  struct Group {
    std::string address;  // Address of the first.
    std::vector<TimedEvent> events;
    // Pairs of address and message, sent when the group acts.
    std::vector<std::pair<std::string, std::string>> news;
  };
  using Groups = std::map<std::uint64_t, Group>;  // Keyed by time tag.

  // A packet that did not come by UDP, and the receiver of its replies.
  struct Asked {
    std::vector<std::uint8_t> packet;
    OscClient::Post answer;
    std::promise<void> done;
  };

  Server(Process& process_in, Session& session_in, int socket_in, int wake_in,
         std::vector<Subnet> allowed_in, int reply_port_in, OscOutlet::Log log)
      : process(process_in),
        session(session_in),
        socket(socket_in),
        wake(wake_in),
        allowed(std::move(allowed_in)),
        reply_port(reply_port_in),
        outlet(std::make_shared<OscOutlet>(socket_in, std::move(log))),
        thread([this] { run(); }) {}

  ~Server() {
    is_ending.raise();
    eventfd_write(wake, 1);
    thread.join();
    outlet->close();
    close(wake);
  }

  void run() {
    std::vector<std::uint8_t> buffer(max_osc_packet_bytes + 1);
    std::array<pollfd, 2> waits{{{socket, POLLIN, 0}, {wake, POLLIN, 0}}};
    while (true) {
      const int due_ms = outlet->send_due();
      const int changes_ms = subscribers.send_changes(session, monotonic_ns());
      const int wait_ms =
          due_ms < 0 || (changes_ms >= 0 && changes_ms < due_ms) ? changes_ms : due_ms;
      if (poll(waits.data(), waits.size(), wait_ms) < 0) {
        continue;  // Interrupted by a signal.
      }
      if (waits[1].revents != 0) {
        eventfd_t count = 0;
        eventfd_read(wake, &count);
        if (is_ending.is_raised()) {
          answer_asked();
          return;
        }
      }
      answer_asked();
      if (waits[0].revents == 0) {
        continue;
      }
      if (const auto arrived = receive_packet(socket, buffer)) {
        count_lost(arrived->lost);
        const OscClient sender{outlet, arrived->from};
        const OscClient client =
            reply_port > 0 ? sender.at_port(static_cast<std::uint16_t>(reply_port)) : sender;
        if (may_send(allowed, arrived->from.address)) {
          outlet->received(arrived->from, arrived->bytes);
          receive({buffer.data(), arrived->bytes}, client);
        } else {
          count_stranger(arrived->from);
        }
      }
    }
  }

  void answer_asked() {
    std::vector<Asked> now;
    {
      const std::lock_guard lock(asked_mutex);
      now.swap(asked);
    }
    for (Asked& one : now) {
      receive(one.packet, OscClient(outlet, one.answer));
      one.done.set_value();
    }
  }

  void count_lost(std::uint32_t lost_in_all) {
    // The counter wraps around, and a packet received before the last loss has an older count.
    if (const std::uint32_t more = lost_in_all - lost; more < 1u << 31) {
      lost = lost_in_all;
      process.dropped.add(more);
    }
  }

  void count_stranger(const OscSender& from) {
    const std::string address = print_address(from.address);
    process.strangers.add(1);
    strangers.add("OSC: a packet from " + address + " was ignored; --osc-allow " + address +
                  " lets it in");
    if (const auto news = strangers.take()) {
      outlet->log(*news);
    }
  }

  void receive(std::span<const std::uint8_t> packet, const OscClient& client) {
    const auto messages = check_packet(packet);
    if (!messages) {
      if (may_answer_malformed()) {
        client.error("", messages.error().message);
      }
      return;
    }
    Groups groups;
    std::vector<Message> queries;
    for (const OscMessage& message : *messages) {
      const char* const address = reinterpret_cast<const char*>(message.bytes.data());
      if (std::strlen(address) > max_address_bytes) {
        client.error("",
                     "an address has at most " + std::to_string(max_address_bytes) + " characters");
      } else if (is_answer(address)) {
        continue;
      } else if (const auto said = read_message(message.bytes)) {
        // 0 is not in the standard, but some programs send it for "immediately".
        const auto loaded = session.current();
        for (const std::string& meant : addresses_meant(said->address, loaded->instrument)) {
          Message one = *said;
          one.address = meant;
          if (is_query(one)) {
            queries.push_back(std::move(one));
          } else {
            add(one, *loaded, groups[std::max<std::uint64_t>(1, message.time_tag)], client);
          }
        }
      } else {
        client.error(address, "arguments are numbers (i f d h T F) or texts (s S)");
      }
    }
    for (auto& [time_tag, group] : groups) {
      play(time_tag, group, client);
    }
    // They are answered last, with the values that the bundle has set.
    for (const Message& message : queries) {
      const auto [row, name] = find_row(message.address);
      row->answer({message, name, session, client, subscribers});
    }
  }

  static bool is_query(const Message& message) {
    const Row* const row = find_row(message.address).row;
    return row != nullptr && row->answer != nullptr &&
           (row->play == nullptr || message.arguments.empty());
  }

  // Limits replies to malformed packets, whose sender address may be forged.
  bool may_answer_malformed() {
    const std::int64_t second = monotonic_ns() / second_ns;
    if (second != malformed_second) {
      malformed_second = second;
      malformed_answers = 0;
    }
    return ++malformed_answers <= max_malformed_answers;
  }

  // Adds the events of a playing message to the group of its time tag.
  void add(const Message& message, const Loaded& loaded, Group& group, const OscClient& client) {
    const Events events = to_events(message, loaded.instrument, loaded.serial);
    if (!events) {
      client.error(message.address, events.error().message);
      return;
    }
    if (group.address.empty()) {
      group.address = message.address;
    }
    if (group.events.size() + events->size() > max_bundle_events) {
      client.error(message.address,
                   "a bundle may have at most " + std::to_string(max_bundle_events) + " events");
      return;
    }
    for (const Event& event : *events) {
      group.events.push_back({.event = event});
      if (const std::string news = describe_limit(message, event, loaded.instrument);
          !news.empty()) {
        group.news.emplace_back(message.address, news);
      }
    }
  }

  void play(std::uint64_t time_tag, Group& group, const OscClient& client) {
    if (group.events.empty()) {
      return;
    }
    double late_s = 0.0;
    TimedEvent timed;
    if (time_tag > 1) {
      const ClockReading clock = process.clock.read();
      // A block that ended long ago does not predict the next one's time.
      if (clock.rate_hz <= 0.0 || monotonic_ns() - clock.time_ns > second_ns) {
        client.error(group.address, "no audio is running: time tags cannot be converted to frames");
        return;
      }
      tags.follow_wall_clock();
      const double ahead_s = seconds_between(tags.now(clock), time_tag);
      if (ahead_s > tag_horizon_s) {
        client.error(group.address, "the time tag is " + seconds_text(ahead_s) +
                                        " s ahead; at most " + print_number(tag_horizon_s) +
                                        " s are kept");
        return;
      }
      timed.timing = TimedEvent::When::at_frame;
      timed.when = tags.frame(time_tag, clock);
      // The newest block already has its events, so a late event acts at the start of the next
      // block and counts as late.
      late_s = static_cast<double>(clock.frame + clock.period - timed.when) / clock.rate_hz;
    }
    for (TimedEvent& event : group.events) {
      event.timing = timed.timing;
      event.when = timed.when;
    }
    const bool is_ahead = timed.timing == TimedEvent::When::at_frame;
    if (is_ahead ? !process.send_ahead(group.events)
                 : !process.send(process.from_osc, group.events)) {
      const std::string events = counted(group.events.size(), "event", "events");
      client.error(group.address,
                   is_ahead ? "refused whole: " + std::to_string(Process::max_ahead) +
                                  " events can wait for their time; there is no room for " +
                                  events + " more; try again later"
                            : "busy: no room for " + events + ", try again");
      return;
    }
    session.remember(group.events);
    for (const auto& [address, news] : group.news) {
      client.error(address, news);
    }
    if (late_s > 0.0) {
      lates.add("late by " + seconds_text(late_s) + " s, executed now");
      if (const auto news = lates.take()) {
        client.error(group.address, *news);
      }
    }
  }

  static std::string seconds_text(double seconds) {
    return print_number(std::round(seconds * 1e4) / 1e4);
  }

  Process& process;
  Session& session;
  const int socket;  // Owned by the outlet, which closes it after the thread has ended.
  const int wake;
  const std::vector<Subnet> allowed;
  const int reply_port;  // 0: the sender's.
  std::shared_ptr<OscOutlet> outlet;
  TagClock tags;
  Subscribers subscribers;
  RateLimit lates{std::chrono::seconds(1)};
  std::int64_t malformed_second = 0;
  int malformed_answers = 0;
  std::uint32_t lost = 0;  // Packets lost, as counted by the system.
  RateLimit strangers;
  Flag is_ending;
  std::mutex asked_mutex;
  std::vector<Asked> asked;  // Protected by the mutex.
  std::thread thread;        // Last member: everything else exists when it starts.
};

OscServer::OscServer(std::unique_ptr<Server> server) : server_(std::move(server)) {}
OscServer::~OscServer() = default;

Result<std::unique_ptr<OscServer>> OscServer::open(const OscOptions& options, Process& process,
                                                   Session& session, Log log) {
  const auto allowed = allowed_senders(options);
  if (!allowed) {
    return allowed.error();
  }
  const auto socket = open_osc_socket(options);
  if (!socket) {
    return socket.error();
  }
  const int wake = eventfd(0, EFD_CLOEXEC);
  if (wake < 0) {
    const std::string reason = std::generic_category().message(errno);
    close(*socket);
    return Error{"OSC cannot start: " + reason};
  }
  return std::unique_ptr<OscServer>(new OscServer(std::make_unique<Server>(
      process, session, *socket, wake, *allowed, options.reply_port, std::move(log))));
}

Result<std::unique_ptr<OscServer>> OscServer::open_without_udp(Process& process, Session& session,
                                                               Log log) {
  const int wake = eventfd(0, EFD_CLOEXEC);
  if (wake < 0) {
    return Error{"OSC cannot start: " + std::generic_category().message(errno)};
  }
  return std::unique_ptr<OscServer>(new OscServer(std::make_unique<Server>(
      process, session, -1, wake, std::vector<Subnet>(), 0, std::move(log))));
}

OscServer::Packets OscServer::ask(std::vector<std::uint8_t> packet,
                                  std::function<void(Packets)> later) {
  struct Mailbox {
    std::mutex mutex;
    Packets answers;
    bool is_collected = false;
  };
  const auto mailbox = std::make_shared<Mailbox>();
  Server::Asked asked{.packet = std::move(packet), .answer = [mailbox, later](Packets answers) {
                        {
                          const std::lock_guard lock(mailbox->mutex);
                          if (!mailbox->is_collected) {
                            std::move(answers.begin(), answers.end(),
                                      std::back_inserter(mailbox->answers));
                            return;
                          }
                        }
                        later(std::move(answers));
                      }};
  std::future<void> done = asked.done.get_future();
  {
    const std::lock_guard lock(server_->asked_mutex);
    server_->asked.push_back(std::move(asked));
  }
  eventfd_write(server_->wake, 1);
  done.wait();
  const std::lock_guard lock(mailbox->mutex);
  mailbox->is_collected = true;
  return std::move(mailbox->answers);
}

bool OscServer::listens_on_udp() const {
  return server_->socket >= 0;
}

std::string OscServer::access() const {
  const std::string others = joined(server_->allowed, ", ", print_subnet);
  return others.empty() ? "accessible from this machine only"
                        : "accessible from this machine and " + others;
}

int OscServer::port() const {
  return port_of(server_->socket);
}

}  // namespace ressort::control
