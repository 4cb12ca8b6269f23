#include "app/panel/panel.h"

#include <httplib.h>
#include <ifaddrs.h>
#include <netinet/in.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <set>
#include <system_error>
#include <thread>
#include <utility>

#include "app/control/osc/packet.h"
#include "app/panel/access.h"
#include "app/panel/osc_query.h"
#include "app/panel/page.h"
#include "app/panel/state.h"

namespace ressort::panel {
namespace {

using Request = httplib::Request;
using Response = httplib::Response;

constexpr std::size_t most_news = 100;
constexpr double fastest_hz = 60.0;
constexpr double usual_hz = 30.0;
constexpr std::size_t most_modes_shown = 64;
constexpr auto event_pause = std::chrono::milliseconds(100);
constexpr const char* octets = "application/octet-stream";

// Returns the addresses under which other machines reach this one.
std::vector<std::string> own_addresses() {
  std::vector<std::string> addresses;
  ifaddrs* first = nullptr;
  if (getifaddrs(&first) == 0) {
    for (const ifaddrs* at = first; at != nullptr; at = at->ifa_next) {
      if (at->ifa_addr != nullptr && at->ifa_addr->sa_family == AF_INET) {
        const auto* const address = reinterpret_cast<const sockaddr_in*>(at->ifa_addr);
        addresses.push_back(print_address(ntohl(address->sin_addr.s_addr)));
      }
    }
    freeifaddrs(first);
  }
  return addresses;
}

// Returns a number from the query string, limited to a range.
double number_of(const Request& request, const std::string& name, double otherwise, double least,
                 double most) {
  double value = otherwise;
  if (request.has_param(name)) {
    const std::string text = request.get_param_value(name);
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !(value >= least)) {
      value = otherwise;
    }
  }
  return std::clamp(value, least, most);
}

// Puts packets as elements into one bundle with the time tag "immediately".
std::string bundle_of(const OscServer::Packets& packets) {
  std::string bytes("#bundle\0\0\0\0\0\0\0\0\1", 16);
  for (const auto& packet : packets) {
    for (int shift = 24; shift >= 0; shift -= 8) {
      bytes += static_cast<char>(packet.size() >> shift & 0xff);
    }
    bytes.append(packet.begin(), packet.end());
  }
  return bytes;
}

// Returns the text of a /fail message without the address of the request.
std::string failure_in(const std::vector<std::uint8_t>& packet) {
  const std::string all(packet.begin(), packet.end());
  if (!all.starts_with(std::string_view("/fail\0", 6))) {
    return {};
  }
  std::string said;
  for (std::size_t at = all.find(',') + 1, end = 0; at < all.size(); at = end + 1) {
    end = std::min(all.find('\0', at), all.size());
    const std::string text = all.substr(at, end - at);
    const bool is_text = text.size() > 2 && text.find(' ') != text.npos;
    said += is_text ? (said.empty() ? "" : " ") + text : "";
  }
  return said;
}

// The latest error messages. Loads may end after the panel has gone.
class News {
 public:
  void add(const std::string& text) {
    const std::lock_guard lock(mutex_);
    texts_.push_back(text);
    ++count_;
    if (texts_.size() > most_news) {
      texts_.pop_front();
    }
  }
  // Returns the messages after the first `heard` ones, and updates that count.
  std::vector<std::string> after(std::uint64_t& heard) {
    const std::lock_guard lock(mutex_);
    const auto more = std::min<std::uint64_t>(count_ - heard, texts_.size());
    heard = count_;
    return {texts_.end() - static_cast<std::ptrdiff_t>(more), texts_.end()};
  }

 private:
  std::mutex mutex_;
  std::deque<std::string> texts_;
  std::uint64_t count_ = 0;  // Number of messages so far.
};

// Serves each connection on its own thread, so that a silent or an endless one does not delay
// others.
class Connections : public httplib::TaskQueue {
 public:
  // void in cpp-httplib 0.11, a bool that is false if the queue is full in 0.18.
  using IsQueued = decltype(std::declval<httplib::TaskQueue&>().enqueue({}));

  IsQueued enqueue(std::function<void()> serve) override {
    constexpr std::size_t most = 512;
    std::unique_lock lock(mutex_);
    ended_.wait(lock, [&] { return open_ < most; });
    try {
      std::thread([this, serve] {
        serve();
        const std::lock_guard end(mutex_);
        --open_;
        ended_.notify_all();
      }).detach();
      ++open_;
    } catch (const std::system_error&) {  // The system has no more threads: others wait.
      lock.unlock();
      serve();
    }
    return IsQueued(true);
  }

