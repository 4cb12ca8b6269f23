// Operations that are forbidden in the callback, counted by an interposed library in the running
// program.
#include <netinet/in.h>
#include <sys/socket.h>

#include <cstdio>
#include <map>
#include <memory>

#include "tests/system/played.h"

namespace ressort::servers::callback_test {

namespace {

// Watches the panel's motion sixty times a second while it lives.
class Viewer {
 public:
  explicit Viewer(std::uint16_t port) : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    REQUIRE(connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
    const std::string wish =
        "GET /motion?hz=60 HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) + "\r\n\r\n";
    REQUIRE(send(socket_, wish.data(), wish.size(), MSG_NOSIGNAL) ==
            static_cast<ssize_t>(wish.size()));
    reader_ = std::thread([this] {
      std::vector<char> bytes(1 << 16);
      for (ssize_t got = 0; (got = recv(socket_, bytes.data(), bytes.size(), 0)) > 0;) {
        seen_ += static_cast<std::size_t>(got);
      }
    });
  }
  ~Viewer() {
    shutdown(socket_, SHUT_RDWR);
    reader_.join();
    close(socket_);
  }
  std::size_t seen() const { return seen_; }  // bytes

 private:
  int socket_;
  std::atomic<std::size_t> seen_ = 0;
  std::thread reader_;
};

}  // namespace

TEST_CASE("The callback never allocates, locks, reads, writes or waits", "[callback]") {
  const std::string report = "/tmp/ressort-spy-" + std::to_string(getpid());
  const auto counts = [&] {
    std::map<std::string, unsigned long> found;
    std::ifstream file(report);
    std::string name;
    for (unsigned long n = 0; file >> name >> n;) {
      found[name] = n;
    }
    std::remove(report.c_str());
    return found;
  };
  const Server server(256);

  SECTION("the interposed library counts a provoked allocation") {
    {
      Child play(program({"play", "PolyTriangle", "-a", "jack", "-i", "-u", osc_port}),
                 {{"LD_PRELOAD", RESSORT_SPY}, {"RTSPY_OUT", report}, {"RTSPY_PROVOKE", "1"}});
      REQUIRE(answers());
      std::this_thread::sleep_for(200ms);
      play.signal(SIGTERM);
      CHECK(play.exit_code() == 0);
    }
    auto found = counts();
    CHECK(found["callbacks"] > 10);
    CHECK(found["allocations"] >= found["callbacks"]);
    CHECK(found["releases"] >= found["callbacks"]);
  }

  SECTION("notes, controllers, floods, sweeps and swaps with four viewers") {
    const char* const asked = std::getenv("RESSORT_CALLBACK_SECONDS");
    const std::size_t frames =
        48000 * static_cast<std::size_t>(asked != nullptr ? atoi(asked) : 15);
    const char* const scenes[] = {"IPlayTheTriangle", "PolyTriangle",     "PluckedHarmonics",
                                  "BowedString",      "PhysicalLFO",      "Resonator",
                                  "20x30mesh",        "LargeTriangleMesh"};
    {
      Child play(program({"play", "PolyTriangle", "-a", "jack", "-u", osc_port, "--web", "9790"}),
                 {{"LD_PRELOAD", RESSORT_SPY}, {"RTSPY_OUT", report}});
      REQUIRE(answers());
      REQUIRE(play.says("panel: http://127.0.0.1:9790/?token="));
      std::vector<std::unique_ptr<Viewer>> viewers;
      for (int i = 0; i < 4; ++i) {
        viewers.push_back(std::make_unique<Viewer>(static_cast<std::uint16_t>(9790)));
      }
      Listener listener(frames + 48000 * 10);
      std::vector<Listener::Message> messages;
      unsigned state = 1;
      const auto random = [&](unsigned below) {
        state = state * 1664525u + 1013904223u;
        return static_cast<unsigned char>((state >> 16) % below);
      };
      for (std::size_t frame = 4800; frame < frames; frame += 600 + random(255) * 4u) {
        const unsigned char key = static_cast<unsigned char>(40 + random(50));
        messages.push_back({frame, {0x90, key, static_cast<unsigned char>(1 + random(127))}});
        messages.push_back({frame + 100, {0xb0, random(120), random(128)}});
        messages.push_back({frame + 150, {0xe0, random(128), random(128)}});
        messages.push_back({frame + 200, {0xd0, random(128), 0}});
        messages.push_back({frame + 500, {0x80, key, 0}});
      }
      listener.plan(messages);
      listener.start("ressort:out_left", "ressort:midi_in");
      const auto most_rounds =
          static_cast<int>(frames / 1920);  // a busy program may drop its listener for good
      for (int round = 0; listener.frames() < frames && round < most_rounds; ++round) {
        for (int i = 0; i < 200; ++i) {
          lo_send(osc(), "/param/*", "f", 0.05f + 0.0005f * static_cast<float>(i));
          lo_send(osc(), "/in/1/position", "f", 0.01f * static_cast<float>(i % 10));
          lo_send(osc(), "/in/1/force", "ff", 0.001f, 0.01f);
          lo_send(osc(), "/nonsense", "s", "x");
        }
        lo_send(osc(), "/model/load", "s",
                scenes[static_cast<std::size_t>(round) % std::size(scenes)]);
        play.write("set m_K 0.1\nnoteon 60\npluck\nstatus\n");
        play.forget();
        std::this_thread::sleep_for(100ms);
      }
      CHECK(listener.frames() >= frames);
      for (const auto& viewer : viewers) {
        CHECK(viewer->seen() > frames / 3);  // bytes
      }
      play.signal(SIGTERM);
      CHECK(play.exit_code() == 0);
    }
    auto found = counts();
    CHECK(found["callbacks"] > frames / 300);
    for (const char* kind :
         {"allocations", "releases", "locks", "reads", "writes", "waits", "others"}) {
      INFO(kind);
      CHECK(found[kind] == 0);
    }
    std::printf("%lu callbacks, nothing forbidden in any\n", found["callbacks"]);
  }
}

TEST_CASE("Helpers add no system call to the callback", "[callback]") {
  const std::string report = "/tmp/ressort_spy_helpers_" + std::to_string(getpid());
  const Server server(256);
  {
    Child play(program({"play", "LargeTriangleMesh", "-a", "jack", "-i", "-u", osc_port, "-p", "8",
                        "--threads", "2"}),
               {{"LD_PRELOAD", RESSORT_SPY}, {"RTSPY_OUT", report}});
    REQUIRE(answers());
    Listener listener(48000 * 6);
    std::vector<Listener::Message> messages;
    for (unsigned n = 0; n < 40; ++n) {
      const auto key = static_cast<unsigned char>(40 + n * 5 % 37);
      messages.push_back({4800 + 6000 * n, {0x90, key, 100}});
      messages.push_back({4800 + 6000 * n + 3000, {0xb0, 16, static_cast<unsigned char>(n)}});
    }
    listener.plan(messages);
    listener.start("ressort:out_left", "ressort:midi_in");
    REQUIRE(listener.wait_for(48000 * 6));
    play.signal(SIGTERM);
    CHECK(play.exit_code() == 0);
  }
  std::ifstream file(report);
  std::string name;
  std::map<std::string, unsigned long> found;
  for (unsigned long n = 0; file >> name >> n;) {
    found[name] = n;
  }
  std::remove(report.c_str());
  CHECK(found["callbacks"] > 500);
  for (const char* kind :
       {"allocations", "releases", "locks", "reads", "writes", "waits", "others"}) {
    INFO(kind);
    CHECK(found[kind] == 0);
  }
}

}  // namespace ressort::servers::callback_test
