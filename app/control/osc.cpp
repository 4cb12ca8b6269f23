#include "app/control/osc.h"

#include <lo/lo.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>
#include <thread>

#include "app/control/osc_outlet.h"
#include "app/control/osc_packet.h"
#include "app/control/osc_senders.h"
#include "app/control/time_tags.h"
#include "app/devices/audio.h"
#include "app/realtime/rate_limit.h"
#include "app/text.h"
#include "core/model/language/expression.h"

namespace ressort {
namespace {

constexpr std::size_t max_address_bytes = 255;
constexpr std::size_t max_text_bytes = 4096;  // of one string of an answer
constexpr int max_malformed_answers = 10;     // in a second
constexpr std::size_t max_bundle_events = std::min(Process::max_now, Process::max_ahead);
constexpr std::int64_t second_ns = 1'000'000'000;

// --- messages -----------------------------------------------------------------------------------

using Message = std::unique_ptr<void, decltype(&lo_message_free)>;

// What a message says; nothing where an argument is neither a number nor a text.
std::optional<Call> read_call(std::span<const std::uint8_t> bytes) {
  // liblo copies the bytes before it turns them; it only lacks the const.
  const Message message(
      lo_message_deserialise(const_cast<std::uint8_t*>(bytes.data()), bytes.size(), nullptr),
      lo_message_free);
  if (message == nullptr) {
    return std::nullopt;
  }
  Call call{reinterpret_cast<const char*>(bytes.data()), {}};
  const char* const types = lo_message_get_types(message.get());
  lo_arg** const values = lo_message_get_argv(message.get());
  const int count = lo_message_get_argc(message.get());
  for (int i = 0; i < count; ++i) {
    const auto type = static_cast<lo_type>(types[i]);
    if (lo_is_numerical_type(type)) {
      // liblo reads it: it keeps nothing aligned to 8 bytes.
      call.arguments.emplace_back(static_cast<double>(lo_hires_val(type, values[i])));
    } else if (lo_is_string_type(type)) {
      call.arguments.emplace_back(std::string(reinterpret_cast<const char*>(values[i])));
    } else if (type == LO_TRUE || type == LO_FALSE) {
      call.arguments.emplace_back(type == LO_TRUE ? 1.0 : 0.0);
    } else {
      return std::nullopt;
    }
  }
  return call;
}

// An answer as it is being written.
class Reply {
 public:
  explicit Reply(std::string address) : address_(std::move(address)) {}

  Reply& text(std::string_view text) {
    const std::string clipped(text.substr(0, std::min(max_text_bytes, text.find('\0'))));
    lo_message_add_string(message_.get(), clipped.c_str());
    return *this;
  }
  Reply& whole(std::uint64_t count) {
    constexpr std::uint64_t most = std::numeric_limits<std::int32_t>::max();
    lo_message_add_int32(message_.get(), static_cast<std::int32_t>(std::min(count, most)));
    return *this;
  }
  Reply& real(double value) {
    lo_message_add_float(message_.get(), static_cast<float>(value));
    return *this;
  }
  Reply& precise(double value) {
    lo_message_add_double(message_.get(), value);
    return *this;
  }
  // As it came.
  Reply& argument(const Argument& argument) {
    if (const std::string* const word = std::get_if<std::string>(&argument)) {
      return text(*word);
    }
    const double value = std::get<double>(argument);
    if (value == std::rint(value) && std::fabs(value) <= std::numeric_limits<std::int32_t>::max()) {
      lo_message_add_int32(message_.get(), static_cast<std::int32_t>(value));
      return *this;
    }
    return precise(value);
  }

  std::vector<std::uint8_t> bytes() const {
    std::vector<std::uint8_t> bytes(lo_message_length(message_.get(), address_.c_str()));
    lo_message_serialise(message_.get(), address_.c_str(), bytes.data(), nullptr);
    return bytes;
  }

 private:
  std::string address_;
  Message message_{lo_message_new(), lo_message_free};
};

// Others of our kind send these to us when somebody lies about who he is; were they answered, the
// two would go on for ever.
bool is_answer(std::string_view address) {
  constexpr std::array<std::string_view, 6> answers = {
      "/error", "/done", "/fail", "/status.reply", "/describe.reply", "/describe.end"};
  return std::find(answers.begin(), answers.end(), address) != answers.end();
}

// --- the way back -------------------------------------------------------------------------------

// Who has sent a packet.
struct Client {
  std::shared_ptr<OscOutlet> outlet;
  OscSender sender;

