// A flight reproduces the same samples, bit by bit.
#include <unistd.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "app/commands/flight/flight_player.h"
#include "app/session/session.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/rooms.h"

namespace ressort::flight_test {

namespace {

namespace fs = std::filesystem;

constexpr double rate_hz = 48000.0;

struct Folder {
  fs::path path = fs::temp_directory_path() / ("ressort-flight-" + std::to_string(getpid()));
  Folder() { fs::create_directories(path); }
  ~Folder() { fs::remove_all(path); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path / name) << text;
    return (path / name).string();
  }
};

// A session whose audio thread is this one, with its output.
struct Stage {
  explicit Stage(const SessionOptions& options = {.compile = {.rate_hz = rate_hz},
                                                  .keeps_flights = true},
                 Process::Clock clock_ns = nullptr)
      : process(rate_hz, true, clock_ns), session(process, options, {}) {}

  void load(const std::string& name) { REQUIRE(session.load_and_wait(name)); }
  void play(std::size_t frames, const std::vector<std::vector<std::uint8_t>>& midi = {},
            std::size_t block = 256) {
    for (std::size_t at = 0; at < frames; at += block) {
      std::vector<float> left(block);
      std::vector<float> right(block);
      std::vector<float*> outputs = {left.data(), right.data()};
      std::vector<MidiPacket> packets;
      for (std::size_t i = 0; at == 0 && i < midi.size(); ++i) {
        packets.push_back({static_cast<std::uint32_t>(17 * i), midi[i]});
      }
      process.block(std::span<const float* const>(), std::span<float* const>(outputs), block,
                    packets, 0);
      for (std::size_t n = 0; n < block; ++n) {
        heard.push_back(left[n]);
        heard.push_back(right[n]);
      }
    }
  }

  Process process;
  Session session;
  std::vector<float> heard;  // interleaved
};

std::vector<float> played_back(const std::string& path, double heard_s = 1e6) {
  const auto player = FlightPlayer::open(path, heard_s);
  INFO((player ? "" : player.error().message));
  REQUIRE(player);
  CHECK(player->rate_hz() == rate_hz);
  CHECK(player->channels() == 2);
  std::vector<float> all;
  const auto played = player->play(
      [&](std::span<const float> samples) -> Result<Done> {
        all.insert(all.end(), samples.begin(), samples.end());
        return Done{};
      },
      [](double) { return true; });
  INFO((played ? "" : played.error().message));
  REQUIRE(played);
  return all;
}

// Compares the end of the output with the reproduced part.
void check_same(const std::vector<float>& heard, const std::vector<float>& again) {
  REQUIRE(again.size() <= heard.size());
  REQUIRE(!again.empty());
  const float* const end = heard.data() + heard.size() - again.size();
  CHECK(std::memcmp(end, again.data(), again.size() * sizeof(float)) == 0);
  float peak = 0.0f;
  for (const float sample : again) {
    peak = std::max(peak, std::fabs(sample));
  }
  CHECK(peak > 1e-3f);  // silence would be equal too
}

}  // namespace

TEST_CASE("A flight reproduces the same samples", "[flight]") {
  const Folder folder;
  Stage stage;
  stage.load("PolyTriangle");
  stage.play(4800, {{0x90, 57, 100}, {0x90, 64, 90}, {0xb0, 1, 80}});
  stage.play(9600, {{0x80, 57, 0}, {0xe0, 0, 90}}, 64);  // the server's period changes
  const auto set = [&](const std::string& name, double value) {
    const auto now = stage.session.current();
    for (std::size_t i = 0; i < now->instrument.parameters.size(); ++i) {
      if (now->instrument.parameters[i].name == name) {
        const TimedEvent event{.event = {.kind = EventKind::parameter,
                                         .index = static_cast<std::uint16_t>(i),
                                         .model = now->serial,
                                         .value = value}};
        REQUIRE(stage.process.send(stage.process.from_console, {&event, 1}));
      }
    }
  };
  set("m_K", 0.11);
  stage.play(9600, {{0x90, 72, 40}}, 700);  // cuts chunks unevenly
  stage.load("BowedString");
  stage.play(14400, {{0x90, 45, 110}, {0xd0, 100}}, 1024);
  stage.load("20x30mesh");
  stage.play(1024);  // in the middle of the fade
  stage.load("PolyTriangle");
  stage.play(7168);
  stage.play(12032, {{0x90, 60, 127}, {0xb0, 64, 127}, {0x80, 60, 0}});
  const std::string path = (folder.path / "f.ressort").string();
  const auto written = stage.session.write_flight(path, Existing::refuse);
  INFO((written ? "" : written.error().message));
  REQUIRE(written);
  check_same(stage.heard, played_back(path));
  SECTION("and only its end, the rest being computed silently") {
    const auto last = played_back(path, 0.25);
    CHECK(last.size() == 2 * 12000);
    check_same(stage.heard, last);
  }
  SECTION("from its own texts, also printed and parsed again") {
    const auto text = read_text(path, max_flight_bytes);
    REQUIRE(text);
    const auto flight = parse_flight(*text);
    REQUIRE(flight);
    CHECK(print_flight(*flight) == *text);
  }
  SECTION("but never overwrites a file") {
    CHECK(!stage.session.write_flight(path, Existing::refuse));
  }
}

