// The panel's HTTP by bytes on a socket: access and replies. panel_test.cpp tests the drawing.
#include "app/panel/panel.h"

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <functional>
#include <future>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "app/panel/access.h"
#include "app/panel/page.h"
#include "app/panel/picture.h"
#include "core/compile/instrument.h"
#include "core/kernels/registry.h"
#include "tests/support/app/data_folder.h"
#include "tests/support/app/osc_bytes.h"
#include "tests/support/app/process_harness.h"

namespace ressort::panel_http_test {
namespace {

using namespace support;
using namespace std::chrono_literals;

// --- access --------------------------------------------------------------------------------------

TEST_CASE("hosts and origins must match exactly", "[panel_http]") {
  const PanelAccess access(9788, {}, "secret", false);
  for (const char* const host : {"127.0.0.1:9788", "localhost:9788", "[::1]:9788"}) {
    CHECK(access.is_host(host));
    CHECK(access.is_origin(std::string("http://") + host));
  }
  for (const char* const host :
       {"", "127.0.0.1", "127.0.0.1:97880", "127.0.0.1:9788.evil.com", "evil.com", "evil.com:9788",
        "localhost.evil.com:9788", "LOCALHOST:9788", " localhost:9788", "localhost:9788 ",
        "127.0.0.1:9788@evil.com", "user@127.0.0.1:9788", "127.1:9788", "0.0.0.0:9788",
        "2130706433:9788", "[::ffff:127.0.0.1]:9788", "localhost:09788", "localhost:9788/"}) {
    INFO(host);
    CHECK_FALSE(access.is_host(host));
    CHECK_FALSE(access.is_origin(std::string("http://") + host));
  }
  for (const char* const origin : {"null", "", "file://", "https://127.0.0.1:9788",
                                   "http://127.0.0.1:9788/", "127.0.0.1:9788", "http://"}) {
    INFO(origin);
    CHECK_FALSE(access.is_origin(origin));
  }
  CHECK(PanelAccess(80, {"10.0.0.5"}, "", true).is_host("10.0.0.5:80"));
  CHECK_FALSE(PanelAccess(80, {"10.0.0.5"}, "", true).is_host("10.0.0.50:80"));
}

TEST_CASE("tokens are random and must match exactly", "[panel_http]") {
  std::set<std::string> tokens;
  for (int i = 0; i < 1000; ++i) {
    const std::string token = make_token();
    CHECK(token.size() == 32);
    tokens.insert(token);
  }
  CHECK(tokens.size() == 1000);
  const PanelAccess access(1, {}, "0123456789abcdef", true);
  CHECK(access.is_token("0123456789abcdef"));
  for (const char* const token :
       {"", "0123456789abcde", "0123456789abcdef0", "0123456789abcdeF", "1123456789abcdef"}) {
    CHECK_FALSE(access.is_token(token));
  }
  CHECK(cookie_of("a=b; ressort=xyz; c=d", "ressort") == "xyz");
  CHECK(cookie_of("ressort=xyz", "ressort") == "xyz");
  CHECK(cookie_of("notressort=xyz", "ressort").empty());
  CHECK(cookie_of("ressortx=1;;; =; ressort", "ressort").empty());
}

// A session whose audio is driven by a thread, and its panel.
struct Stage {
  explicit Stage(const PanelOptions& options = {}) {
    data.write("models/two.mdl",
               "@m_K param 0.02\n@m_a osc 1. m_K 0.002 0. 0.\n@m_b mass 2. 0. 0.\n"
               "@g ground 0.\n@l springDamper @m_a @m_b 0.01 0.001\n"
               "@r springDamper @m_b @g 0.01 0.001\n"
               "@in1 frcInput @m_a\n@out1 posOutput @m_a\n");
    session.on_engine(
        [this](Engine& engine, const Network& network) { return motion.watch(engine, network); });
    REQUIRE(session.load_and_wait("two"));
    audio = std::thread([this] {
      std::vector<float> sound(256);
      while (!is_over.is_raised()) {
        float* const channel = sound.data();
        process.block(std::span<const float* const>(), std::span<float* const>(&channel, 1), 256,
                      {}, 0);
        std::this_thread::sleep_for(2ms);
      }
    });
    auto opened = OscServer::open_without_udp(process, session, {});
    REQUIRE(opened);
    osc = *std::move(opened);
    auto made = WebPanel::open(options, process, session, motion, *osc);
    REQUIRE(made);
    panel = *std::move(made);
    const std::string address = panel->address();
    const std::size_t colon = address.rfind(':', address.find("/?"));
    port = std::stoi(address.substr(colon + 1));
    token = address.substr(address.find('=') + 1);
    host = "127.0.0.1:" + std::to_string(port);
  }
  ~Stage() {
    session.end();
    panel.reset();
    is_over.raise();
    audio.join();
  }