  // Whether he is answered now; if not, he is told so once.
  bool is_heard() const {
    if (outlet->may_answer(sender)) {
      return true;
    }
    if (const double pause_s = outlet->tell_pause_s(sender); pause_s > 0.0) {
      const double ms = std::ceil(1e3 * pause_s);
      outlet->answer(sender, {Reply("/error")
                                  .text("")
                                  .text("too much was asked: nothing is answered for " +
                                        print_number(ms) + " ms; what is played is played")
                                  .bytes()});
    }
    return false;
  }
  void answer(const Reply& reply) const {
    if (is_heard()) {
      outlet->answer(sender, {reply.bytes()});
    }
  }
  void error(const std::string& about, const std::string& message) const {
    answer(Reply("/error").text(about).text(message));
  }
};

// An answer of many rows, which are all sent or none.
class Rows {
 public:
  explicit Rows(const Client& client) : client_(client) {}

  // Before anything is gathered.
  bool may_begin(const std::string& about) const {
    if (!client_.is_heard()) {
      return false;
    }
    if (!client_.outlet->has_room()) {
      client_.error(about, "busy: too many answers are on their way, try again");
      return false;
    }
    return true;
  }
  void add(const Reply& reply) { rows_.push_back(reply.bytes()); }
  std::size_t size() const { return rows_.size(); }
  void send() { client_.outlet->answer(client_.sender, std::move(rows_)); }

 private:
  const Client& client_;
  std::vector<OscOutlet::Bytes> rows_;
};

}  // namespace

// --- the server ---------------------------------------------------------------------------------

struct OscServer::Server {
  // Playing messages with one time tag.
  struct Group {
    std::string address;  // of the first
    std::vector<TimedEvent> events;
    std::vector<std::pair<std::string, std::string>> news;  // for when they act: address, message
  };
  using Groups = std::map<std::uint64_t, Group>;  // by time tag

  Server(Process& process_in, Session& session_in, int socket_in, int wake_in,
         std::vector<Subnet> allowed_in, OscOutlet::Tell tell)
      : process(process_in),
        session(session_in),
        socket(socket_in),
        wake(wake_in),
        allowed(std::move(allowed_in)),
        outlet(std::make_shared<OscOutlet>(socket_in, std::move(tell))),
        thread([this] { run(); }) {}

  ~Server() {
    eventfd_write(wake, 1);
    thread.join();
    outlet->close();
    close(wake);
  }

  void run() {
    std::vector<std::uint8_t> buffer(max_osc_packet_bytes + 1);
    std::array<pollfd, 2> waits{{{socket, POLLIN, 0}, {wake, POLLIN, 0}}};
    while (true) {
      if (poll(waits.data(), waits.size(), outlet->send_due()) < 0) {
        continue;  // a signal
      }
      if (waits[1].revents != 0) {
        return;
      }
      if (const auto arrived = receive_packet(socket, buffer)) {
        count_lost(arrived->lost);
        const Client client{outlet, arrived->from};
        if (may_send(allowed, arrived->from.address)) {
          outlet->received(arrived->from, arrived->bytes);
          receive({buffer.data(), arrived->bytes}, client);
        } else {
          count_stranger(arrived->from);
        }
      }
    }
  }

  void count_lost(std::uint32_t lost_in_all) {
    // It goes around; a packet that had come before the last loss does not know of it.
    if (const std::uint32_t more = lost_in_all - lost; more < 1u << 31) {
      lost = lost_in_all;
      process.meters.dropped.add(more);
    }
  }

  void count_stranger(const OscSender& from) {
    const std::string address = print_address(from.address);
    process.meters.strangers.add(1);
    strangers.add("OSC: a packet from " + address + " was ignored; --osc-allow " + address +
                  " lets it in");
    if (const auto news = strangers.take()) {
      outlet->tell(*news);
    }
  }

  void receive(std::span<const std::uint8_t> packet, const Client& client) {
    const auto messages = check_packet(packet);
    if (!messages) {
      if (may_answer_malformed()) {
        client.error("", messages.error().message);
      }
      return;
    }
    Groups groups;
    for (const OscMessage& message : *messages) {
      const char* const address = reinterpret_cast<const char*>(message.bytes.data());
      if (std::strlen(address) > max_address_bytes) {
        client.error("",
                     "an address has at most " + std::to_string(max_address_bytes) + " characters");
      } else if (is_answer(address)) {
        continue;
      } else if (const auto call = read_call(message.bytes)) {
        // 0 is not in the standard, but some send it for "at once".
        handle(*call, std::max<std::uint64_t>(1, message.time_tag), groups, client);
      } else {
        client.error(address, "arguments are numbers (i f d h T F) or texts (s S)");
      }
    }
    for (auto& [time_tag, group] : groups) {
      play(time_tag, group, client);
    }
  }

