#include "app/osc.h"

#include <arpa/inet.h>
#include <lo/lo.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <optional>
#include <thread>

#include "app/audio.h"
#include "app/osc_packet.h"
#include "app/time_tags.h"
#include "core/model/expression.h"

namespace ressort {
namespace {

constexpr std::size_t max_address_bytes = 255;
constexpr std::size_t max_text_bytes = 4096;  // of one string of an answer
constexpr int max_answers = 4096;             // to one packet: nobody is drowned through us
constexpr int max_malformed_answers = 10;     // in a second
constexpr int max_loads_waiting = 16;
constexpr std::size_t max_bundle_events = 4096;  // as many as the process can hold
constexpr int receive_buffer_bytes = 1 << 20;
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

// All that an answer needs, however late it comes: a load may end after the server has.
class Outlet {
 public:
  explicit Outlet(int socket) : socket_(socket) {}
  ~Outlet() { close(); }
  Outlet(const Outlet&) = delete;
  Outlet& operator=(const Outlet&) = delete;

  void send(const sockaddr_in& to, const std::vector<std::uint8_t>& bytes) {
    const std::lock_guard lock(mutex_);
    if (socket_ >= 0) {
      // Whoever cannot be reached has gone; UDP promises nothing.
      sendto(socket_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to),
             sizeof to);
    }
  }
  void close() {
    const std::lock_guard lock(mutex_);
    if (socket_ >= 0) {
      ::close(socket_);
      socket_ = -1;
    }
  }
  // False when enough are waiting already.
  bool begin_load() {
    const std::lock_guard lock(mutex_);
    if (loads_waiting_ >= max_loads_waiting) {
      return false;
    }
    ++loads_waiting_;
    return true;
  }
  void end_load() {
    const std::lock_guard lock(mutex_);
    --loads_waiting_;
  }

 private:
  std::mutex mutex_;
  int socket_;
  int loads_waiting_ = 0;
};

// Who has sent a packet, and how many answers are left to him.
struct Client {
  std::shared_ptr<Outlet> outlet;
  sockaddr_in address{};
  int answers_left = max_answers;

