// The panel without a browser: what it draws against what is rendered, and who is let in, by bytes
// on a socket. What a browser does with it: tests/panel.
#include "app/panel/panel.h"

#include <arpa/inet.h>
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

namespace ressort {
namespace {

using namespace support;
using namespace std::chrono_literals;

// --- what is drawn ------------------------------------------------------------------------------

struct Scene {
  const char* name;
  std::string text;
  std::vector<std::string> heard;  // masses, output 1 on
};

std::vector<Scene> scenes_with_taps() {
  const auto with_taps = [](Scene scene) {
    for (std::size_t i = 0; i < scene.heard.size(); ++i) {
      scene.text += scenes::output(static_cast<int>(i) + 1, scene.heard[i]);
    }
    return scene;
  };
  // Masses of two kinds, so that modes are scaled by their roots; and one that starts away from 0.
  const std::string uneven =
      "@g ground 0.\n@a mass 1. 0. 0.\n@b mass 3. 0.2 0.2\n@c mass 2. 0. 0.\n@h ground 0.\n"
      "@k1 springDamper @g @a 0.05 0.001\n@k2 springDamper @a @b 0.1 0.001\n"
      "@k3 springDamper @b @c 0.07 0.001\n@k4 springDamper @c @h 0.05 0.001\n"
      "@in1 frcInput @a\n";
  const std::string beaten = ringing_string().substr(0, ringing_string().rfind("@out1")) +
                             "@w mass 5. 0.01 0.01\n@c1 contact @w @s_m4 0.05 0.001 0.\n";
  return {with_taps({"string",
                     scenes::string("s", 12, "0.1", "0.0005") + "@in1 frcInput @s_m2\n",
                     {"s_m1", "s_m2", "s_m6", "s_m9"}}),
          with_taps({"uneven masses", uneven, {"a", "b", "c"}}),
          with_taps({"contact", beaten, {"s_m1", "s_m4", "s_m8", "w"}}),
          {"places on waveguides and a mass",
           "@s waveguide 1. 220. 3. 0.4 0.1\n@t openWaveguide 0.5 110. 3. 0.6 0.\n"
           "@w mass 3. 0. 0.\n@b springDamper [@s 0.9] [@t 0.3] 0.2 0.01\n"
           "@h springDamper @w [@s 0.6] 0.05 0.001\n@in1 frcInput [@s 0.2]\n"
           "@out1 posOutput [@s 0.2]\n@out2 posOutput [@s 0.9]\n@out3 posOutput [@t 0.3]\n"
           "@out4 posOutput @w\n",
           {"s:0.2", "s:0.9", "t:0.3", "w"}},
          {"places on a body",
           "@bell body 40. rim waist crown\n@b1 mode @bell 310.7 4.2 1. -0.61 0.02\n"
           "@b2 mode @bell 601.2 1.3 0.8 0.35 0.9\n@b3 mode @bell 1533. 0.5 -0.3 0.5 1.4\n"
           "@in1 frcInput [@bell rim]\n@out1 posOutput [@bell rim]\n"
           "@out2 posOutput [@bell crown]\n@out3 posOutput [@bell 0.25]\n",
           {"bell:rim", "bell:crown", "bell:0.25"}}};
}

TEST_CASE("what is drawn is where the render hears it, whatever computes it", "[panel]") {
  std::set<Method> seen;
  for (const Scene& scene : scenes_with_taps()) {
    const Network network = network_of(scene.text);
    for (const auto use : {KernelRow::Use::published, KernelRow::Use::physical}) {
      for (const Method method : methods_for(use)) {
        for (const Precision precision : {Precision::float64, Precision::float32}) {
          Player player(scene.text, struck(1), {.precision = precision, .method = method});
          seen.insert(player.compiled.plan.parts[0].method);
          const Picture picture = make_picture(player.engine(), network, 1);
          player.run(64);
          player.run(1000 + 37, {note_on(0, 69)}, {256, 37});
          MotionFrame frame;
          frame.count = player.engine().look(frame.numbers);
          std::vector<float> positions(picture.masses.size());
          find_positions(picture, frame, positions);
          INFO(scene.name << " by " << method_name(method));
          double most = 0.0;
          for (std::size_t i = 0; i < scene.heard.size(); ++i) {
            const auto dot =
                std::find_if(picture.masses.begin(), picture.masses.end(), [&](std::uint32_t mass) {
                  return mass != Picture::no_mass && struck_name(network, mass) == scene.heard[i];
                });
            REQUIRE(dot != picture.masses.end());
            const double shown = positions[static_cast<std::size_t>(dot - picture.masses.begin())];
            most = std::max(most, std::fabs(player.out[i].back()));
            CHECK(std::fabs(shown - player.out[i].back()) < 1e-6);
          }
          CHECK(most > 1e-3);  // it moves: 0 = 0 would prove nothing
        }
      }
    }
  }
  CHECK(seen.contains(Method::direct));
  CHECK(seen.contains(Method::modal));
  CHECK(seen.size() >= 4);
}

TEST_CASE("of a large network so many masses are drawn as there is room for", "[panel]") {
  const std::string text = "@s string 5000 1. 0.1 0.0001 0 0\n" +
                           std::string("@in1 frcInput [@s 0.3]\n@out1 posOutput [@s 0.3]\n");
  Player player(text, struck(1), {.method = Method::direct});
  const Picture picture = make_picture(player.engine(), network_of(text), 7);
  CHECK(picture.number == 7);
  CHECK(picture.masses.size() > most_dots / 2);
  CHECK(picture.masses.size() <= most_dots);
  player.run(200, {note_on(0, 69)});
  MotionFrame frame;
  frame.count = player.engine().look(frame.numbers);
  CHECK(frame.count == picture.masses.size());
}

// A blow as soft as half a period of 80 Hz, on a string whose waves nothing damps: what is drawn
// between its places is where places would be that hold nothing. A sample to either side is what a
// place's own rounding is worth, and a straight line has a thirty-second of the string.
TEST_CASE("a waveguide is drawn where places between its places are heard", "[panel]") {
  for (const std::string kind : {"waveguide", "openWaveguide"}) {
    const std::string text = "@s " + kind + " 1. 55. 1000. 1. 0.1\n@out1 posOutput [@s 0.23]\n" +
                             "@out2 posOutput [@s 0.81]\n";
    std::string probed = text;
    for (std::size_t i = 1; i + 1 < Engine::waveguide_points; ++i) {
      probed += "@out" + std::to_string(i + 2) + " posOutput [@s " +
                std::to_string(static_cast<double>(i) / 32.0) + "]\n";
    }
    const CompileOptions bare{.rate_hz = 48000.0, .bare = true, .method = Method::direct};
    Player drawn(text, Preset(), bare);
    Player heard(probed, Preset(), bare);
    const Picture picture = make_picture(drawn.engine(), network_of(text), 1);
    REQUIRE(picture.masses.size() == 2 + Engine::waveguide_points);
    REQUIRE(picture.groups[0].waveguides.size() == 1);
    const Picture::Waveguide& waveguide = picture.groups[0].waveguides[0];
    CHECK(waveguide.first == 2);
    const auto blow = [&](const Player& player) {
      const auto& struck = player.compiled.instrument.struck;
      const auto at = std::find_if(struck.begin(), struck.end(),
                                   [](const StruckInfo& info) { return info.name == "s:0.23"; });
      REQUIRE(at != struck.end());
      std::vector<Event> events;
      for (std::uint32_t n = 0; n < 300; ++n) {
        events.push_back({.frame = n,
                          .kind = EventKind::strike,
                          .value = 1e-3 * (1.0 - std::cos(2.0 * std::numbers::pi * n / 300.0)),
                          .value2 = static_cast<double>(at->first)});
      }
      return events;
    };
    drawn.run(300, blow(drawn));
    heard.run(300, blow(heard));
    double most = 0.0;
    double apart = 0.0;
    double straight = 0.0;  // as far as a string is off that is drawn at its places alone
    for (int time = 0; time < 40; ++time) {
      drawn.run(97);
      heard.run(97);
      MotionFrame frame;
      frame.count = drawn.engine().look(frame.numbers);
      std::vector<float> positions(picture.masses.size());
      find_positions(picture, frame, positions);
      const auto here = [&](double u) {
        const std::array<std::pair<double, double>, 4> at = {
            {{0.0, 0.1}, {0.23, positions[0]}, {0.81, positions[1]}, {1.0, 0.1}}};
        std::size_t k = 0;
        while (at[k + 1].first < u) {
          ++k;
        }
        return at[k].second + (u - at[k].first) / (at[k + 1].first - at[k].first) *
                                  (at[k + 1].second - at[k].second);
      };
      for (std::size_t i = 1; i + 1 < Engine::waveguide_points; ++i) {
        const double there = heard.out[i + 1].back();
        most = std::max(most, std::fabs(there - 0.1));
        apart = std::max(apart, std::fabs(there - positions[waveguide.first + i]));
        straight = std::max(straight, std::fabs(there - here(static_cast<double>(i) / 32.0)));
      }
    }
    INFO(kind << ": " << apart / most << " of the greatest swing, straight lines "
              << straight / most);
    CHECK(apart < 0.02 * most);
    CHECK(straight > 0.3 * most);
  }
}

TEST_CASE("a look changes no bit of the sound and takes no memory", "[panel]") {
  const std::string waveguides =
      "@s waveguide 1. 220. 3. 0.4 0.\n@t openWaveguide 0.5 110. 3. 0.6 0.\n"
      "@b springDamper [@s 0.9] [@t 0.3] 0.2 0.01\n@in1 frcInput [@s 0.2]\n"
      "@out1 posOutput [@s 0.2]\n";
  const std::pair<std::string, Method> scenes[] = {{ringing_string(), Method::direct},
                                                   {ringing_string(), Method::modal},
                                                   {waveguides, Method::direct}};
  for (const auto& scene : scenes) {
    const std::string& text = scene.first;
    const Method method = scene.second;
    Harness plain(true, 2);
    Harness watched(true, 2);
    int looks = 0;
    for (Harness* const harness : {&plain, &watched}) {
      auto compiled = compile(network_of(text), struck(4), {.method = method});
      REQUIRE(compiled);
      const Picture picture = make_picture(*compiled->engine, network_of(text), 3);
      delete harness->process.slot.offer(new Sounding{
          .engine = std::move(compiled->engine), .serial = 1, .picture = picture.number});
      for (int i = 0; i < 400; ++i) {
        if (i % 40 == 0) {
          harness->now(note_on(0, 50 + i / 40));
        }
        if (harness == &watched && i % 3 != 0) {
          (i % 2 == 0 ? harness->process.wants_motion : harness->process.wants_slow_motion).raise();
        }
        harness->run(static_cast<std::size_t>(17 + i % 200), 64);
        if (harness->process.motion.take()) {
          ++looks;
          const MotionFrame& frame = harness->process.motion.reading();
          CHECK(frame.picture == 3);
          CHECK(frame.frame <= harness->played);
        }
      }
    }
    CHECK(looks > 20);
    CHECK(plain.out == watched.out);
    CHECK(peak(plain.y()) > 1e-3);
    CHECK(watched.heap_calls == 0);
    // The newest frame brings the sound as it was played.
    watched.process.wants_motion.raise();
    watched.run(static_cast<std::size_t>(2.0 * Process::longest_strobe_s * rate), 64);
    watched.process.motion.take();
    watched.process.wants_motion.raise();
    watched.run(64, 64);
    REQUIRE(watched.process.motion.take());
    const auto& heard = watched.process.motion.reading().heard;
    for (std::size_t i = 0; i < heard.size(); ++i) {
      const std::size_t at = watched.played - heard.size() + i;
      REQUIRE(heard[i] == static_cast<float>(0.5 * (watched.out[0][at] + watched.out[1][at])));
    }
  }
}

TEST_CASE("slow motion is a stroboscope at the pitch that sounds", "[panel]") {
  for (const int key : {45, 57, 69, 76}) {
    Harness harness(false, 1);
    const std::string text = ringing_string();
    auto compiled = compile(network_of(text), struck(2), {});
    REQUIRE(compiled);
    const Picture picture = make_picture(*compiled->engine, network_of(text), 1);
    delete harness.process.slot.offer(new Sounding{
        .engine = std::move(compiled->engine), .serial = 1, .picture = picture.number});
    harness.now(note_on(0, key));
    const double hz = 440.0 * std::exp2((key - 69) / 12.0);
    int frames = 0;
    int at_their_moment = 0;
    const auto heard_at = static_cast<std::size_t>(
        std::find_if(picture.masses.begin(), picture.masses.end(),
                     [&](std::uint32_t mass) {
                       return network_of(text).masses[mass].name == Name("s_m6");
                     }) -
        picture.masses.begin());
    for (int block = 0; block < 1500; ++block) {
      harness.process.wants_slow_motion.raise();
      harness.run(64, 64);
      if (!harness.process.motion.take() || block < 40) {
        continue;
      }
      ++frames;
      const MotionFrame& frame = harness.process.motion.reading();
      const double seconds = static_cast<double>(frame.frame) / rate;
      const double apart = seconds * (hz - 1.0 / Engine::strobe_period_s);
      at_their_moment += std::fabs(apart - std::rint(apart)) < 0.021 ? 1 : 0;
      std::vector<float> positions(picture.masses.size());
      find_positions(picture, frame, positions);
      REQUIRE(std::fabs(positions[heard_at] - harness.y().back()) < 1e-6);
    }
    INFO(key << ": " << at_their_moment << " of " << frames);
    CHECK(frames > 30);
    CHECK(at_their_moment >= 9 * frames / 10);
  }
  // Where nothing has a pitch it shows what there is, at once.
  Harness silent(false, 1);
  delete silent.process.slot.offer(constant("0.5"));
  silent.process.wants_slow_motion.raise();
  silent.run(64, 64);
  CHECK(silent.process.motion.take());
}

// --- who is let in ------------------------------------------------------------------------------

TEST_CASE("hosts and origins are compared whole", "[panel]") {
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

TEST_CASE("tokens are random, and compared whole", "[panel]") {
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
    auto opened = OscServer::open_unheard(process, session, {});
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
  // At most so many bytes, or until the other side has said all.
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

TEST_CASE("a request that a page from elsewhere could make is refused", "[panel]") {
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
  CHECK(stage.status(stage.get("/describe", "Host: " + stage.host + "\r\n")) == 403);  // twice
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

TEST_CASE("a body is bytes of a known and small length", "[panel]") {
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
  // No longer than any packet of OSC, and rubbish: an answer that says so, and nothing else.
  const std::string said = stage.ask(stage.post(Bytes(65507, 'x')));
  CHECK(said.find("/error") != said.npos);
}

TEST_CASE("a packet by HTTP does what it does by UDP", "[panel]") {
  Stage stage;
  CHECK(stage.status(stage.post(message("/param/m_K", {0.015f}))) == 200);
  CHECK(stage.session.parameter("m_K") == static_cast<double>(0.015f));
  const std::string asked = Stage::body(stage.ask(stage.post(message("/param/m_K"))));
  CHECK(asked.starts_with(std::string("#bundle\0", 8)));
  CHECK(asked.find("/param/m_K") != asked.npos);
  const std::string wrong = Stage::body(stage.ask(stage.post(message("/nonsense"))));
  CHECK(wrong.find("/error") != wrong.npos);
  // What one says the others hear; and what fails later is told as news.
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
  stage.panel->tell("a \"quoted\"\nline");
  CHECK(hears(R"(data: "a \"quoted\"\nline")"));
  close(listener);
}

TEST_CASE("what is drawn comes with its places, and four may watch", "[panel]") {
  const Stage stage;
  const auto network = nlohmann::json::parse(Stage::body(stage.ask(stage.get("/network"))));
  CHECK(network["dots"] == 2);
  CHECK(network["x"].size() == 3);  // and a ground
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
  CHECK(stage.status(stage.get("/describe")) == 200);  // all others are served
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

TEST_CASE("the addresses of OSC are a tree that OSCQuery programs read", "[panel]") {
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
  // Every node says where it is, and where it is it says the same.
  const std::function<std::size_t(const nlohmann::json&)> visit =
      [&](const nlohmann::json& node) -> std::size_t {
    const auto path = node.at("FULL_PATH").get<std::string>();
    if (path != "/describe" && path != "/modes") {  // these the page asks for
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
  CHECK_FALSE(read("/?HOST_INFO").contains("OSC_PORT"));  // this one is not heard by UDP
}

TEST_CASE("beyond this machine nobody gets in without the token", "[panel]") {
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

TEST_CASE("a port that is taken is an error, and streams end when the panel does", "[panel]") {
  auto stage = std::make_unique<Stage>();
  const auto second = WebPanel::open({.port = stage->port}, stage->process, stage->session,
                                     stage->motion, *stage->osc);
  REQUIRE_FALSE(second);
  CHECK(second.error().message.find(std::to_string(stage->port)) != std::string::npos);
  const int viewer = stage->connect();
  Stage::send(viewer, stage->get("/motion?hz=1"));
  Stage::receive(viewer, 300);
  const int idler = stage->connect();  // says nothing
  Stage::send(idler, "GET / HT");
  auto ended = std::async(std::launch::async, [&] { stage.reset(); });
  CHECK(ended.wait_for(std::chrono::seconds(60)) == std::future_status::ready);
  CHECK(Stage::receive(viewer).size() < 1 << 22);  // to its end
  close(viewer);
  close(idler);
}

TEST_CASE("the page is small, whole and asks nobody else", "[panel]") {
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
}  // namespace ressort