  void shutdown() override {
    std::unique_lock lock(mutex_);
    ended_.wait(lock, [&] { return open_ == 0; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable ended_;
  std::size_t open_ = 0;
};

}  // namespace

struct WebPanel::Server {
  Server(const PanelOptions& options, Process& process_in, Session& session_in,
         MotionFeed& motion_in, OscServer& osc_in)
      : bind_address(options.bind_address),
        process(process_in),
        session(session_in),
        motion(motion_in),
        osc(osc_in) {
    http.new_task_queue = [] { return new Connections; };
    http.set_keep_alive_max_count(1);
    http.set_keep_alive_timeout(1);  // Browsers open connections ahead of time and leave them idle.
    http.set_read_timeout(idle_s);
    http.set_write_timeout(idle_s);
    http.set_payload_max_length(most_body_bytes);
    http.set_tcp_nodelay(true);
    // Exclusive: two instances cannot share a port.
    http.set_socket_options([this](int socket) {
      const int yes = 1;
      setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
      listening_socket = socket;
    });
  }

  ~Server() {
    {
      const std::lock_guard lock(mutex);
      is_ending = true;
    }
    ending.notify_all();
    http.stop();
    if (listener.joinable()) {
      listener.join();
    }
  }

  bool bind(int wanted) {
    port = wanted > 0 ? (http.bind_to_port(bind_address, wanted) ? wanted : -1)
                      : http.bind_to_any_port(bind_address);
    // The queue of cpp-httplib holds five clients. Other clients try again after a second.
    return port > 0 && ::listen(listening_socket, SOMAXCONN) == 0;
  }

  void listen() {
    const bool is_open = !is_loopback(bind_address);
    access = std::make_unique<PanelAccess>(
        port,
        is_open ? bind_address == "0.0.0.0" ? own_addresses() : std::vector{bind_address}
                : std::vector<std::string>(),
        make_token(), is_open);
    http.set_pre_routing_handler([this](const Request& request, Response& response) {
      if (const int status = refused(request); status != 0) {
        response.status = status;
        return httplib::Server::HandlerResponse::Handled;
      }
      protect(request, response);
      return answer_query(request, response) ? httplib::Server::HandlerResponse::Handled
                                             : httplib::Server::HandlerResponse::Unhandled;
    });
    http.set_exception_handler([](const Request&, Response& response, std::exception_ptr) {
      response.status = 500;  // The cause is not revealed.
    });
    for (const PageFile& file : page_files()) {
      http.Get(std::string(file.path), [file](const Request&, Response& response) {
        response.set_content(file.text.data(), file.text.size(), std::string(file.type).c_str());
      });
    }
    http.Get("/describe", [this](const Request&, Response& response) {
      response.set_content(describe_json(session), "application/json");
    });
    http.Get("/network", [this](const Request&, Response& r) { send_network(r); });
    http.Get("/modes", [this](const Request& q, Response& r) { send_modes(q, r); });
    http.Get("/motion", [this](const Request& q, Response& r) { stream_motion(q, r); });
    http.Get("/events", [this](const Request&, Response& r) { stream_events(r); });
    http.Post("/osc", [this](const Request& q, Response& r) { take_packet(q, r); });
    listener = std::thread([this] { http.listen_after_bind(); });
  }

  // Returns the HTTP status with which a request is refused before its body is read; 0: accepted.
  int refused(const Request& request) const {
    const auto one = [&](const char* name) {
      return request.get_header_value_count(name) == 1 ? request.get_header_value(name)
                                                       : std::string();
    };
    if (!access->is_host(one("Host")) ||
        (request.has_header("Origin") && !access->is_origin(one("Origin"))) ||
        (request.has_header("Sec-Fetch-Site") && one("Sec-Fetch-Site") != "same-origin" &&
         one("Sec-Fetch-Site") != "none")) {
      return 403;
    }
    if (access->needs_token() && !access->is_token(request.get_param_value("token")) &&
        !access->is_token(cookie_of(one("Cookie"), "ressort"))) {
      return 403;
    }
    // The page never uses ranges, chunked requests or compression.
    if (request.has_header("Range") || request.has_header("Transfer-Encoding") ||
        request.has_header("Content-Encoding")) {
      return 400;
    }
    if (request.method == "POST") {
      const std::string length = one("Content-Length");
      std::size_t bytes = 0;
      const auto [end, error] =
          std::from_chars(length.data(), length.data() + length.size(), bytes);
      if (length.empty() || error != std::errc() || end != length.data() + length.size()) {
        return 411;
      }
      if (one("Content-Type") != octets) {
        return 415;
      }
      return bytes > most_body_bytes ? 413 : 0;
    }
    return request.method == "GET" || request.method == "HEAD" ? 0 : 405;
  }

  void protect(const Request& request, Response& response) const {
    response.set_header("Content-Security-Policy",
                        "default-src 'self'; base-uri 'none'; form-action 'none'; "
                        "frame-ancestors 'none'");
    response.set_header("X-Content-Type-Options", "nosniff");
    response.set_header("Referrer-Policy", "no-referrer");
    response.set_header("Cross-Origin-Resource-Policy", "same-origin");
    response.set_header("Cache-Control", "no-store");
    if (access->needs_token() && access->is_token(request.get_param_value("token"))) {
      response.set_header("Set-Cookie",
                          "ressort=" + access->token() + "; HttpOnly; SameSite=Strict; Path=/");
    }
  }

  // Paths that are not the page's own query the tree of addresses; so does / if JSON is requested.
  bool answer_query(const Request& request, Response& response) const {
    static const std::set<std::string> ours = {"/describe", "/network", "/modes",
                                               "/motion",   "/events",  "/osc"};
    const std::span<const PageFile> files = page_files();
    const bool is_file =
        std::ranges::any_of(files, [&](const PageFile& file) { return file.path == request.path; });
    const bool wants_tree = request.get_header_value("Accept").find("json") != std::string::npos;
    const bool asks = request.has_param("HOST_INFO") || !(is_file || ours.contains(request.path)) ||
                      (request.path == "/" && wants_tree);
    if (!asks || request.method == "POST") {
      return false;
    }
    if (request.has_param("HOST_INFO")) {
      response.set_content(
          osc_host_info(osc.listens_on_udp() ? std::optional(osc.port()) : std::nullopt),
          "application/json");
      return true;
    }
    std::string attribute;
    for (const auto& [name, value] : request.params) {
      attribute = name != "token" ? name : attribute;
    }
    const OscQueryAnswer answer = osc_query(session, request.path, attribute);
    response.status = answer.status;
    if (!answer.json.empty()) {
      response.set_content(answer.json, "application/json");
    }
    return true;
  }

  static void say(Response& response, int status, const std::string& text) {
    response.status = status;
    response.set_content(text + "\n", "text/plain; charset=utf-8");
  }

  // Waits between messages of a stream; a client that reads nothing for idle_s is dropped.
  bool pause(std::chrono::duration<double> time) {
    std::unique_lock lock(mutex);
    return !ending.wait_for(lock, time, [this] { return is_ending; });
  }

  // Returns the current picture; before the first viewer, requests a frame to get it.
  std::shared_ptr<const Picture> picture() {
    for (int looks = 0; looks < 20; ++looks) {
      motion.newest_frame();
      if (auto found = motion.picture()) {
        return found;
      }
      if (!pause(std::chrono::milliseconds(25))) {
        break;
      }
    }
    return nullptr;
  }

  void send_network(Response& response) {
    const auto now = picture();
    if (now == nullptr) {
      return say(response, 503, "there is no sounding model to draw");
    }
    const std::lock_guard lock(telling);
    if (told_picture != now->number) {
      told_network = network_json(*now);
      told_picture = now->number;
    }
    response.set_content(told_network, "application/json");
  }

  // One search at a time, because a search takes long.
  void send_modes(const Request& request, Response& response) {
    const auto now = picture();
    if (now == nullptr) {
      return say(response, 503, "there is no sounding model to draw");
    }
    const auto count =
        static_cast<std::size_t>(number_of(request, "count", 24, 1, most_modes_shown));
    const std::unique_lock lock(searching, std::try_to_lock);
    if (!lock) {
      return say(response, 503, "a search for the modes is already running");
    }
    const Progress progress([this](std::string_view) { return pause({}); });
    try {
      const Session::Present present = session.present();
      const auto modes =
          present.values.size() == now->network->parameters.size()
              ? modes_json(*now, present.values, session.status(MeterReader::panel).rate_hz, count,
                           progress)
              : Result<std::string>(Error{"another model is being loaded"});
      if (modes) {
        response.set_content(*modes, "application/json");
      } else {
        say(response, 503, modes.error().message);
      }
    } catch (const Stopped&) {
      say(response, 503, "the program is ending");
    }
  }

  // Counts a viewer for the lifetime of its stream; null if there are too many.
  std::shared_ptr<void> enter(std::size_t& viewers) {
    const std::lock_guard lock(mutex);
    if (viewers >= static_cast<std::size_t>(most_viewers)) {
      return nullptr;
    }
    ++viewers;
    return {this, [this, &viewers](void*) {
              const std::lock_guard leaving(mutex);
              --viewers;
            }};
  }

  void stream_motion(const Request& request, Response& response) {
    const auto seat = enter(watching);
    if (seat == nullptr) {
      return say(response, 503, "too many viewers");
    }
    const double hz = number_of(request, "hz", usual_hz, 1.0, fastest_hz);
    const bool is_slow = number_of(request, "slow", 0.0, 0.0, 1.0) > 0.5;
    response.set_chunked_content_provider(
        octets,
        [this, hz, is_slow, seat, last = std::uint64_t{0}, next = std::chrono::steady_clock::now()](
            std::size_t, httplib::DataSink& sink) mutable {
          const auto frame = motion.newest_frame(is_slow);
          if (frame->frame != last && !frame->bytes.empty()) {
            last = frame->frame;
            if (!sink.write(frame->bytes.data(), frame->bytes.size())) {
              return false;
            }
          } else if (!sink.is_writable()) {
            return false;
          }
          // Timed by a clock, not by duration; a late stream skips frames.
          const auto now = std::chrono::steady_clock::now();
          next = std::max(next, now - std::chrono::milliseconds(100)) +
                 std::chrono::duration_cast<std::chrono::nanoseconds>(
                     std::chrono::duration<double>(1.0 / hz));
          return pause(std::max(std::chrono::nanoseconds(0), next - now));
        });
  }

  void stream_events(Response& response) {
    const auto seat = enter(listening);
    if (seat == nullptr) {
      return say(response, 503, "too many viewers");
    }
    response.set_chunked_content_provider(
        "text/event-stream", [this, seat, heard = std::uint64_t{0}, changes = Changes()](
                                 std::size_t, httplib::DataSink& sink) mutable {
          std::string events = changes.since_last(session);
          for (const std::string& text : news->after(heard)) {
            events += server_event("news", quoted(text));
          }
          events += server_event("status", status_now());
          return sink.write(events.data(), events.size()) && pause(event_pause);
        });
  }

  // All viewers share one status, because reading it resets the peaks.
  std::string status_now() {
    const std::lock_guard lock(telling);
    const auto now = std::chrono::steady_clock::now();
    if (now >= next_status) {
      next_status = now + event_pause / 2;
      TimbreWatch& timbre = session.timbre();
      timbre.listen(10 * event_pause);
      const auto frames = timbre.since(told_frame);
      told_frame = frames.empty() ? told_frame : frames.back().number;
      shape = frames.empty() ? shape : frames.back().timbre.shape;
      told_status = status_json(session.status(MeterReader::panel), shape);
    }
    return told_status;
  }

  // Failed loads and saves are reported to all viewers, even if they end later.
  void take_packet(const Request& request, Response& response) {
    const auto tell_failures = [box = news](const OscServer::Packets& packets) {
      for (const auto& packet : packets) {
        if (const std::string said = failure_in(packet); !said.empty()) {
          box->add(said);
        }
      }
    };
    const auto answers = osc.ask({request.body.begin(), request.body.end()}, tell_failures);
    tell_failures(answers);
    response.set_content(bundle_of(answers), octets);
  }

  const std::string bind_address;
  Process& process;
  Session& session;
  MotionFeed& motion;
  OscServer& osc;
  httplib::Server http;
  int port = 0;
  int listening_socket = -1;
  std::unique_ptr<PanelAccess> access;

  std::mutex mutex;  // Protects the members below.
  std::condition_variable ending;
  bool is_ending = false;
  std::size_t watching = 0;
  std::size_t listening = 0;
  const std::shared_ptr<News> news = std::make_shared<News>();

  std::mutex telling;  // Protects the members below.
  std::uint32_t told_picture = 0;
  std::string told_network;
  std::chrono::steady_clock::time_point next_status;
  std::string told_status;
  std::uint64_t told_frame = 0;        // Frame of the descriptors that were sent.
  std::optional<SpectralShape> shape;  // Descriptors of that frame.

  std::mutex searching;  // Held while modes are computed.
  std::thread listener;
};

WebPanel::WebPanel(std::unique_ptr<Server> server) : server_(std::move(server)) {}
WebPanel::~WebPanel() = default;

Result<std::unique_ptr<WebPanel>> WebPanel::open(const PanelOptions& options, Process& process,
                                                 Session& session, MotionFeed& motion,
                                                 OscServer& osc) {
  auto server = std::make_unique<Server>(options, process, session, motion, osc);
  if (!server->bind(options.port)) {
    return Error{"port " + std::to_string(options.port) + " of " + options.bind_address +
                 " is in use or needs privileges; choose another with --web"};
  }
  server->listen();
  return std::unique_ptr<WebPanel>(new WebPanel(std::move(server)));
}

std::string WebPanel::address() const {
  const std::string& bound = server_->bind_address;
  std::string host = bound == "localhost" ? "127.0.0.1" : bound;
  if (bound == "0.0.0.0") {
    const std::vector<std::string> own = own_addresses();
    const auto other = std::ranges::find_if_not(own, is_loopback);
    host = other != own.end() ? *other : "127.0.0.1";
  }
  return "http://" + host + ":" + std::to_string(server_->port) +
         "/?token=" + server_->access->token();
}

bool WebPanel::is_for_all() const {
  return server_->access->needs_token();
}

void WebPanel::show_message(const std::string& news) {
  server_->news->add(news);
}

}  // namespace ressort::panel