  int connect() const {
    const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    REQUIRE(::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
    const timeval patience{20, 0};
    setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    return socket;
  }
  static void send(int socket, const std::string& text) {
    REQUIRE(::send(socket, text.data(), text.size(), MSG_NOSIGNAL) ==
            static_cast<ssize_t>(text.size()));
  }
  // Receives at most `most` bytes, or until the other side closes.
  static std::string receive(int socket, std::size_t most = 1 << 22) {
    std::string all;
    char bytes[4096];
    for (ssize_t got = 0; all.size() < most && (got = recv(socket, bytes, sizeof bytes, 0)) > 0;) {
      all.append(bytes, static_cast<std::size_t>(got));
    }
    return all;
  }
  std::string ask(const std::string& text) const {
    const int socket = connect();
    send(socket, text);
    std::string said = receive(socket);
    close(socket);
    return said;
  }
  int status(const std::string& text) const {
    const std::string said = ask(text);
    return said.starts_with("HTTP/1.1 ") ? std::stoi(said.substr(9, 3)) : -1;
  }
  std::string get(const std::string& path, const std::string& more = "") const {
    return "GET " + path + " HTTP/1.1\r\nHost: " + host + "\r\n" + more + "\r\n";
  }
  std::string post(const Bytes& packet, const std::string& more = "") const {
    return "POST /osc HTTP/1.1\r\nHost: " + host +
           "\r\nContent-Type: application/octet-stream\r\nContent-Length: " +
           std::to_string(packet.size()) + "\r\n" + more + "\r\n" +
           std::string(packet.begin(), packet.end());
  }
  static std::string body(const std::string& said) {
    return said.substr(said.find("\r\n\r\n") + 4);
  }

  DataFolder data;
  Process process{48000.0};
  Session session{process, {.compile = {.rate_hz = 48000.0}}, {}};
  MotionFeed motion{process};
  std::unique_ptr<OscServer> osc;
  std::unique_ptr<WebPanel> panel;
  int port = 0;
  std::string token;
  std::string host;
  Flag is_over;
  std::thread audio;
};

TEST_CASE("requests that a foreign page could make are refused", "[panel_http]") {
  const Stage stage;
  CHECK(stage.status(stage.get("/")) == 200);
  CHECK(stage.status(stage.get("/describe", "Origin: http://" + stage.host + "\r\n")) == 200);
  const auto with_host = [&](const std::string& host) {
    return stage.status("GET /describe HTTP/1.1\r\nHost: " + host + "\r\n\r\n");
  };
  for (const std::string& host :
       {std::string("evil.com"), "evil.com:" + std::to_string(stage.port), std::string("127.0.0.1"),
        stage.host + ".evil.com", std::string()}) {
    INFO(host);
    CHECK(with_host(host) == 403);
  }
  CHECK(stage.status("GET /describe HTTP/1.1\r\n\r\n") == 403);
  // Sent twice.
  CHECK(stage.status(stage.get("/describe", "Host: " + stage.host + "\r\n")) == 403);
  for (const std::string origin :
       {"http://evil.com", "null", "https://127.0.0.1", "http://127.0.0.1"}) {
    INFO(origin);
    for (const std::string path : {"/", "/describe", "/network", "/motion", "/events"}) {
      CHECK(stage.status(stage.get(path, "Origin: " + origin + "\r\n")) == 403);
    }
    CHECK(stage.status(stage.post(message("/panic"), "Origin: " + origin + "\r\n")) == 403);
  }
  CHECK(stage.status(stage.get("/describe", "Sec-Fetch-Site: cross-site\r\n")) == 403);
  CHECK(stage.status(stage.get("/describe", "Sec-Fetch-Site: same-site\r\n")) == 403);
  CHECK(stage.status(
            "OPTIONS /osc HTTP/1.1\r\nHost: " + stage.host +
            "\r\nOrigin: http://evil.com\r\nAccess-Control-Request-Method: POST\r\n\r\n") == 403);
  CHECK(stage.status("OPTIONS /osc HTTP/1.1\r\nHost: " + stage.host + "\r\n\r\n") == 405);
  CHECK(stage.status("DELETE / HTTP/1.1\r\nHost: " + stage.host + "\r\n\r\n") == 405);
  CHECK(stage.status(stage.get("/../../etc/passwd")) == 404);
  CHECK(stage.status(stage.get("/index.html")) == 404);
  const std::string page = stage.ask(stage.get("/"));
  CHECK(page.find("Content-Security-Policy: default-src 'self'") != page.npos);
  CHECK(page.find("X-Content-Type-Options: nosniff") != page.npos);
  CHECK(page.find("Access-Control") == page.npos);
  CHECK(page.find("Content-Type: text/html; charset=utf-8") != page.npos);
  CHECK(page.find("Set-Cookie") == page.npos);
}

// They are closed after idle_s without another byte; the page must not wait for that.
TEST_CASE("half-open connections do not keep the page away", "[panel_http]") {
  Stage stage;
  // The queue of the listening socket has room for all of them. Linux reports its length here.
  int queue = 0;
  for (int socket = 0; socket < 1024; ++socket) {
    sockaddr_in address{};
    socklen_t bytes = sizeof address;
    tcp_info info{};
    socklen_t info_bytes = sizeof info;
    if (getsockname(socket, reinterpret_cast<sockaddr*>(&address), &bytes) == 0 &&
        ntohs(address.sin_port) == stage.port &&
        getsockopt(socket, IPPROTO_TCP, TCP_INFO, &info, &info_bytes) == 0 &&
        info.tcpi_state == TCP_LISTEN) {
      queue = static_cast<int>(info.tcpi_sacked);
    }
  }
  CHECK(queue >= 300);
  std::vector<int> silent;
  for (int i = 0; i < 300; ++i) {
    silent.push_back(stage.connect());
    Stage::send(silent.back(), "GET / HTTP/1.1\r\n");
  }
  CHECK(stage.status(stage.get("/")) == 200);
  pollfd newest{silent.back(), POLLIN, 0};
  CHECK(poll(&newest, 1, 0) == 0);  // It is still open.
  for (const int socket : silent) {
    close(socket);
  }
}

TEST_CASE("a request body must have a known, small length", "[panel_http]") {
  const Stage stage;
  const std::string head = "POST /osc HTTP/1.1\r\nHost: " + stage.host + "\r\n";
  const std::string octets = "Content-Type: application/octet-stream\r\n";
  CHECK(stage.status(stage.post(message("/panic"))) == 200);
  for (const std::string type :
       {"text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x",
        "application/octet-stream; charset=x", "application/json", ""}) {
    INFO(type);
    CHECK(stage.status(head + "Content-Type: " + type + "\r\nContent-Length: 4\r\n\r\nabcd") ==
          415);
  }
  CHECK(stage.status(head + octets + "\r\n") == 411);
  CHECK(stage.status(head + octets + "Content-Length: -1\r\n\r\n") == 411);
  CHECK(stage.status(head + octets + "Content-Length: 4x\r\n\r\nabcd") == 411);
  CHECK(stage.status(head + octets + "Content-Length: 99999999999999999999\r\n\r\n") == 411);
  CHECK(stage.status(head + octets + "Content-Length: 65537\r\n\r\n") == 413);
  CHECK(stage.status(head + octets + "Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n") == 400);
  CHECK(stage.status(stage.post(message("/panic"), "Content-Encoding: gzip\r\n")) == 400);
  CHECK(stage.status(stage.get("/", "Range: bytes=0-1,0-1,0-1\r\n")) == 400);
  // An invalid body of the largest OSC packet size gets an error reply only.
  const std::string said = stage.ask(stage.post(Bytes(65507, 'x')));
  CHECK(said.find("/error") != said.npos);
}

TEST_CASE("a packet by HTTP acts like one by UDP", "[panel_http]") {
  Stage stage;
  CHECK(stage.status(stage.post(message("/param/m_K", {0.015f}))) == 200);
  CHECK(stage.session.parameter("m_K") == static_cast<double>(0.015f));
  const std::string asked = Stage::body(stage.ask(stage.post(message("/param/m_K"))));
  CHECK(asked.starts_with(std::string("#bundle\0", 8)));
  CHECK(asked.find("/param/m_K") != asked.npos);
  const std::string wrong = Stage::body(stage.ask(stage.post(message("/nonsense"))));
  CHECK(wrong.find("/error") != wrong.npos);
  // Other viewers receive one viewer's changes, and later failures as news.
  const int listener = stage.connect();
  Stage::send(listener, stage.get("/events"));
  std::string events;
  const auto hears = [&](const std::string& text) {
    for (int i = 0; i < 200 && events.find(text) == events.npos; ++i) {
      events += Stage::receive(listener, 1);
    }
    return events.find(text) != events.npos;
  };
  CHECK(hears("event: loaded\ndata: {\"name\":\"two\""));
  CHECK(hears("event: values"));
  CHECK(hears("\"m_K\":0.01499"));
  CHECK(hears("event: status"));
  CHECK(stage.status(stage.post(message("/model/load", {std::string("no such model")}))) == 200);
  CHECK(hears("event: news"));
  stage.panel->show_message("a \"quoted\"\nline");
  CHECK(hears(R"(data: "a \"quoted\"\nline")"));
  close(listener);
}

TEST_CASE("the drawing has positions, and four viewers can watch", "[panel_http]") {
  const Stage stage;
  const auto network = nlohmann::json::parse(Stage::body(stage.ask(stage.get("/network"))));
  CHECK(network["dots"] == 2);
  CHECK(network["x"].size() == 3);  // Two masses and a ground.
  CHECK(network["links"].size() == 2);
  CHECK(network["inputs"][0][0] == 1);
  const auto modes = nlohmann::json::parse(Stage::body(stage.ask(stage.get("/modes?count=9"))));
  REQUIRE(modes["modes"].size() == 2);
  CHECK(modes["modes"][0]["shape"].size() == 2);
  std::vector<int> viewers;
  for (int i = 0; i < WebPanel::most_viewers; ++i) {
    viewers.push_back(stage.connect());
    Stage::send(viewers.back(), stage.get("/motion?hz=60"));
    const std::string first = Stage::receive(viewers.back(), 4000);
    CHECK(first.starts_with("HTTP/1.1 200"));
    CHECK(first.find("Content-Type: application/octet-stream") != first.npos);
  }
  CHECK(stage.status(stage.get("/motion")) == 503);
  CHECK(stage.status(stage.get("/describe")) == 200);  // All other requests are served.
  close(viewers.back());
  viewers.pop_back();
  int status = 503;
  for (int i = 0; i < 500 && status == 503; ++i) {
    const int again = stage.connect();
    Stage::send(again, stage.get("/motion"));
    status = std::stoi(Stage::receive(again, 1).substr(9, 3));
    close(again);
    std::this_thread::sleep_for(10ms);
  }
  CHECK(status == 200);
  for (const int viewer : viewers) {
    close(viewer);
  }
}

TEST_CASE("the addresses of OSC are a tree that OSCQuery programs read", "[panel_http]") {
  Stage stage;
  const auto ask = [&](const std::string& path) {
    return stage.ask("GET " + path + " HTTP/1.1\r\nHost: " + stage.host +
                     "\r\nAccept: application/json\r\n\r\n");
  };
  const auto read = [&](const std::string& path) {
    return nlohmann::json::parse(Stage::body(ask(path)));
  };
  const auto root = read("/");
  CHECK(root["FULL_PATH"] == "/");
  CHECK(root["CONTENTS"]["note"]["CONTENTS"]["on"]["TYPE"] == "fff");
  CHECK(root["CONTENTS"]["panic"]["TYPE"] == "N");
  CHECK(root["CONTENTS"]["in"]["CONTENTS"]["1"]["CONTENTS"].contains("force"));
  CHECK_FALSE(root["CONTENTS"]["in"]["CONTENTS"]["1"]["CONTENTS"].contains("position"));
  // Every node states its path, and that path returns the same node.
  const std::function<std::size_t(const nlohmann::json&)> visit =
      [&](const nlohmann::json& node) -> std::size_t {
    const auto path = node.at("FULL_PATH").get<std::string>();
    if (path != "/describe" && path != "/modes") {  // The page requests these itself.
      CHECK(read(path) == node);
    }
    std::size_t count = 1;
    if (node.contains("CONTENTS")) {
      for (const auto& child : node["CONTENTS"]) {
        count += visit(child);
      }
    }
    return count;
  };
  CHECK(visit(root) > 30);
  CHECK(stage.status(stage.post(message("/param/m_K", {0.5f}))) == 200);
  const auto parameter = read("/param/m_K");
  CHECK(parameter["TYPE"] == "f");
  CHECK(parameter["ACCESS"] == 3);
  CHECK(parameter["VALUE"][0] == stage.session.parameter("m_K"));
  CHECK(parameter["RANGE"][0]["MAX"] == stage.session.current()->instrument.parameters[0].maximum);
  CHECK(read("/param/m_K?VALUE") == nlohmann::json{{"VALUE", parameter["VALUE"]}});
  CHECK(ask("/param?VALUE").starts_with("HTTP/1.1 204"));
  CHECK(ask("/param/nothing").starts_with("HTTP/1.1 404"));
  CHECK(read("/?HOST_INFO")["NAME"] == "ressort");
  CHECK_FALSE(read("/?HOST_INFO").contains("OSC_PORT"));  // This server does not listen on UDP.
}

TEST_CASE("remote clients need the token", "[panel_http]") {
  const Stage stage({.bind_address = "0.0.0.0"});
  CHECK(stage.panel->is_for_all());
  CHECK(stage.status(stage.get("/")) == 403);
  CHECK(stage.status(stage.get("/?token=0123")) == 403);
  CHECK(stage.status(stage.get("/describe", "Cookie: ressort=0123\r\n")) == 403);
  CHECK(stage.status(stage.post(message("/panic"))) == 403);
  const std::string page = stage.ask(stage.get("/?token=" + stage.token));
  CHECK(page.starts_with("HTTP/1.1 200"));
  CHECK(page.find("Set-Cookie: ressort=" + stage.token + "; HttpOnly; SameSite=Strict") !=
        page.npos);
  CHECK(stage.status(stage.get("/describe", "Cookie: ressort=" + stage.token + "\r\n")) == 200);
  CHECK(stage.status("GET /?token=" + stage.token + " HTTP/1.1\r\nHost: evil.com:" +
                     std::to_string(stage.port) + "\r\n\r\n") == 403);
}

TEST_CASE("a port in use is an error, and streams end with the panel", "[panel_http]") {
  auto stage = std::make_unique<Stage>();
  const auto second = WebPanel::open({.port = stage->port}, stage->process, stage->session,
                                     stage->motion, *stage->osc);
  REQUIRE_FALSE(second);
  CHECK(second.error().message.find(std::to_string(stage->port)) != std::string::npos);
  const int viewer = stage->connect();
  Stage::send(viewer, stage->get("/motion?hz=1"));
  Stage::receive(viewer, 300);
  const int idler = stage->connect();  // A client that sends no request.
  Stage::send(idler, "GET / HT");
  auto ended = std::async(std::launch::async, [&] { stage.reset(); });
  CHECK(ended.wait_for(std::chrono::seconds(60)) == std::future_status::ready);
  CHECK(Stage::receive(viewer).size() < 1 << 22);  // Until the stream ends.
  close(viewer);
  close(idler);
}

TEST_CASE("the page is small, complete and loads nothing external", "[panel_http]") {
  std::size_t bytes = 0;
  std::set<std::string_view> paths;
  for (const PageFile& file : page_files()) {
    bytes += file.text.size();
    paths.insert(file.path);
    CHECK(file.text.find("http://www.w3.org") ==
          (file.path == "/icon.svg" ? file.text.find("http") : std::string_view::npos));
    CHECK(file.text.find("https://") == std::string_view::npos);
  }
  CHECK(bytes < 60'000);
  CHECK(paths ==
        std::set<std::string_view>{"/", "/panel.css", "/panel.js", "/draw.js", "/icon.svg"});
}

}  // namespace
}  // namespace ressort::panel_http_test
