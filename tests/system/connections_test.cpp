// Connections, ports and servers that come and go while the program plays.
#include <jack/metadata.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <thread>

#include "tests/system/played.h"

namespace ressort::servers::connections_test {

TEST_CASE("An unplugged keyboard is reconnected by its name", "[jack_midi]") {
  const Server server(256);
  Child play(program({"play", click(), "-a", "jack", "-i", "-u", osc_port}));
  REQUIRE(answers());
  for (int time = 0; time < 2; ++time) {
    {
      const Neighbour keyboard;
      INFO("time " << time);
      if (time == 0) {
        REQUIRE(keyboard.connect("neighbour:keys", "ressort:midi_in"));
      } else {
        REQUIRE(
            eventually([&] { return keyboard.is_connected("neighbour:keys", "ressort:midi_in"); }));
      }
      std::this_thread::sleep_for(1500ms);
    }
    std::this_thread::sleep_for(1500ms);  // longer than a reconnection takes
  }
}

// The keyboard leaves and returns between two updates, unlike a connection that a person removes.
TEST_CASE("A keyboard that returns at once is reconnected too", "[jack_midi]") {
  const Server server(256);
  Child play(program({"play", click(), "-a", "jack", "-i", "-u", osc_port}));
  REQUIRE(answers());
  auto keyboard = std::make_unique<Neighbour>();
  REQUIRE(keyboard->connect("neighbour:keys", "ressort:midi_in"));
  for (int time = 0; time < 4; ++time) {
    INFO("time " << time);
    std::this_thread::sleep_for(
        std::chrono::milliseconds(1500 + 17 * time));  // so that the connection is seen
    keyboard.reset();
    keyboard = std::make_unique<Neighbour>();
    REQUIRE(
        eventually([&] { return keyboard->is_connected("neighbour:keys", "ressort:midi_in"); }));
  }
  std::this_thread::sleep_for(1500ms);
  keyboard->disconnect("neighbour:keys", "ressort:midi_in");
  std::this_thread::sleep_for(1500ms);
  CHECK_FALSE(keyboard->is_connected("neighbour:keys", "ressort:midi_in"));
}

TEST_CASE("Ports have names and an order", "[jack_midi]") {
  const Server server(256);
  Child play(program({"play", "Resonator", "-a", "jack", "-i", "-u", osc_port}));
  REQUIRE(answers());
  jack_client_t* const client = jack_client_open("reader", JackNoStartServer, nullptr);
  REQUIRE(client != nullptr);
  const auto property = [&](const char* port, const char* key) {
    char* value = nullptr;
    char* type = nullptr;
    const jack_port_t* const found = jack_port_by_name(client, port);
    REQUIRE(found != nullptr);
    const std::string text =
        jack_get_property(jack_port_uuid(found), key, &value, &type) == 0 ? value : "none";
    jack_free(value);
    jack_free(type);
    return text;
  };
  const char* const order = "http://jackaudio.org/metadata/order";
  CHECK(property("ressort:out_left", JACK_METADATA_PRETTY_NAME) == "Left");
  CHECK(property("ressort:out_right", order) == "1");
  CHECK(property("ressort:midi_in", JACK_METADATA_PRETTY_NAME) == "MIDI");
  CHECK(property("ressort:out_left", JACK_METADATA_PORT_GROUP) == "Outputs");
  jack_client_close(client);
}

TEST_CASE("A server without outputs is told to those who ask for a connection", "[server_loss]") {
  for (const int speakers : {2, 0}) {
    const Server server(256, 48000, true, speakers);
    Child play(program({"play", "PolyTriangle", "-a", "jack", "-i", "-u", osc_port, "--connect"}));
    REQUIRE(answers());
    CHECK((play.said().find("found no physical outputs") != std::string::npos) == (speakers == 0));
    play.signal(SIGTERM);
    CHECK(play.exit_code() == 0);
  }
}

TEST_CASE("The program survives the end of its server, or reports it by the exit code",
          "[server_loss]") {
  auto server = std::make_unique<Server>(256);

  SECTION("it waits and continues on the next server") {
    Child play(program({"play", "PolyTriangle", "-a", "jack", "-i", "-u", osc_port}));
    REQUIRE(answers());
    server->kill();
    REQUIRE(play.says("is lost"));
    server.reset();
    server = std::make_unique<Server>(512, 48000, false);
    REQUIRE(play.says("playing again"));
    Listener listener(48000 * 20);
    listener.plan({{9600, {0x90, 60, 110}}});
    listener.start("ressort:out_left", "ressort:midi_in");
    REQUIRE(listener.wait_for(24000));
    CHECK(listener.onset(9600, 24000, 0.01f) < 24000);
    play.signal(SIGTERM);
    CHECK(play.exit_code() == 0);
  }

  SECTION("connections made by hand are restored on servers of any kind") {
    using Cable = std::pair<std::string, std::string>;
    const std::vector<Cable> kept{{"ressort:out_left", "neighbour:left"},
                                  {"ressort:out_right", "neighbour:left"},
                                  {"ressort:out_right", "system:playback_2"},
                                  {"neighbour:keys", "ressort:midi_in"},
                                  {"neighbour:sound", "ressort:in_1"}};
    const Cable pulled{"ressort:out_left", "neighbour:right"};
    const Cable pulled_from_speaker{"ressort:out_left", "system:playback_1"};
    // -j connects the speakers, and must respect removed connections.
    Child play(program({"play", "Resonator", "-a", "jack", "-j", "-u", osc_port}));
    REQUIRE(answers());
    auto neighbour = std::make_unique<Neighbour>();
    const auto all_are_back = [&] {
      return std::all_of(kept.begin(), kept.end(), [&](const Cable& cable) {
        return neighbour->is_connected(cable.first, cable.second);
      });
    };
    for (const auto& [from, to] : kept) {
      REQUIRE(neighbour->connect(from, to));
    }
    REQUIRE(neighbour->connect(pulled.first, pulled.second));
    REQUIRE(eventually([&] {
      return neighbour->is_connected(pulled_from_speaker.first, pulled_from_speaker.second);
    }));
    std::this_thread::sleep_for(500ms);  // so that the connection is seen
    neighbour->disconnect(pulled.first, pulled.second);
    neighbour->disconnect(pulled_from_speaker.first, pulled_from_speaker.second);
    std::this_thread::sleep_for(1s);  // long enough to see that no client is closing

    struct Next {
      int period_frames;
      int rate_hz;
      bool is_killed;
    };
    std::vector<Next> nexts{{512, 48000, true}, {128, 44100, false}};
    // RESSORT_KILLS adds servers with all rates and periods in turn.
    const char* const kills = std::getenv("RESSORT_KILLS");
    for (int i = 0; kills != nullptr && i < std::atoi(kills); ++i) {
      constexpr int periods[] = {64, 1024, 256, 128, 512};
      constexpr int rates_hz[] = {44100, 48000, 96000};
      nexts.push_back({periods[i % 5], rates_hz[i % 3], true});
    }
    for (const Next& next : nexts) {
      CAPTURE(next.period_frames, next.is_killed);
      play.forget();
      next.is_killed ? server->kill() : server->end();
      REQUIRE(play.says("is lost"));
      CHECK(eventually([&] { return status_shows(play, "audio   none; waiting for JACK"); }));
      CHECK(play.said().find("cpu     no audio is running") != std::string::npos);
      neighbour.reset();
      server.reset();
      server = std::make_unique<Server>(next.period_frames, next.rate_hz, false);
      REQUIRE(play.says("playing again"));
      std::this_thread::sleep_for(300ms);  // the neighbour comes later than the program
      neighbour = std::make_unique<Neighbour>();
      const auto came = std::chrono::steady_clock::now();
      CHECK(eventually(all_are_back));
      const std::chrono::duration<double> took = std::chrono::steady_clock::now() - came;
      std::printf("all connections are back after %.2f s\n", took.count());
      std::this_thread::sleep_for(1500ms);  // longer than the interval between attempts
      CHECK(all_are_back());
      CHECK_FALSE(neighbour->is_connected(pulled.first, pulled.second));
      CHECK_FALSE(neighbour->is_connected(pulled_from_speaker.first, pulled_from_speaker.second));
    }
    play.signal(SIGTERM);
    CHECK(play.exit_code() == 0);
  }

  SECTION("--exit-on-loss ends with 75") {
    Child play(
        program({"play", "PolyTriangle", "-a", "jack", "-i", "--exit-on-loss", "-u", osc_port}));
    REQUIRE(answers());
    server->kill();
    CHECK(play.exit_code() == 75);
  }
}

// libjack cancels the callback's thread when the server ends, wherever the callback is just then.
// Without CancellationDisabled the program terminated at the second, third and sixth end.
TEST_CASE("An overloaded program survives every end of its server", "[server_loss]") {
  const char* const kills = std::getenv("RESSORT_KILLS");
  const int ends = kills != nullptr ? std::atoi(kills) : 8;
  auto server = std::make_unique<Server>(128);
  Child play(program({"play", "Gong", "-a", "jack", "-j", "-p", "8", "-u", osc_port}));
  REQUIRE(answers());
  std::atomic<int> loads{0};
  std::jthread player([&](const std::stop_token& is_over) {
    for (int i = 0; !is_over.stop_requested(); ++i) {
      if (i % 60 == 0) {
        lo_send(osc(), "/model/load", "s", loads++ % 2 == 0 ? "ThunderSheet" : "Gong");
      }
      lo_send(osc(), "/note/on", "ii", 40 + i % 40, 127);
      lo_send(osc(), "/param/*", "f", 0.1f + 0.001f * static_cast<float>(i % 100));
      std::this_thread::sleep_for(5ms);
    }
  });
  for (int i = 0; i < ends && !play.has_ended(); ++i) {
    CAPTURE(i);
    std::this_thread::sleep_for(1s);
    play.forget();
    i % 2 == 0 ? server->end() : server->kill();
    CHECK(play.says("is lost"));
    server.reset();
    server = std::make_unique<Server>(128, 48000, false);
    CHECK(play.says("playing again"));
  }
  player.request_stop();
  player.join();
  CHECK(answers());
  play.signal(SIGTERM);
  CHECK(play.exit_code() == 0);
  std::printf("%d ends of the server and %d loads\n", ends, loads.load());
}

}  // namespace ressort::servers::connections_test