  void answer(const Reply& reply) {
    if (answers_left > 0) {
      --answers_left;
      outlet->send(address, reply.bytes());
    }
  }
  void error(const std::string& about, const std::string& message) {
    answer(Reply("/error").text(about).text(message));
  }
};

Result<int> open_socket(const OscOptions& options) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  if (inet_pton(AF_INET, options.bind_address.c_str(), &address.sin_addr) != 1) {
    return Error{"'" + options.bind_address +
                 "' is no address to bind OSC to; use 127.0.0.1 for this machine alone, 0.0.0.0 "
                 "for every network"};
  }
  if (options.port < 0 || options.port > 65535) {
    return Error{"the OSC port must lie between 0 and 65535, found " +
                 std::to_string(options.port)};
  }
  address.sin_port = htons(static_cast<std::uint16_t>(options.port));
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket < 0) {
    return Error{std::string("no socket for OSC: ") + std::strerror(errno)};
  }
  if (bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    const int failure = errno;
    close(socket);
    const std::string place =
        "port " + std::to_string(options.port) + " of " + options.bind_address;
    return failure == EADDRINUSE
               ? Error{place +
                       " is taken, perhaps by another ressort; choose another with "
                       "--osc-port or switch OSC off with --osc-port off"}
               : Error{"OSC cannot use " + place + ": " + std::strerror(failure)};
  }
  // Bursts shall not be lost; the system may grant less.
  setsockopt(socket, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes, sizeof receive_buffer_bytes);
  return socket;
}

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

  Server(Process& process_in, Session& session_in, int socket_in, int wake_in)
      : process(process_in),
        session(session_in),
        socket(socket_in),
        wake(wake_in),
        outlet(std::make_shared<Outlet>(socket_in)),
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
      if (poll(waits.data(), waits.size(), -1) < 0) {
        continue;  // a signal
      }
      if (waits[1].revents != 0) {
        return;
      }
      Client client{outlet};
      socklen_t length = sizeof client.address;
      const ssize_t size = recvfrom(socket, buffer.data(), buffer.size(), MSG_DONTWAIT,
                                    reinterpret_cast<sockaddr*>(&client.address), &length);
      if (size >= 0) {
        receive({buffer.data(), static_cast<std::size_t>(size)}, client);
      }
    }
  }

  void receive(std::span<const std::uint8_t> packet, Client& client) {
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
  void handle(const Call& call, std::uint64_t time_tag, Groups& groups, Client& client) {
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

  void play(std::uint64_t time_tag, Group& group, Client& client) {
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
    std::size_t following = group.events.size();
    for (TimedEvent& event : group.events) {
      event.timing = timed.timing;
      event.when = timed.when;
      event.following = static_cast<std::uint16_t>(--following);
    }
    if (!process.from_osc.push_all(group.events)) {
      client.error(group.address, "busy: no room for " + std::to_string(group.events.size()) +
                                      (group.events.size() == 1 ? " event" : " events") +
                                      ", try again");
      return;
    }
    session.remember(group.events);
    for (const auto& [address, news] : group.news) {
      client.error(address, news);
    }
    if (late_s > 0.0) {
      client.error(group.address, "late by " + seconds_text(late_s) + " s, acts now");
    }
  }

  static std::string seconds_text(double seconds) {
    return print_number(std::round(seconds * 1e4) / 1e4);
  }

  void load(const Call& call, Client& client) {
    if (call.arguments.empty() || call.arguments.size() > 2 ||
        !std::holds_alternative<std::string>(call.arguments[0])) {
      client.error(call.address, call.address + ": expected NAME [ID]");
      return;
    }
    if (!client.outlet->begin_load()) {
      client.error(call.address,
                   "busy: " + std::to_string(max_loads_waiting) + " loads are waiting, try again");
      return;
    }
    const auto answer = [call, later = Client{client.outlet, client.address}](
                            const Result<std::shared_ptr<const Loaded>>& result) mutable {
      Reply reply(result ? "/done" : "/fail");
      reply.text(call.address);
      if (call.arguments.size() > 1) {
        reply.argument(call.arguments[1]);
      }
      if (!result) {
        reply.text(result.error().message);
      }
      later.outlet->end_load();
      later.answer(reply);
    };
    session.load(std::get<std::string>(call.arguments[0]), answer);
  }

  // /status.reply s:model f:cpu (0 to 1, -1: not known) i:voices i:max_voices i:xruns i:resets
  // d:rate i:period f:load_ms f:peak_db (-999: silence) i:late i:dropped s:backend i:beyond (times
  // that a parameter was kept where it is stable)
  void tell_status(Client& client) {
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
                      .whole(status.beyond));
  }

  // Calls `tell` for the parameters whose name fits what is between /param/ and the ending.
  template <class Tell>
  void each_parameter(const Call& call, std::string_view ending, Client& client, Tell&& tell) {
    std::string_view pattern = std::string_view(call.address).substr(7);
    pattern.remove_suffix(ending.size());
    const auto loaded = session.current();
    bool has_any = false;
    for (const ParameterInfo& info : loaded->instrument.parameters) {
      if (fits(pattern, info.name)) {
        has_any = true;
        tell(info);
      }
    }
    if (!has_any) {
      client.error(call.address, "the model has no such parameter; /param/* lists what it has");
    }
  }

  void tell_parameters(const Call& call, Client& client) {
    each_parameter(call, "", client, [&](const ParameterInfo& info) {
      // Nothing if another model came in between.
      if (const auto value = session.parameter(info.name)) {
        client.answer(Reply("/param/" + info.name).real(*value));
      }
    });
  }

  // f:minimum f:maximum f:lowest f:highest that is stable, infinite where nothing limits
  void tell_ranges(const Call& call, Client& client) {
    constexpr std::string_view ending = "/range";
    each_parameter(call, ending, client, [&](const ParameterInfo& info) {
      client.answer(Reply("/param/" + info.name + std::string(ending))
                        .real(info.minimum)
                        .real(info.maximum)
                        .real(info.safe.lowest)
                        .real(info.safe.highest));
    });
  }

  // A row s:address s:arguments s:meaning for everything, then /describe.end i:rows, so that
  // whoever counts knows if one was lost on the way. A parameter's meaning is its value, minimum
  // and maximum, and between what it is stable.
  void describe(Client& client) {
    const auto loaded = session.current();
    std::uint64_t rows = 0;
    const auto row = [&](std::string_view address, std::string_view arguments,
                         std::string_view meaning) {
      ++rows;
      client.answer(Reply("/describe.reply").text(address).text(arguments).text(meaning));
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
    for (const CustomInfo& custom : loaded->instrument.custom) {
      row(custom.address, "f", "a control of the preset, 0-1");
    }
    client.answer(Reply("/describe.end").whole(rows));
  }

  Process& process;
  Session& session;
  const int socket;  // the outlet's, which closes it after the thread has ended
  const int wake;
  std::shared_ptr<Outlet> outlet;
  TagClock tags;
  std::int64_t malformed_second = 0;
  int malformed_answers = 0;
  std::thread thread;  // last, so that all else is there when it starts
};

OscServer::OscServer(std::unique_ptr<Server> server) : server_(std::move(server)) {}
OscServer::~OscServer() = default;

Result<std::unique_ptr<OscServer>> OscServer::open(const OscOptions& options, Process& process,
                                                   Session& session) {
  const auto socket = open_socket(options);
  if (!socket) {
    return socket.error();
  }
  const int wake = eventfd(0, EFD_CLOEXEC);
  if (wake < 0) {
    const std::string reason = std::strerror(errno);
    close(*socket);
    return Error{"OSC cannot start: " + reason};
  }
  return std::unique_ptr<OscServer>(
      new OscServer(std::make_unique<Server>(process, session, *socket, wake)));
}

int OscServer::port() const {
  sockaddr_in address{};
  socklen_t length = sizeof address;
  getsockname(server_->socket, reinterpret_cast<sockaddr*>(&address), &length);
  return ntohs(address.sin_port);
}

}  // namespace ressort