// Duration of a block by the fake clock, in ns.
std::int64_t block_takes_ns = 0;
std::int64_t fake_clock_ns() {
  static std::int64_t now_ns = 0;
  now_ns += block_takes_ns;
  return now_ns;
}

TEST_CASE("A flight reproduces voices stolen by an overload", "[flight]") {
  const Folder folder;
  block_takes_ns = 0;
  Stage stage({.compile = {.rate_hz = rate_hz}, .keeps_flights = true}, fake_clock_ns);
  stage.load("PolyTriangle");
  stage.play(4800);
  std::vector<std::vector<std::uint8_t>> chord;
  for (std::uint8_t key = 50; key < 62; ++key) {
    chord.push_back({0x90, key, 100});
  }
  stage.play(4864, chord);
  const int before = stage.process.meters().voices;
  block_takes_ns = 10'000'000;  // for a block of 5.3 ms
  stage.play(19200);
  CHECK(stage.process.meters().shed > 0);
  CHECK(stage.process.meters().voices < before);
  // The old model ends at once, in the middle of its fade.
  block_takes_ns = 0;
  stage.play(9600, chord);
  stage.load("BowedString");
  stage.play(512);
  block_takes_ns = 20'000'000;
  stage.play(9600, chord);
  block_takes_ns = 0;
  const std::string path = (folder.path / "f.ressort").string();
  REQUIRE(stage.session.write_flight(path, Existing::refuse));
  const auto text = read_text(path, max_flight_bytes);
  REQUIRE(text);
  CHECK(text->find(" limit ") != std::string::npos);
  CHECK(text->find(" hurry\n") != std::string::npos);
  check_same(stage.heard, played_back(path));
}

TEST_CASE("A flight reproduces program changes that let the last model ring", "[flight]") {
  const Folder folder;
  Stage stage;
  stage.load("PolyTriangle");
  stage.play(4800, {{0x90, 57, 100}, {0x90, 64, 100}});
  for (const std::uint8_t program : std::array<std::uint8_t, 3>{3, 9, 5}) {
    const std::uint64_t swaps = stage.process.meters().swaps;
    stage.play(512, {{0xc0, program}});
    for (int i = 0; i < 6000 && stage.process.meters().swaps == swaps; ++i) {
      usleep(5000);
      stage.play(64);
    }
    CHECK(stage.process.meters().swaps > swaps);
    stage.play(4800, {{0x90, 60, 100}, {0x90, 67, 100}});
  }
  const std::string path = (folder.path / "f.ressort").string();
  REQUIRE(stage.session.write_flight(path, Existing::refuse));
  check_same(stage.heard, played_back(path));
}

// Two programs share the notes. Each records all notes and plays only its own part, and its
// instruments change.
TEST_CASE("A flight of a program that shares the notes plays its own part", "[flight]") {
  const Folder folder;
  std::vector<float> sounds[3];
  for (int number = 0; number <= 2; ++number) {
    const NoteShare::Part share = number == 0 ? NoteShare::Part{} : NoteShare::Part{number, 2};
    Stage stage({.compile = {.rate_hz = rate_hz, .share = share}, .keeps_flights = true});
    stage.load("PolyTriangle");
    stage.play(4800, {{0x90, 57, 100}, {0x90, 64, 90}, {0x90, 61, 70}});
    stage.play(4800, {{0x80, 57, 0}, {0x90, 64, 80}, {0x90, 69, 80}, {0x90, 57, 110}});
    stage.load("HandBell");
    stage.play(9600, {{0x90, 60, 100}, {0x90, 57, 100}, {0x90, 62, 100}});
    const std::string path = (folder.path / ("f" + std::to_string(number) + ".ressort")).string();
    REQUIRE(stage.session.write_flight(path, Existing::refuse));
    const auto text = read_text(path, max_flight_bytes);
    REQUIRE(text);
    CHECK((text->find("\nshare ") != std::string::npos) == (number > 0));
    const auto flight = parse_flight(*text);
    REQUIRE(flight);
    CHECK(print_flight(*flight) == *text);
    check_same(stage.heard, played_back(path));
    sounds[number] = stage.heard;
  }
  CHECK(sounds[1] != sounds[0]);
  CHECK(sounds[2] != sounds[0]);
  CHECK(sounds[1] != sounds[2]);
}

