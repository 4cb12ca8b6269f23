// The whole program on a real JACK server, measured as a musician would notice it.
#include <lo/lo.h>

#include <atomic>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>

#include "tests/system/played.h"

namespace ressort::servers::server_test {

namespace {

constexpr std::size_t spacing = 21001;  // frames; a prime, so that every position in a block occurs
constexpr int notes = 14;
constexpr std::size_t first_note = 20000;  // frame

// Clicks at intervals of `spacing`.
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

// Checks that all clicks() are heard with the same latency to the frame. Returns the latency.
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

TEST_CASE("The last of 2500 messages in one block is played", "[jack_midi]") {
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

// A client that misses its period reads the buffer of its source while the source fills it anew,
// for JACK shares the memory of a single connection. An event that was counted can then be gone.
TEST_CASE("A MIDI event that vanishes before it is read counts as dropped", "[jack_midi]") {
  const Server server(1024);
  Child play(program({"play", click(), "-a", "jack", "-u", osc_port}),
             {{"LD_PRELOAD", RESSORT_SPY}, {"RTSPY_VANISHES", "1"}});
  REQUIRE(answers());
  Listener listener(48000 * 5);
  listener.plan({{20000, {0x90, 69, 100}}});
  listener.start("ressort:out_left", "ressort:midi_in");
  REQUIRE(listener.wait_for(48000));
  CHECK(listener.onset(20000, 48000, 0.01f) < 22500);
  CHECK(play.says("an event was dropped"));
  play.signal(SIGTERM);
  CHECK(play.exit_code() == 0);
}

// A stall of the server moves its frames against the wall clock, so all later tags have other
// frames. A run with such a stall is repeated if the server reported missed periods.
TEST_CASE("OSC bundles start on the frame of their time tag", "[osc_time]") {
  constexpr int most_runs = 6;
  std::size_t worst = 0;
  int overruns = 0;
  for (int run = 0; run == 0 || (run < most_runs && overruns > 0 && worst > 0); ++run) {
    const Server server(1024);
    Child play(program({"play", click(), "-a", "jack", "-i", "-u", osc_port}));
    REQUIRE(answers());
    Listener listener(48000 + (notes + 4) * spacing);
    listener.start("ressort:out_left", "");
    const int before = listener.overruns();
    // NTP time in units of 2^-32 s, as exact as a time tag.
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
    overruns = listener.overruns() - before;
    const std::size_t first = listener.onset(begin, begin + 96000, 0.01f);
    REQUIRE(first < begin + 96000);
    worst = 0;
    for (int n = 0; n < notes; ++n) {
      const std::size_t expected = first + static_cast<std::size_t>(n) * spacing;
      const std::size_t found = listener.onset(expected - 2000, expected + spacing / 2, 0.01f);
      worst = std::max(worst, found > expected ? found - expected : expected - found);
    }
  }
  CAPTURE(overruns);
  CHECK(worst == 0);  // frames
  std::printf("OSC bundles: at most %zu frames from the exact spacing\n", worst);
}

// Messages and requests go through one socket and one queue, so an answer comes after all before
// it.
TEST_CASE("Notes and panic get through a flood with a full future queue", "[flood]") {
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
  // 4200 events do not fit into 4096 places: the last two bundles were rejected and counted.
  CHECK(eventually([&] { return status_shows(play, "2800 dropped"); }));

  std::atomic<bool> enough{false};
  std::thread flood([&] {
    const lo_address own = lo_address_new("127.0.0.1", osc_port);
    for (int i = 0; !enough; ++i) {
      lo_send(own, i % 2 == 0 ? "/bend" : "/pressure", "f", 0.01f * static_cast<float>(i % 100));
      if (i % 100 == 99) {
        std::this_thread::sleep_for(1ms);  // 100,000 a second
      }
    }
    lo_address_free(own);
  });
  play.write("noteon 60\n");
  CHECK(eventually([&] { return status_shows(play, "voices  1 of 16"); }));
  play.write("noteoff 60\npanic\n");
  CHECK(eventually([&] { return status_shows(play, "voices  0 of 16"); }));
  // By OSC too, repeated until a packet gets through the flood.
  play.write("noteon 64\n");
  CHECK(eventually([&] { return status_shows(play, "voices  1 of 16"); }));
  CHECK(eventually([&] {
    lo_send(osc(), "/panic", "");
    return status_shows(play, "voices  0 of 16");
  }));
  enough = true;
  flood.join();
  std::this_thread::sleep_for(10s);  // the time of the discarded bundles has come
  CHECK(status_shows(play, "voices  0 of 16"));
  play.signal(SIGTERM);
  CHECK(play.exit_code() == 0);
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
    Neighbour hands;  // connects the ports that the listener does not
    for (const auto& share : shares) {
      REQUIRE(eventually([&] { return hands.connect(share[0] + ":out_right", "neighbour:left"); }));
    }
    listener->start(shares[0][0] + ":out_left", shares[0][0] + ":midi_in", [&] {
      for (std::size_t i = 1; i < shares.size(); ++i) {
        REQUIRE(hands.connect(shares[i][0] + ":out_left", "listener:in"));
        REQUIRE(hands.connect("listener:out", shares[i][0] + ":midi_in"));
      }
      // Freewheel mode waits for every client.
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
  CHECK(peak < 0.5f);                     // the limiter was not active
  CHECK(apart < 4.0f * 0x1p-24f * peak);  // JACK's samples are rounded to float one by one
  std::printf("two programs are %.1e of the peak from one\n", static_cast<double>(apart / peak));
}

TEST_CASE("RtMidi's messages are played, through its JACK interface", "[rtmidi]") {
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
  // The dummy backend is silent; the meters tell whether it played.
  CHECK(eventually([&] { return status_shows(play, "voices  1 of 16"); }));
}

TEST_CASE("The ALSA null device runs and plays OSC notes", "[alsa]") {
  Child play(
      program({"play", "PolyTriangle", "-a", "alsa", "-d", "null", "-m", "none", "-u", osc_port}));
  REQUIRE(answers());
  CHECK(play.said().find("ALSA 'null'") != std::string::npos);
  CHECK(eventually([&] {
    lo_send(osc(), "/note/on", "ii", 60, 110);
    std::this_thread::sleep_for(50ms);
    return status_shows(play, "voices  1 of 16");
  }));
  play.end_input();  // ends the console only
  lo_send(osc(), "/note/off", "i", 60);
  CHECK(answers());
  play.signal(SIGTERM);
  CHECK(play.exit_code() == 0);
}

TEST_CASE("The inputs of an ALSA device drive a model's audio inputs", "[alsa]") {
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
  CHECK((null_db < -100.0 || null_db == 0.0));  // 0: silence, printed as a word
  for (const char* const ending : {".raw", ".conf"}) {
    fs::remove(there + ending);
  }
}

TEST_CASE("A bounce is exact: every note is at its frame at any speed", "[jack_midi]") {
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

// PipeWire changes the period when a client with another period comes or goes. A client that misses
// a period of 16 frames, because another process runs, is heard in another period. A run with
// such a note is repeated if the server reported missed periods.
TEST_CASE("Notes stay on their frame while the period changes", "[jack_midi]") {
  constexpr int most_runs = 6;
  std::vector<std::size_t> periods;  // [note]
  std::vector<std::size_t> late;
  int overruns = 0;
  const auto is_exact = [&] {
    for (std::size_t n = 0; n < periods.size(); ++n) {
      if (late[n] - periods[n] != late[0] - periods[0]) {
        return false;
      }
    }
    return true;
  };
  for (int run = 0; run == 0 || (run < most_runs && overruns > 0 && !is_exact()); ++run) {
    const Server server(1024);
    Child play(program({"play", click(), "-a", "jack", "-i", "-u", osc_port}));
    REQUIRE(answers());
    Listener listener(first_note + (notes + 1) * spacing);
    listener.plan(clicks());
    jack_client_t* const host = jack_client_open("host", JackNoStartServer, nullptr);
    REQUIRE(host != nullptr);
    listener.start("ressort:out_left", "ressort:midi_in");
    const int before = listener.overruns();
    periods.assign(2, 1024);
    for (const jack_nframes_t period : {64u, 2048u, 16u, 512u, 8192u, 128u}) {
      REQUIRE(listener.wait_for(first_note + (periods.size() - 1) * spacing + spacing / 2));
      REQUIRE(jack_set_buffer_size(host, period) == 0);
      CHECK(jack_get_buffer_size(host) == period);
      periods.insert(periods.end(), 2, period);
    }
    REQUIRE(listener.wait_for(first_note + notes * spacing));
    jack_client_close(host);
    overruns = listener.overruns() - before;
    // The listener runs before and after the program, so it hears everything a period later.
    late = onsets(listener, first_note);
  }
  for (std::size_t n = 0; n < periods.size(); ++n) {
    CAPTURE(n, periods[n], overruns);
    CHECK(late[n] - periods[n] == late[0] - periods[0]);  // frames
  }
}

}  // namespace ressort::servers::server_test