  // Whoever sends rubbish under another's name shall not have him flooded.
  bool may_answer_malformed() {
    const std::int64_t second = monotonic_ns() / second_ns;
    if (second != malformed_second) {
      malformed_second = second;
      malformed_answers = 0;
    }
    return ++malformed_answers <= max_malformed_answers;
  }

  // Playing messages join their group; the others are answered at once, whatever their time tag.
  void handle(const Call& call, std::uint64_t time_tag, Groups& groups, const Client& client) {
    if (call.address == "/model/load" || call.address == "/preset/load") {
      load(call, client);
    } else if (call.address == "/status") {
      tell_status(client);
    } else if (call.address == "/describe") {
      describe(client);
    } else if (call.address.starts_with("/param/") && call.arguments.empty()) {
      call.address.ends_with("/range") ? tell_ranges(call, client) : tell_parameters(call, client);
    } else if (const auto events = session.events(call); !events) {
      client.error(call.address, events.error().message);
    } else {
      Group& group = groups.try_emplace(time_tag, Group{call.address, {}}).first->second;
      if (group.events.size() + events->size() > max_bundle_events) {
        client.error(call.address,
                     "a bundle may have at most " + std::to_string(max_bundle_events) + " events");
        return;
      }
      const auto loaded = session.current();
      for (const Event& event : *events) {
        group.events.push_back({.event = event});
        const bool is_known = event.model == loaded->serial;
        if (const std::string news = is_known ? told_limit(call, event, loaded->instrument) : "";
            !news.empty()) {
          group.news.emplace_back(call.address, news);
        }
      }
    }
  }

  void play(std::uint64_t time_tag, Group& group, const Client& client) {
    double late_s = 0.0;
    TimedEvent timed;
    if (time_tag > 1) {
      const ClockReading clock = process.clock.read();
      // Blocks that ended long ago tell nothing of when the next will begin.
      if (clock.rate_hz <= 0.0 || monotonic_ns() - clock.time_ns > second_ns) {
        client.error(group.address, "no audio is running: a time tag cannot be kept");
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
      // The newest block has its events already; a late one begins the next, and is counted there.
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
                                  " events may wait for their time, and there is no room for " +
                                  events + " more; try again later"
                            : "busy: no room for " + events + ", try again");
      return;
    }
    session.remember(group.events);
    for (const auto& [address, news] : group.news) {
      client.error(address, news);
    }
    if (late_s > 0.0) {
      lates.add("late by " + seconds_text(late_s) + " s, acts now");
      if (const auto news = lates.take()) {
        client.error(group.address, *news);
      }
    }
  }

  static std::string seconds_text(double seconds) {
    return print_number(std::round(seconds * 1e4) / 1e4);
  }

  void load(const Call& call, const Client& client) {
    if (call.arguments.empty() || call.arguments.size() > 2 ||
        !std::holds_alternative<std::string>(call.arguments[0])) {
      client.error(call.address, call.address + ": expected NAME [ID]");
      return;
    }
    if (!client.outlet->begin_load()) {
      client.error(call.address, "busy: enough loads are waiting, try again");
      return;
    }
    const auto answer = [call, client](const Result<std::shared_ptr<const Loaded>>& result) {
      client.outlet->end_load();
      Reply reply(result ? "/done" : "/fail");
      reply.text(call.address);
      if (call.arguments.size() > 1) {
        reply.argument(call.arguments[1]);
      }
      if (!result) {
        const std::string& full = result.error().message;
        const std::string told = without_source(full);
        reply.text(told);
        if (told != full) {
          client.outlet->tell_failure("OSC could not load it:\n" + full);
        }
      }
      client.answer(reply);
    };
    session.load(std::get<std::string>(call.arguments[0]), answer, false, Reach::own_folders);
  }

  // /status.reply s:model f:cpu (1: all the time there is; -1: nothing runs) i:voices i:max_voices
  // i:xruns i:resets d:rate i:period f:load_ms f:peak_db (-999: silence) i:late i:dropped s:backend
  // i:beyond (times that a parameter was kept where it is stable) f:cpu_peak (of one period, since
  // the last reply)
  void tell_status(const Client& client) {
    const Status status = session.status();
    client.answer(Reply("/status.reply")
                      .text(status.model)
                      .real(status.cpu)
                      .whole(static_cast<std::uint64_t>(status.voices))
                      .whole(static_cast<std::uint64_t>(status.max_voices))
                      .whole(status.xruns)
                      .whole(status.resets)
                      .precise(status.rate_hz)
                      .whole(static_cast<std::uint64_t>(status.period_frames))
                      .real(status.load_ms)
                      .real(std::max(-999.0, status.peak_db))
                      .whole(status.late)
                      .whole(status.dropped)
                      .text(status.backend)
                      .whole(status.beyond)
                      .real(status.cpu_peak));
  }