TEST_CASE("A flight contains the texts as they were when they were played", "[flight]") {
  const Folder folder;
  const std::string model =
      "@K param 0.1\n@s ground 0.\n@m mass 1. 0. 0.\n@r springDamper @s @m K 0.0005\n"
      "@in1 frcInput @m\n@out1 posOutput @m\n";
  folder.write("m.mdl", model);
  const std::string preset = folder.write(
      "p.toml",
      "model = \"m.mdl\"\nvoices = 3\ngain = 0.5\n[parameters]\nK = { value = 0.1, range = [0.01, "
      "0.3] }\n[[control]]\nfrom = \"note\"\nto = \"in1\"\nhow = \"impulse\"\nrange = [0.02, "
      "0.1]\n");
  SessionOptions options{.compile = {.rate_hz = rate_hz},
                         .keys = {.a4_hz = 430.0, .transpose = -3},
                         .watch = true,
                         .keeps_flights = true};
  Stage stage(options);
  stage.load(preset);
  stage.play(4800, {{0x90, 57, 100}});
  // A mass twice as heavy while it sounds; a parameter; then another structure.
  const auto edit = [&](const std::string& text) {
    const std::uint64_t before = stage.session.last_reload().count;
    folder.write("m.mdl", text);
    for (int i = 0; i < 1000 && stage.session.last_reload().count == before; ++i) {
      usleep(5000);
    }
    REQUIRE(stage.session.last_reload().count > before);
    INFO(stage.session.last_reload().news);
    CHECK(stage.session.last_reload().is_done);
  };
  std::string heavy = model;
  heavy.replace(heavy.find("mass 1."), 7, "mass 2.");
  edit(heavy);
  stage.play(4800);
  edit(heavy + "@n mass 1. 0. 0.\n@t springDamper @n @m K 0.0005\n");
  stage.play(4800, {{0x90, 60, 100}});
  fs::remove(folder.path / "m.mdl");
  const std::string path = (folder.path / "f.ressort").string();
  REQUIRE(stage.session.write_flight(path, Existing::refuse));
  fs::remove(preset);
  check_same(stage.heard, played_back(path));
}

TEST_CASE("An invalid flight is rejected with its line", "[flight]") {
  const auto error_of = [](const std::string& text) {
    const auto flight = parse_flight(text);
    REQUIRE(!flight);
    return std::to_string(flight.error().line) + ": " + flight.error().message;
  };
  CHECK(error_of("") == "1: expected 'ressort flight 1' at the start of a flight");
  CHECK(error_of("ressort flight 2\n") ==
        "1: expected 'ressort flight 1' at the start of a flight");
  CHECK(error_of("ressort flight 1\nend 5\nspeed 3\n") == "3: invalid line in a flight: 'speed 3'");
  CHECK(error_of("ressort flight 1\nend -5\n") == "2: invalid line in a flight: 'end -5'");
  CHECK(error_of("ressort flight 1\ntexts\ntext 100 a.mdl\nshort\n") ==
        "3: invalid line in a flight: 'text 100 a.mdl'");
  CHECK(error_of("ressort flight 1\n0 period 0 2\n") ==
        "2: invalid line in a flight: '0 period 0 2'");
  CHECK(error_of("ressort flight 1\nmethod dense\n") ==
        "2: invalid line in a flight: 'method dense'");
  CHECK(error_of("ressort flight 1\nprecision single\n") ==
        "2: invalid line in a flight: 'precision single'");
  for (const std::string share : {"0 2", "3 2", "1 65", "1.5 2", "1", "1 2 3"}) {
    CHECK(error_of("ressort flight 1\nshare " + share + "\n") ==
          "2: invalid line in a flight: 'share " + share + "'");
  }
  CHECK(error_of("ressort flight 1\n0 dance 1\n") == "2: invalid line in a flight: '0 dance 1'");
  CHECK(error_of("ressort flight 1\nend 5\n") == "2: the flight has no engines or no events");
}

TEST_CASE("There is no flight before something sounds", "[flight]") {
  const Folder folder;
  Stage stage;
  const auto written =
      stage.session.write_flight((folder.path / "f.ressort").string(), Existing::refuse);
  REQUIRE(!written);
  CHECK(written.error().message == "nothing has been played yet");
}

TEST_CASE("Every preset's flight reproduces its samples", "[.][flights_everywhere]") {
  for (const std::string& preset : known_presets()) {
    CAPTURE(preset);
    const Folder folder;
    Stage stage;
    stage.load(preset);
    stage.play(4800, {{0x90, 50, 100}, {0x90, 57, 90}, {0xb0, 1, 80}});
    usleep(300'000);  // better forms may be found meanwhile
    stage.play(19200, {{0x90, 62, 100}, {0xe0, 0, 90}, {0x80, 50, 0}});
    const std::string path = (folder.path / "f.ressort").string();
    REQUIRE(stage.session.write_flight(path, Existing::refuse));
    const std::vector<float> again = played_back(path);
    REQUIRE(again.size() == stage.heard.size());
    CHECK(std::memcmp(stage.heard.data(), again.data(), again.size() * sizeof(float)) == 0);
  }
}

}  // namespace ressort::flight_test
