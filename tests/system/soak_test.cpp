// Random play of all presets on a real server, for any time. The output is finite and within full
// scale, memory does not grow, every note ends, and the callback never allocates, locks or waits.
#include <lo/lo.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>

#include "tests/support/random.h"
#include "tests/system/server.h"

namespace ressort::servers::soak_test {
using support::Random;

namespace {

constexpr const char* osc_port = "19781";

// Plays random keys, each for a while, and checks every sample.
class Hands {
 public:
  Hands() : client_(jack_client_open("hands", JackNoStartServer, nullptr)) {
    REQUIRE(client_ != nullptr);
    audio_ = jack_port_register(client_, "in", JACK_DEFAULT_AUDIO_TYPE, JackPortIsInput, 0);
    midi_ = jack_port_register(client_, "out", JACK_DEFAULT_MIDI_TYPE, JackPortIsOutput, 0);
    jack_set_process_callback(
        client_,
        [](jack_nframes_t frames, void* self) { return static_cast<Hands*>(self)->block(frames); },
        this);
    REQUIRE(jack_activate(client_) == 0);
    REQUIRE(eventually([&] {
      jack_connect(client_, "ressort:out_left", "hands:in");
      jack_connect(client_, "hands:out", "ressort:midi_in");
      return jack_port_connected(audio_) > 0 && jack_port_connected(midi_) > 0;
    }));
  }
  ~Hands() { jack_client_close(client_); }

  std::atomic<bool> is_playing{true};
  std::atomic<std::size_t> frames{0};
  std::atomic<std::size_t> wrong{0};  // samples that are not finite or exceed full scale
  std::atomic<std::size_t> loud{0};
  std::atomic<std::size_t> messages{0};

 private:
  int block(jack_nframes_t count) {
    void* const midi = jack_port_get_buffer(midi_, count);
    jack_midi_clear_buffer(midi);
    const auto* const audio = static_cast<const float*>(jack_port_get_buffer(audio_, count));
    for (jack_nframes_t n = 0; n < count; ++n) {
      wrong += std::isfinite(audio[n]) && std::fabs(audio[n]) <= 1.0f ? 0 : 1;
      loud += std::fabs(audio[n]) > 0.01f ? 1 : 0;
    }
    const auto send = [&](std::initializer_list<unsigned char> bytes) {
      messages += jack_midi_event_write(midi, 0, bytes.begin(), bytes.size()) == 0 ? 1 : 0;
    };
    const auto seven = [&] { return static_cast<unsigned char>(random_.below(128)); };
    for (auto& [key, left] : down_) {
      left -= std::min<std::size_t>(left, count);
      if (left == 0 || !is_playing) {
        send({0x80, key, seven()});
      }
    }
    std::erase_if(down_, [&](const auto& held) { return held.second == 0 || !is_playing; });
    if (is_playing && random_.below(20) == 0 && down_.size() < 8) {
      const auto key = static_cast<unsigned char>(36 + random_.below(60));
      if (down_.try_emplace(key, random_.below(96000)).second) {
        send({0x90, key, static_cast<unsigned char>(1 + random_.below(127))});
      }
    }
    if (is_playing && random_.below(10) == 0) {
      send({0xb0, static_cast<unsigned char>(1 + random_.below(31)), seven()});
      send({0xe0, seven(), seven()});
      send({0xd0, seven()});
    }
    frames += count;
    return 0;
  }

  jack_client_t* client_;
  jack_port_t* audio_ = nullptr;
  jack_port_t* midi_ = nullptr;
  Random random_{5};
  std::map<unsigned char, std::size_t> down_;  // keys with their remaining frames
};

double resident_mb(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/statm");
  double pages = 0.0;
  double resident = 0.0;
  file >> pages >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

}  // namespace

TEST_CASE("Random play for minutes changes nothing", "[soak]") {
  const char* const asked = std::getenv("RESSORT_SOAK_MINUTES");
  const double minutes = asked != nullptr ? std::atof(asked) : 0.5;
  const std::string report = "/tmp/ressort-soak-" + std::to_string(getpid());
  const Server server(256);
  Child play(program({"play", "PolyTriangle", "-a", "jack", "-u", osc_port}),
             {{"LD_PRELOAD", RESSORT_SPY}, {"RTSPY_OUT", report}});
  REQUIRE(play.says("OSC on"));
  const lo_address osc = lo_address_new("127.0.0.1", osc_port);
  std::vector<std::string> presets;
  for (const auto& file :
       std::filesystem::directory_iterator(std::filesystem::path(RESSORT_SOURCE) / "presets")) {
    if (file.path().extension() == ".toml") {
      presets.push_back(file.path().stem().string());
    }
  }
  std::sort(presets.begin(), presets.end());
  Random random(3);
  Hands hands;
  std::size_t sent = 0;
  const auto turn = [&] {
    lo_send(osc, "/model/load", "s", presets[random.below(presets.size())].c_str());
    for (int i = 0; i < 20; ++i) {
      lo_send(osc, "/param/*", "f", static_cast<float>(std::exp(random.uniform(-9.0, 1.0))));
      lo_send(osc, "/in/1/pluck", "f", static_cast<float>(random.uniform(0.0, 1.0)));
      sent += 20;
      std::this_thread::sleep_for(100ms);
    }
    play.forget();
  };
  double start_mb = 0.0;
  for (const std::string& preset : presets) {  // the largest preset determines the memory
    play.forget();
    play.write("load " + preset + "\n");
    REQUIRE(play.says("loaded in"));
    start_mb = std::max(start_mb, resident_mb(play.pid()));
  }
  const std::size_t start_messages = hands.messages;
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(60.0 * minutes);
  double most_mb = start_mb;
  while (std::chrono::steady_clock::now() < end && !play.has_ended()) {
    turn();
    most_mb = std::max(most_mb, resident_mb(play.pid()));
  }
  REQUIRE_FALSE(play.has_ended());
  // All keys and pedals are up: any sound that does not end is stuck.
  hands.is_playing = false;
  lo_send(osc, "/cc", "ii", 64, 0);
  lo_send(osc, "/model/load", "s", "PolyTriangle");
  CHECK(eventually(
      [&] {
        play.forget();
        play.write("status\n");
        return play.says("events") && play.said().find("voices  0 of") != std::string::npos;
      },
      120s));
  play.signal(SIGTERM);
  CHECK(play.exit_code() == 0);
  lo_address_free(osc);
  std::map<std::string, unsigned long> found;
  {
    std::ifstream file(report);
    std::string name;
    for (unsigned long n = 0; file >> name >> n;) {
      found[name] = n;
    }
    std::remove(report.c_str());
  }
  // A flight needs 48 bytes for an event; nothing else grows.
  const double events = static_cast<double>(hands.messages - start_messages + sent);
  std::printf("%.1f minutes: %.1f MB at first, %.1f at most, %zu messages, %zu frames\n", minutes,
              start_mb, most_mb, hands.messages.load() + sent, hands.frames.load());
  CHECK(most_mb - start_mb < 64.0 + events * 2 * 48e-6);
  CHECK(hands.wrong == 0);
  CHECK(hands.loud > 1000);
  CHECK(found["callbacks"] > 1000);
  for (const char* kind :
       {"allocations", "releases", "locks", "reads", "writes", "waits", "others"}) {
    INFO(kind);
    CHECK(found[kind] == 0);
  }
}

}  // namespace ressort::servers::soak_test