  // What `tell` says of the parameters whose name fits what is between /param/ and the ending.
  template <class Tell>
  void each_parameter(const Call& call, std::string_view ending, const Client& client,
                      Tell&& tell) {
    Rows rows(client);
    if (!rows.may_begin(call.address)) {
      return;
    }
    std::string_view pattern = std::string_view(call.address).substr(7);
    pattern.remove_suffix(ending.size());
    const auto loaded = session.current();
    bool has_any = false;
    for (const ParameterInfo& info : loaded->instrument.parameters) {
      if (fits(pattern, info.name)) {
        has_any = true;
        tell(info, rows);
      }
    }
    rows.send();
    if (!has_any) {
      client.error(call.address, "the model has no such parameter; /param/* lists what it has");
    }
  }

  void tell_parameters(const Call& call, const Client& client) {
    each_parameter(call, "", client, [&](const ParameterInfo& info, Rows& rows) {
      // Nothing if another model came in between.
      if (const auto value = session.parameter(info.name)) {
        rows.add(Reply("/param/" + info.name).real(*value));
      }
    });
  }

  // f:minimum f:maximum f:lowest f:highest that is stable, infinite where nothing limits
  void tell_ranges(const Call& call, const Client& client) {
    constexpr std::string_view ending = "/range";
    each_parameter(call, ending, client, [&](const ParameterInfo& info, Rows& rows) {
      rows.add(Reply("/param/" + info.name + std::string(ending))
                   .real(info.minimum)
                   .real(info.maximum)
                   .real(info.safe.lowest)
                   .real(info.safe.highest));
    });
  }

  // A row s:address s:arguments s:meaning for everything, then /describe.end i:rows, so that
  // whoever counts knows if one was lost on the way. A parameter's meaning is its value, minimum
  // and maximum, and between what it is stable.
  void describe(const Client& client) {
    Rows rows(client);
    if (!rows.may_begin("/describe")) {
      return;
    }
    const auto loaded = session.current();
    const auto row = [&](std::string_view address, std::string_view arguments,
                         std::string_view meaning) {
      rows.add(Reply("/describe.reply").text(address).text(arguments).text(meaning));
    };
    for (const AddressRow& known : addresses()) {
      row(known.address, known.arguments, known.does);
    }
    for (const ParameterInfo& info : loaded->instrument.parameters) {
      row("/param/" + info.name, "f",
          print_number(session.parameter(info.name).value_or(info.value)) + " " +
              print_number(info.minimum) + " " + print_number(info.maximum) + " " +
              print_limit(info.safe.lowest, false) + " " + print_limit(info.safe.highest, true));
    }
    std::set<std::string_view> customs;  // one may drive several things
    for (const CustomInfo& custom : loaded->instrument.custom) {
      if (customs.insert(custom.address).second) {
        row(custom.address, "f", "a control of the preset, 0-1");
      }
    }
    rows.add(Reply("/describe.end").whole(rows.size()));
    rows.send();
  }

  Process& process;
  Session& session;
  const int socket;  // the outlet's, which closes it after the thread has ended
  const int wake;
  const std::vector<Subnet> allowed;
  std::shared_ptr<OscOutlet> outlet;
  TagClock tags;
  RateLimit lates{std::chrono::seconds(1)};
  std::int64_t malformed_second = 0;
  int malformed_answers = 0;
  std::uint32_t lost = 0;  // by the system, as it counts
  RateLimit strangers;
  std::thread thread;  // last, so that all else is there when it starts
};

OscServer::OscServer(std::unique_ptr<Server> server) : server_(std::move(server)) {}
OscServer::~OscServer() = default;

Result<std::unique_ptr<OscServer>> OscServer::open(const OscOptions& options, Process& process,
                                                   Session& session, Tell tell) {
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
  return std::unique_ptr<OscServer>(new OscServer(
      std::make_unique<Server>(process, session, *socket, wake, *allowed, std::move(tell))));
}

std::string OscServer::access() const {
  std::string others;
  for (const Subnet& subnet : server_->allowed) {
    others += (others.empty() ? "" : ", ") + print_subnet(subnet);
  }
  return others.empty() ? "for this machine alone" : "open to this machine and " + others;
}

int OscServer::port() const {
  return port_of(server_->socket);
}

}  // namespace ressort
