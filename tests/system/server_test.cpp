// The whole program on a real JACK server: what a musician would notice, measured.
#include <arpa/inet.h>
#include <jack/metadata.h>
#include <lo/lo.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <atomic>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>

#include "tests/system/server.h"

namespace ressort::servers::server_test {

namespace {

constexpr std::size_t spacing = 21001;  // frames; a prime, so that every place in a block occurs
constexpr int notes = 14;
constexpr const char* osc_port = "19777";

lo_address osc() {
  static const lo_address address = lo_address_new("127.0.0.1", osc_port);
  return address;
}

// A preset whose every note is the same click and gone 60 dB down in 1400 frames: whoever listens
// for the next one hears nothing else.
const char* click() {
  static const std::string path = [] {
    const std::string name = "ressort-click-" + std::to_string(getpid());
    const std::string there = (std::filesystem::temp_directory_path() / name).string();
    std::ofstream(there + ".mdl") << "@g ground 0\n@m mass 1 0 0\n@s springDamper @m @g 0.02 0.01\n"
                                     "@in1 frcInput @m\n@out1 posOutput @m\n";
    std::ofstream(there + ".toml")
        << "model = \"" << name
        << ".mdl\"\nvoices = 16\ntuning = \"fixed\"\n[[control]]\n"
           "from = \"note\"\nto = \"in1\"\nhow = \"impulse\"\nrange = [0.01, 0.1]\n";
    return there + ".toml";
  }();
  return path.c_str();
}

// Waits until the program answers on OSC.
bool answers() {
  std::atomic<bool> heard{false};
  const lo_server server = lo_server_new(nullptr, nullptr);
  lo_server_add_method(
      server, "/status.reply", nullptr,
      [](const char*, const char*, lo_arg**, int, lo_message, void* flag) {
        *static_cast<std::atomic<bool>*>(flag) = true;
        return 0;
      },
      &heard);
  const bool answered = eventually([&] {
    lo_send_from(osc(), server, LO_TT_IMMEDIATE, "/status", "");
    lo_server_recv_noblock(server, 50);
    return heard.load();
  });
  lo_server_free(server);
  return answered;
}

// Whether the console's status shows this text, just now.
bool status_shows(Child& play, const std::string& text) {
  play.forget();
  play.write("status\n");
  return play.says("events") && play.said().find(text) != std::string::npos;
}

constexpr std::size_t first_note = 20000;  // frame

// So many clicks, `spacing` apart.
std::vector<Listener::Message> clicks() {
  std::vector<Listener::Message> messages;
  for (std::size_t n = 0; n < notes; ++n) {
    messages.push_back({first_note + n * spacing, {0x90, 69, 100}});
    messages.push_back({first_note + n * spacing + 9000, {0x80, 69, 0}});
  }
  return messages;
}

std::vector<std::size_t> onsets(const Listener& listener, std::size_t first) {
  std::vector<std::size_t> found;
  for (int n = 0; n < notes; ++n) {
    const std::size_t from = first + static_cast<std::size_t>(n) * spacing;
    found.push_back(listener.onset(from, from + spacing / 2, 0.01f) - from);
  }
  return found;
}

// All clicks() are heard, and as late as each other to the frame; how late.
std::size_t check_clicks(const Listener& listener) {
  const std::vector<std::size_t> late = onsets(listener, first_note);
  const auto [least, most] = std::minmax_element(late.begin(), late.end());
  CAPTURE(*least, *most);
  CHECK(*most < spacing / 2);
  CHECK(*most - *least == 0);  // frames
  return *most;
}

}  // namespace

TEST_CASE("MIDI notes start on their frame", "[jack_midi]") {
  const Server server(1024);
  Child play(program({"play", click(), "-a", "jack", "-i", "-u", osc_port}));
  REQUIRE(answers());
  Listener listener(first_note + (notes + 1) * spacing);
  listener.plan(clicks());
  listener.start("ressort:out_left", "ressort:midi_in");
  REQUIRE(listener.wait_for(first_note + notes * spacing));
  std::printf("MIDI onsets: %zu frames after the event\n", check_clicks(listener));
}

TEST_CASE("The last of two and a half thousand messages in one block is heard", "[jack_midi]") {
  const Server server(1024);
  Child play(program({"play", click(), "-a", "jack", "-i", "-u", osc_port}));
  REQUIRE(answers());
  Listener listener(48000 * 20);
  std::vector<Listener::Message> messages(2500, {20000, {0xb0, 3, 0}});
  messages.push_back({20000, {0x90, 69, 100}});
  listener.plan(messages);
  listener.start("ressort:out_left", "ressort:midi_in");
  REQUIRE(listener.wait_for(48000));
  CHECK(listener.onset(20000, 48000, 0.01f) < 22500);
}

TEST_CASE("OSC bundles start on the frame of their time tag", "[osc_time]") {
  const Server server(1024);
  Child play(program({"play", click(), "-a", "jack", "-i", "-u", osc_port}));
  REQUIRE(answers());
  Listener listener(48000 + (notes + 4) * spacing);
  listener.start("ressort:out_left", "");
  // NTP time in units of 2^-32 s, so that the spacing is as exact as a time tag can say it.
  lo_timetag now;
  lo_timetag_now(&now);
  const unsigned long long start =
      (static_cast<unsigned long long>(now.sec) << 32 | now.frac) + (1ull << 32);
  const auto tag = [&](int n) {
    const long double step = std::ldexp(static_cast<long double>(spacing) / 48000.0L, 32);
    return start + static_cast<unsigned long long>(llroundl(step * static_cast<long double>(n)));
  };
  std::thread sender([&] {
    for (int n = 0; n < notes; ++n) {
      const unsigned long long t = tag(n);
      const lo_timetag when{static_cast<std::uint32_t>(t >> 32), static_cast<std::uint32_t>(t)};
      const lo_bundle bundle = lo_bundle_new(when);
      const lo_message message = lo_message_new();
      lo_message_add_int32(message, 69);
      lo_message_add_int32(message, 100);
      lo_bundle_add_message(bundle, "/note/on", message);
      lo_send_bundle(osc(), bundle);
      lo_bundle_free_recursive(bundle);
      std::this_thread::sleep_for(400ms);  // less than the spacing, and never a multiple of it
    }
  });
  const std::size_t begin = listener.frames();
  const bool heard = listener.wait_for(begin + 48000 + notes * spacing + 4096);
  sender.join();
  REQUIRE(heard);
  const std::size_t first = listener.onset(begin, begin + 96000, 0.01f);
  REQUIRE(first < begin + 96000);
  std::size_t worst = 0;
  for (int n = 0; n < notes; ++n) {
    const std::size_t expected = first + static_cast<std::size_t>(n) * spacing;
    const std::size_t found = listener.onset(expected - 2000, expected + spacing / 2, 0.01f);
    worst = std::max(worst, found > expected ? found - expected : expected - found);
  }
  CHECK(worst == 0);  // frames
  std::printf("OSC bundles: at most %zu frames from the exact spacing\n", worst);
}

// What is sent and asked goes through one socket and one queue: an answer comes after all before
// it.
TEST_CASE("Notes and panic get through a flood, with the future full", "[flood]") {
  Child play(program({"play", "PolyTriangle", "-a", "dummy", "-m", "none", "-u", osc_port}));
  REQUIRE(answers());
  lo_timetag now;
  lo_timetag_now(&now);
  const lo_timetag ahead{now.sec + 9, now.frac};
  for (int packet = 0; packet < 4; ++packet) {
    const lo_bundle bundle = lo_bundle_new(ahead);
    for (int i = 0; i < 1400; ++i) {
      const lo_message note = lo_message_new();
      lo_message_add_int32(note, 30 + i % 90);
      lo_bundle_add_message(bundle, "/note/on", note);
    }
    lo_send_bundle(osc(), bundle);
    lo_bundle_free_recursive(bundle);
  }
  // 4200 do not fit into 4096: the last two were refused, and are counted.
  CHECK(eventually([&] { return status_shows(play, "2800 dropped"); }));

  std::atomic<bool> enough{false};
  std::thread flood([&] {
    const lo_address own = lo_address_new("127.0.0.1", osc_port);
    for (int i = 0; !enough; ++i) {
      lo_send(own, i % 2 == 0 ? "/bend" : "/pressure", "f", 0.01f * static_cast<float>(i % 100));
      if (i % 100 == 99) {
        std::this_thread::sleep_for(1ms);  // 100 000 a second
      }
    }
    lo_address_free(own);
  });
  play.write("noteon 60\n");
  CHECK(eventually([&] { return status_shows(play, "voices  1 of 16"); }));
  play.write("noteoff 60\npanic\n");
  CHECK(eventually([&] { return status_shows(play, "voices  0 of 16"); }));
  // By OSC too, as often as a packet is lost before the flood lets it in.
  play.write("noteon 64\n");
  CHECK(eventually([&] { return status_shows(play, "voices  1 of 16"); }));
  CHECK(eventually([&] {
    lo_send(osc(), "/panic", "");
    return status_shows(play, "voices  0 of 16");
  }));
  enough = true;
  flood.join();
  std::this_thread::sleep_for(10s);  // the time of the bundles has come, and nobody waits for it
  CHECK(status_shows(play, "voices  0 of 16"));
  play.signal(SIGTERM);
  CHECK(play.exit_code() == 0);
}

// Looks at the panel's motion for as long as it lives, sixty times a second.
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

TEST_CASE("The callback allocates, locks, reads, writes and waits never", "[callback]") {
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

  SECTION("the spy sees what is there to see") {
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

  SECTION("notes, controllers, floods, sweeps and swaps, while four watch") {
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
          static_cast<int>(frames / 1920);  // one that is too busy drops its listener for good
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

TEST_CASE("Helpers cost the callback no call", "[callback]") {
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

TEST_CASE("Two programs that share the notes sound as one", "[shared_notes]") {
  const auto heard = [](const std::vector<std::vector<std::string>>& shares) {
    const Server server(1024);
    std::vector<std::unique_ptr<Child>> programs;
    for (const auto& share : shares) {
      auto words = program({"play", "PolyTriangle", "-a", "jack", "-i", "-u", "off", "-p", "24",
                            "-g", "-20", "-n", share[0]});
      words.insert(words.end(), share.begin() + 1, share.end());
      programs.push_back(std::make_unique<Child>(words));
    }
    constexpr std::size_t frames = 48000 * 6;
    auto listener = std::make_unique<Listener>(frames);
    std::vector<Listener::Message> messages;
    for (unsigned n = 0; n < 40; ++n) {
      const auto key = static_cast<unsigned char>(45 + n * 7 % 24);
      const std::size_t at = 9600 + 6000 * n;
      messages.push_back({at, {0x90, key, static_cast<unsigned char>(40 + n)}});
      messages.push_back({at + 2000, {0xe0, 0, static_cast<unsigned char>(60 + n % 9)}});
      messages.push_back({at + 9000, {0x80, key, 64}});
    }
    std::sort(messages.begin(), messages.end(),
              [](const auto& a, const auto& b) { return a.frame < b.frame; });
    listener->plan(messages);
    Neighbour hands;  // connects what the listener does not
    for (const auto& share : shares) {
      REQUIRE(eventually([&] { return hands.connect(share[0] + ":out_right", "neighbour:left"); }));
    }
    listener->start(shares[0][0] + ":out_left", shares[0][0] + ":midi_in", [&] {
      for (std::size_t i = 1; i < shares.size(); ++i) {
        REQUIRE(hands.connect(shares[i][0] + ":out_left", "listener:in"));
        REQUIRE(hands.connect("listener:out", shares[i][0] + ":midi_in"));
      }
      // Whoever is late is waited for.
      REQUIRE(jack_set_freewheel(hands.client(), 1) == 0);
    });
    REQUIRE(listener->wait_for(frames));
    std::vector<float> sound;
    for (std::size_t n = 0; n < frames; ++n) {
      sound.push_back(listener->heard(n));
    }
    return sound;
  };
  const std::vector<float> whole = heard({{"whole"}});
  const std::vector<float> both = heard({{"one", "--share", "1/2"}, {"two", "--share", "2/2"}});
  float peak = 0.0f;
  float apart = 0.0f;
  for (std::size_t n = 0; n < whole.size(); ++n) {
    peak = std::max(peak, std::fabs(whole[n]));
    apart = std::max(apart, std::fabs(whole[n] - both[n]));
  }
  CAPTURE(peak, apart);
  CHECK(peak > 1e-3f);
  CHECK(peak < 0.5f);                     // no limiter between them
  CHECK(apart < 4.0f * 0x1p-24f * peak);  // JACK's samples are floats, rounded one by one
  std::printf("two programs are %.1e of the peak from one\n", static_cast<double>(apart / peak));
}

TEST_CASE("RtMidi's messages are heard, through its JACK side", "[rtmidi]") {
  const Server server(256);
  Child play(program({"play", click(), "-a", "dummy", "-m", "jack", "-u", osc_port}));
  REQUIRE(answers());
  Listener listener(48000 * 20);
  std::vector<Listener::Message> messages;
  for (std::size_t frame = 24000; frame < 48000 * 15; frame += 4800) {
    messages.push_back({frame, {0x90, 60, 110}});
  }
  listener.plan(messages);
  listener.start("", "ressort:midi_in");
  // The dummy backend is silent; the program's own meters tell whether it played.
  CHECK(eventually([&] { return status_shows(play, "voices  1 of 16"); }));
}

TEST_CASE("The ALSA null device runs, and plays what OSC asks for", "[alsa]") {
  Child play(
      program({"play", "PolyTriangle", "-a", "alsa", "-d", "null", "-m", "none", "-u", osc_port}));
  REQUIRE(answers());
  CHECK(play.said().find("ALSA 'null'") != std::string::npos);
  CHECK(eventually([&] {
    lo_send(osc(), "/note/on", "ii", 60, 110);
    std::this_thread::sleep_for(50ms);
    return status_shows(play, "voices  1 of 16");
  }));
  play.end_input();  // ends the console and nothing else
  lo_send(osc(), "/note/off", "i", 60);
  CHECK(answers());
  play.signal(SIGTERM);
  CHECK(play.exit_code() == 0);
}

TEST_CASE("What an ALSA device hears drives a model's audio inputs", "[alsa]") {
  // A device whose microphone plays a file: a sine of 440 Hz in floats.
  namespace fs = std::filesystem;
  const std::string there =
      (fs::temp_directory_path() / ("ressort-alsa-" + std::to_string(getpid()))).string();
  {
    std::vector<float> sine;
    for (int n = 0; n < 48000 * 20; ++n) {
      const auto y = static_cast<float>(0.01 * std::sin(2.0 * M_PI * 440.0 * n / 48000.0));
      sine.insert(sine.end(), {y, y});
    }
    std::ofstream(there + ".raw", std::ios::binary)
        .write(reinterpret_cast<const char*>(sine.data()),
               static_cast<std::streamsize>(sine.size() * sizeof(float)));
    std::ofstream config(there + ".conf");
    config << std::ifstream("/usr/share/alsa/alsa.conf").rdbuf()
           << "pcm.mic { type file\n slave.pcm null\n file /dev/null\n format raw\n infile \""
           << there << ".raw\" }\npcm.duplex { type asym\n playback.pcm null\n capture.pcm mic }\n";
  }
  const auto peak = [&](const char* device) {
    Child play(
        program({"play", "Resonator", "-a", "alsa", "-d", device, "-m", "none", "-u", "off"}),
        {{"ALSA_CONFIG_PATH", there + ".conf"}});
    REQUIRE(play.says("on ALSA"));
    std::this_thread::sleep_for(500ms);
    play.write("status\n");
    REQUIRE(play.says("events"));
    CHECK(play.said().find("notes   none yet") != std::string::npos);
    const std::string& said = play.said();
    const std::size_t at = said.find("peak ");
    return at == std::string::npos ? -1000.0 : std::atof(said.c_str() + at + 5);
  };
  const double heard_db = peak("duplex");
  CAPTURE(heard_db);
  CHECK(heard_db > -40.0);
  CHECK(heard_db <= 0.0);
  const double null_db = peak("null");
  CAPTURE(null_db);
  CHECK((null_db < -100.0 || null_db == 0.0));  // "silent" is no number
  for (const char* const ending : {".raw", ".conf"}) {
    fs::remove(there + ending);
  }
}

TEST_CASE("A bounce is exact: every note on its frame, however fast it goes", "[jack_midi]") {
  const Server server(256);
  Child play(program({"play", click(), "-a", "jack", "-i", "-u", osc_port}));
  REQUIRE(answers());
  Listener listener(first_note + (notes + 1) * spacing);
  listener.plan(clicks());
  jack_client_t* const bounce = jack_client_open("bounce", JackNoStartServer, nullptr);
  REQUIRE(bounce != nullptr);
  listener.start("ressort:out_left", "ressort:midi_in");
  REQUIRE(jack_set_freewheel(bounce, 1) == 0);
  const auto start = std::chrono::steady_clock::now();
  REQUIRE(listener.wait_for(first_note + notes * spacing));
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  REQUIRE(jack_set_freewheel(bounce, 0) == 0);
  jack_client_close(bounce);
  check_clicks(listener);
  std::printf("a bounce of %.1f s took %.2f s\n", first_note / 48e3 + notes * spacing / 48e3,
              took.count());
}

// PipeWire changes the period whenever a client comes or goes that wants another.
TEST_CASE("Notes stay on their frame while the period changes", "[jack_midi]") {
  const Server server(1024);
  Child play(program({"play", click(), "-a", "jack", "-i", "-u", osc_port}));
  REQUIRE(answers());
  Listener listener(first_note + (notes + 1) * spacing);
  listener.plan(clicks());
  jack_client_t* const host = jack_client_open("host", JackNoStartServer, nullptr);
  REQUIRE(host != nullptr);
  listener.start("ressort:out_left", "ressort:midi_in");
  std::vector<std::size_t> periods(2, 1024);  // [note]
  for (const jack_nframes_t period : {64u, 2048u, 16u, 512u, 8192u, 128u}) {
    REQUIRE(listener.wait_for(first_note + (periods.size() - 1) * spacing + spacing / 2));
    REQUIRE(jack_set_buffer_size(host, period) == 0);
    CHECK(jack_get_buffer_size(host) == period);
    periods.insert(periods.end(), 2, period);
  }
  REQUIRE(listener.wait_for(first_note + notes * spacing));
  jack_client_close(host);
  // The listener is before and after the program, so it hears everything a period later.
  const std::vector<std::size_t> late = onsets(listener, first_note);
  for (std::size_t n = 0; n < periods.size(); ++n) {
    CAPTURE(n, periods[n]);
    CHECK(late[n] - periods[n] == late[0] - periods[0]);  // frames
  }
}

TEST_CASE("A keyboard that was unplugged is taken up again by its name", "[jack_midi]") {
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
    std::this_thread::sleep_for(1500ms);  // as long as a plug takes to be put in again
  }
}

// Between two looks it is gone and there again, which is not the same as being unplugged by hand.
TEST_CASE("A keyboard that is back in no time is taken up again as well", "[jack_midi]") {
  const Server server(256);
  Child play(program({"play", click(), "-a", "jack", "-i", "-u", osc_port}));
  REQUIRE(answers());
  auto keyboard = std::make_unique<Neighbour>();
  REQUIRE(keyboard->connect("neighbour:keys", "ressort:midi_in"));
  for (int time = 0; time < 4; ++time) {
    INFO("time " << time);
    std::this_thread::sleep_for(std::chrono::milliseconds(1500 + 17 * time));  // it is seen
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

TEST_CASE("Ports say what they are, in their order", "[jack_midi]") {
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

TEST_CASE("The death of the server is survived, or told by the exit code", "[server_loss]") {
  auto server = std::make_unique<Server>(256);

  SECTION("waits, and plays again on the next server") {
    Child play(program({"play", "PolyTriangle", "-a", "jack", "-i", "-u", osc_port}));
    REQUIRE(answers());
    server->kill();
    REQUIRE(play.says("is gone"));
    server.reset();
    server = std::make_unique<Server>(512);
    REQUIRE(play.says("playing again"));
    Listener listener(48000 * 20);
    listener.plan({{9600, {0x90, 60, 110}}});
    listener.start("ressort:out_left", "ressort:midi_in");
    REQUIRE(listener.wait_for(24000));
    CHECK(listener.onset(9600, 24000, 0.01f) < 24000);
    play.signal(SIGTERM);
    CHECK(play.exit_code() == 0);
  }

  SECTION("what a person has connected is connected again, on servers of any kind") {
    using Cable = std::pair<std::string, std::string>;
    const std::vector<Cable> kept{{"ressort:out_left", "neighbour:left"},
                                  {"ressort:out_right", "neighbour:left"},
                                  {"ressort:out_right", "system:playback_2"},
                                  {"neighbour:keys", "ressort:midi_in"},
                                  {"neighbour:sound", "ressort:in_1"}};
    const Cable pulled{"ressort:out_left", "neighbour:right"};
    const Cable pulled_from_speaker{"ressort:out_left", "system:playback_1"};
    // -j connects the speakers by itself, and has to respect what was pulled.
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
    std::this_thread::sleep_for(500ms);  // seen
    neighbour->disconnect(pulled.first, pulled.second);
    neighbour->disconnect(pulled_from_speaker.first, pulled_from_speaker.second);
    std::this_thread::sleep_for(500ms);

    struct Next {
      int period_frames;
      int rate_hz;
      bool is_killed;
    };
    std::vector<Next> nexts{{512, 48000, true}, {128, 44100, false}};
    // More of them by RESSORT_KILLS, at all rates and periods in turn.
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
      REQUIRE(play.says("is gone"));
      CHECK(eventually([&] { return status_shows(play, "audio   none; waiting for JACK"); }));
      CHECK(play.said().find("cpu     nothing runs") != std::string::npos);
      neighbour.reset();
      server.reset();
      server = std::make_unique<Server>(next.period_frames, next.rate_hz);
      REQUIRE(play.says("playing again"));
      std::this_thread::sleep_for(300ms);  // it comes later than we
      neighbour = std::make_unique<Neighbour>();
      const auto came = std::chrono::steady_clock::now();
      CHECK(eventually(all_are_back));
      const std::chrono::duration<double> took = std::chrono::steady_clock::now() - came;
      std::printf("all connections are back after %.2f s\n", took.count());
      std::this_thread::sleep_for(1500ms);  // longer than anybody waits before he tries again
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

}  // namespace ressort::servers::server_test
