#include "app/control/osc/server.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <limits>
#include <map>
#include <random>
#include <set>

#include "app/control/osc/packet.h"
#include "app/control/registry.h"
#include "app/control/status.h"
#include "app/devices/audio.h"
#include "tests/support/app/data_folder.h"
#include "tests/support/app/osc_client.h"
#include "tests/support/catch.h"

namespace ressort::osc_test {
namespace {

constexpr double rate_hz = 48000.0;
constexpr std::size_t period = 256;

// --- a client, and a process driven by the test -------------------------------------------------

std::unique_ptr<OscServer> open_server(Process& process, Session& session) {
  auto server = OscServer::open({.port = 0}, process, session, {});
  REQUIRE(server);
  return *std::move(server);
}

// Two masses that a push moves at once and that come to rest long before the next.
struct Harness {
  DataFolder data;
  Process process{rate_hz, false};
  Session session{process, {.compile = {.rate_hz = rate_hz, .bare = true}}, {}};
  bool is_loaded = load();
  std::unique_ptr<OscServer> server = open_server(process, session);
  Client client{server->port()};

  bool load() {
    data.write("models/two.mdl", model);
    return static_cast<bool>(session.load_and_wait("two"));
  }
  static constexpr const char* model =
      "@m_K param 0.02\n"
      "@m_Z param 0.2\n"
      "@m_a osc 1. m_K m_Z 0. 0.\n"
      "@m_b osc 1. 0.02 0.2 0. 0.\n"
      "@in1 frcInput @m_a\n"
      "@in2 frcInput @m_b\n"
      "@out1 posOutput @m_a\n"
      "@out2 posOutput @m_b\n";

  // An hour ahead, so that the process is never late on a slow machine.
  std::int64_t start_ns = monotonic_ns() + 3600'000'000'000;
  std::array<std::vector<float>, 2> sound;

  Harness() { REQUIRE(is_loaded); }

  std::int64_t time_ns(std::int64_t frame) const { return start_ns + frame * 62500 / 3; }

  void drive(std::size_t blocks, std::int64_t jitter_ns = 0) {
    for (std::size_t i = 0; i < blocks; ++i) {
      const std::size_t at = sound[0].size();
      std::array<float*, 2> outputs{};
      for (std::size_t c = 0; c < 2; ++c) {
        sound[c].resize(at + period);
        outputs[c] = sound[c].data() + at;
      }
      process.block(std::span<const float* const>{}, std::span<float* const>(outputs), period, {},
                    time_ns(static_cast<std::int64_t>(at)) + jitter_ns);
    }
  }

  // Returns the time tag for a moment of the simulated clock.
  std::uint64_t tag(std::int64_t time_ns) const {
    const std::int64_t wall_ns = time_ns + wall_offset_ns;
    return (static_cast<std::uint64_t>(wall_ns / 1'000'000'000 + 2208988800) << 32) +
           (static_cast<std::uint64_t>(wall_ns % 1'000'000'000) << 32) / 1'000'000'000;
  }
  std::int64_t wall_offset_ns = [] {
    timespec wall{};
    clock_gettime(CLOCK_REALTIME, &wall);
    return wall.tv_sec * 1'000'000'000 + wall.tv_nsec - monotonic_ns();
  }();

  // Returns the frames where a channel starts to sound after silence.
  std::vector<std::int64_t> onsets(std::size_t channel) const {
    std::vector<std::int64_t> frames;
    std::size_t still = period;
    for (std::size_t n = 0; n < sound[channel].size(); ++n) {
      const bool sounds = std::fabs(sound[channel][n]) > 1e-6f;
      if (sounds && still >= period) {
        frames.push_back(static_cast<std::int64_t>(n));
      }
      still = sounds ? 0 : still + 1;
    }
    return frames;
  }
};

bool has(const Answer& answer, std::string_view address, std::string_view about,
         std::string_view part) {
  return answer.address == address && answer.text(0) == about &&
         std::get<std::string>(answer.values.back()).find(part) != std::string::npos;
}

// --- the server ---------------------------------------------------------------------------------

TEST_CASE("a parameter is set and queried over OSC", "[osc]") {
  Harness harness;
  Client& client = harness.client;
  CHECK(std::get<float>(client.ask(message("/param/m_K")).values.at(0)) == 0.02f);
  client.send(message("/param/m_K", {0.03}));
  const Answer one = client.ask(message("/param/m_K"));
  CHECK(one.address == "/param/m_K");
  CHECK(std::get<float>(one.values.at(0)) == 0.03f);

  client.send(message("/param/m_[KZ]", {0.025f}));
  client.send(message("/param/*"));
  const auto all = client.sync();
  REQUIRE(all.size() == 2);
  CHECK(all[0].address == "/param/m_K");
  CHECK(all[1].address == "/param/m_Z");
  CHECK(std::get<float>(all[1].values.at(0)) == 0.025f);

  CHECK(has(client.ask(message("/param/none")), "/error", "/param/none", "no such parameter"));
  CHECK(has(client.ask(message("/param/none", {1})), "/error", "/param/none", "m_K"));
  CHECK(has(client.ask(message("/param/m_K", {"much"})), "/error", "/param/m_K", "number"));
  CHECK(has(client.ask(message("/param/m_K", {std::nanf("")})), "/error", "/param/m_K", "number"));
  CHECK(has(client.ask(RAW("/cc\0,b\0\0\0\0\0\0")), "/error", "/cc", "numbers"));
  CHECK(has(client.ask(message("/nowhere")), "/error", "/nowhere", "unknown address"));
  CHECK(has(client.ask(message("/" + std::string(300, 'a'))), "/error", "", "255"));
}

TEST_CASE("OSC reports values beyond the stable range, and the limit", "[osc]") {
  const DataFolder data;
  data.write("models/one.mdl", "@K param 1.\n@o osc 1. K 0. 0. 0.\n@out1 posOutput @o\n");
  Process process(44100.0, false);
  Session session(process, {.compile = {.rate_hz = 44100.0}}, {});
  REQUIRE(session.load_and_wait("one"));
  const auto server = open_server(process, session);
  Client client(server->port());
  const Answer range = client.ask(message("/param/K/range"));
  CHECK(range.address == "/param/K/range");
  REQUIRE(range.values.size() == 4);
  CHECK(std::get<float>(range.values[0]) == 0.0f);
  CHECK(std::get<float>(range.values[1]) == 3.99999f);
  CHECK(std::get<float>(range.values[2]) == 0.0f);
  CHECK(std::get<float>(range.values[3]) == 4.0f);
  CHECK(has(client.ask(message("/param/K", {4.5})), "/error", "/param/K",
            "K: 4.5 is beyond the stable range, set to 3.99999"));
  CHECK(session.parameter("K") == 3.99999);
  CHECK(has(client.ask(message("/param/L/range")), "/error", "/param/L/range", "no such"));
}

TEST_CASE("status and describe reply in full", "[osc]") {
  Harness harness;
  harness.drive(1);
  const Answer status = harness.client.ask(message("/status"));
  CHECK(status.address == "/status.reply");
  REQUIRE(status.values.size() == 15);
  CHECK(status.text(0) == "two");
  CHECK(std::get<double>(status.values[6]) == rate_hz);
  CHECK(std::get<std::int32_t>(status.values[7]) == static_cast<std::int32_t>(period));
  CHECK(std::get<float>(status.values[9]) == -999.0f);

  harness.client.send(message("/describe"));
  auto rows = harness.client.sync();
  REQUIRE_FALSE(rows.empty());
  CHECK(rows.back().address == "/describe.end");
  CHECK(std::get<std::int32_t>(rows.back().values.at(0)) == static_cast<int>(rows.size()) - 1);
  rows.pop_back();
  CHECK(rows.size() == addresses().size() + 4);  // two parameters, which are controls too
  CHECK(has(rows[0], "/describe.reply", "/note/on", "note"));
  // Its value, range and stable range are numbers.
  const Answer& parameter = rows[rows.size() - 3];
  CHECK(parameter.text(0) == "/param/m_Z");
  CHECK(parameter.text(1) == "f");
  REQUIRE(parameter.values.size() == 8);
  CHECK(std::get<float>(parameter.values[3]) == 0.2f);
  CHECK(rows.back().text(0) == "/control/m_Z");
}

TEST_CASE("every figure has a name, a meaning and at most one place in the reply", "[osc]") {
  std::set<std::string_view> names;
  std::map<int, std::string_view> places;
  for (const StatusRow& row : status_rows()) {
    CAPTURE(row.name);
    CHECK(names.insert(row.name).second);
    CHECK_FALSE(row.does.empty());
    CHECK((row.place == not_in_reply || places.emplace(row.place, row.name).second));
  }
  // Clients rely on these positions.
  std::string order;
  for (const auto& [place, name] : places) {
    order += std::string(name) + " ";
  }
  CHECK(order ==
        "model cpu voices max_voices xruns resets rate period load_ms peak_db late dropped backend "
        "beyond cpu_peak ");
  CHECK(places.rbegin()->first == 14);
  Status status;
  status.model = "one";
  status.xruns = std::uint64_t{1} << 40;
  status.peak_db = -std::numeric_limits<double>::infinity();
  const Answer reply = read_answer(status_reply(status).bytes());
  REQUIRE(reply.values.size() == 15);
  CHECK(reply.text(0) == "one");
  CHECK(std::get<std::int32_t>(reply.values[4]) == std::numeric_limits<std::int32_t>::max());
  CHECK(std::get<float>(reply.values[9]) == -999.0f);
  status.late = 2;
  const auto lines = status_lines(status);
  const std::vector<std::string> events = {"events", "2 late, 0 dropped, 0 malformed, 0 ignored"};
  CHECK(std::find(lines.begin(), lines.end(), events) != lines.end());
}

TEST_CASE("the messages of a bundle act together", "[osc]") {
  Harness harness;
  harness.drive(1);
  harness.client.send(bundle(1, {message("/in/1/force", {0.1}), message("/in/2/force", {0.1})}));
  harness.client.sync();
  harness.drive(4);
  REQUIRE(harness.onsets(0).size() == 1);
  CHECK(harness.onsets(0) == harness.onsets(1));

  const auto tag = harness.tag(harness.time_ns(48000));
  harness.client.send(bundle(
      tag, {message("/note/on", {60, 100}), bundle(tag, {message("/note/on", {64.0, 90.0f})})}));
  harness.client.sync();
  TimedEvent first;
  TimedEvent second;
  REQUIRE(harness.process.from_osc.pop(first));
  REQUIRE(harness.process.from_osc.pop(second));
  CHECK(first.event.index == 60);
  CHECK(second.event.index == 64);
  CHECK(first.timing == TimedEvent::When::at_frame);
  CHECK(second.timing == TimedEvent::When::at_frame);
  CHECK(std::abs(first.when - 48000) < 48);  // The offset of the two clocks is measured twice.
  CHECK(first.when == second.when);
}

TEST_CASE("time tags keep their distances to the frame", "[osc]") {
  Harness harness;
  CHECK(has(harness.client.ask(bundle(harness.tag(harness.time_ns(0)), {message("/panic")})),
            "/error", "/panic", "no audio"));

  // The distance is not a whole number of blocks, and block times have jitter.
  constexpr std::int64_t distance = 31007;
  constexpr std::uint64_t count = 24;
  const std::uint64_t first_tag = harness.tag(harness.time_ns(9600) + 7777);
  std::mt19937 random(1);
  std::uniform_int_distribution<std::int64_t> jitter_ns(-2'000'000, 2'000'000);
  for (std::uint64_t k = 0; k < count; ++k) {
    const std::uint64_t offset = (k * distance << 32) / 48000;  // To the last bit of a tag.
    while (static_cast<std::int64_t>(harness.sound[0].size()) <
           static_cast<std::int64_t>(k) * distance + 1) {
      harness.drive(1, jitter_ns(random));
    }
    harness.client.send(bundle(first_tag + offset, {message("/in/1/force", {0.1})}));
    CHECK(harness.client.sync().empty());
  }
  harness.drive(100);
  const auto onsets = harness.onsets(0);
  REQUIRE(onsets.size() == count);
  // The error is the error of the first block's clock reading.
  CHECK(std::abs(onsets[0] - 9600) < 150);
  for (std::size_t k = 1; k < count; ++k) {
    CHECK(onsets[k] - onsets[k - 1] == distance);
  }

  // A time in the past acts immediately, and the sender gets a message.
  const auto now = static_cast<std::int64_t>(harness.sound[0].size());
  const auto late = harness.client.ask(
      bundle(harness.tag(harness.time_ns(now - 24000)), {message("/in/1/force", {0.1})}));
  CHECK(has(late, "/error", "/in/1/force", "late by 0."));
  harness.drive(2);
  CHECK(harness.onsets(0).back() == now);
  CHECK(harness.process.meters().late == 1);

  CHECK(has(harness.client.ask(
                bundle(harness.tag(harness.time_ns(now + 11 * 48000)), {message("/panic")})),
            "/error", "/panic", "s ahead"));
}

TEST_CASE("time tags follow the clock when the audio has stood still", "[osc]") {
  Harness harness;
  harness.drive(1);
  harness.client.send(bundle(harness.tag(harness.time_ns(9600)), {message("/in/1/force", {0.1})}));
  CHECK(harness.client.sync().empty());
  harness.drive(50);
  // Every block is 50 ms later than its frame number implies: 2400 frames fewer until a tag.
  harness.drive(1, 50'000'000);
  harness.client.send(bundle(harness.tag(harness.time_ns(24000)), {message("/in/1/force", {0.1})}));
  CHECK(harness.client.sync().empty());
  harness.drive(50, 50'000'000);
  const auto onsets = harness.onsets(0);
  REQUIRE(onsets.size() == 2);
  CHECK(std::abs(onsets[0] - 9600) < 48);
  CHECK(std::abs(onsets[1] - 21600) < 48);
}

TEST_CASE("a port in use and a wrong address give different errors", "[osc]") {
  Harness harness;
  const auto second =
      OscServer::open({.port = harness.server->port()}, harness.process, harness.session, {});
  REQUIRE_FALSE(second);
  CHECK(second.error().message.find("is taken") != std::string::npos);
  CHECK(second.error().message.find("choose another with -u") != std::string::npos);
  const auto nowhere =
      OscServer::open({.bind_address = "nowhere"}, harness.process, harness.session, {});
  REQUIRE_FALSE(nowhere);
  CHECK(nowhere.error().message.find("'nowhere'") != std::string::npos);
  const auto foreign =
      OscServer::open({.bind_address = "192.0.2.1", .port = 0, .allow = "192.0.2.0/24"},
                      harness.process, harness.session, {});
  REQUIRE_FALSE(foreign);
  CHECK(foreign.error().message.find("192.0.2.1") != std::string::npos);
  CHECK_FALSE(OscServer::open({.port = 65536}, harness.process, harness.session, {}));

  const int port = harness.server->port();
  harness.server.reset();
  CHECK(OscServer::open({.port = port}, harness.process, harness.session, {}));
}

TEST_CASE("loading replies done or fail with the client's ID", "[osc]") {
  Harness harness;
  const Answer done = harness.client.ask(message("/model/load", {"two", 7}));
  CHECK(done.address == "/done");
  REQUIRE(done.values.size() == 2);
  CHECK(done.text(0) == "/model/load");
  CHECK(std::get<std::int32_t>(done.values[1]) == 7);

  const Answer fail = harness.client.ask(message("/preset/load", {"nosuch", "mine"}));
  CHECK(has(fail, "/fail", "/preset/load", "there is no model or preset 'nosuch'"));
  REQUIRE(fail.values.size() == 3);
  CHECK(fail.text(1) == "mine");
  CHECK(harness.client.ask(message("/model/load", {"two"})).values.size() == 1);
  CHECK(has(harness.client.ask(message("/model/load")), "/error", "/model/load", "NAME"));

  CHECK(has(harness.client.ask(message("/model/load", {""})), "/fail", "/model/load",
            "expected the name of a model or a preset"));

  // The server may end during a load.
  for (int i = 0; i < 8; ++i) {
    harness.client.send(message("/model/load", {"two", i}));
  }
  harness.server.reset();
  CHECK(harness.session.load_and_wait("two"));
}

TEST_CASE("a full queue rejects events until there is room", "[osc]") {
  Harness harness;
  const Bytes many = bundle(1, std::vector<Bytes>(1500, message("/bend", {0.5f})));
  bool was_refused = false;
  harness.drive(1);
  for (int i = 0; i < 8 && !was_refused; ++i) {
    harness.client.send(many);
    for (const Answer& answer : harness.client.sync()) {
      CHECK(has(answer, "/error", "/bend", "busy"));
      was_refused = true;
    }
  }
  CHECK(was_refused);
  harness.drive(8);
  harness.client.send(many);
  CHECK(harness.client.sync().empty());
}

TEST_CASE("a bundle without room is rejected whole, and immediate events are accepted", "[osc]") {
  Harness harness;
  harness.drive(1);
  const std::vector<Bytes> pushes(1500, message("/in/1/force", {0.1}));
  const auto ahead = [&] { return harness.tag(harness.time_ns(48000 * 49 / 5)); };
  harness.client.send(bundle(ahead(), pushes));
  harness.client.send(bundle(ahead(), pushes));
  CHECK(harness.client.sync().empty());
  for (int i = 0; i < 2; ++i) {
    CHECK(has(harness.client.ask(bundle(ahead(), pushes)), "/error", "/in/1/force",
              "refused whole: 4096 events can wait for their time; there is no room for 1500 "
              "events more; try again later"));
    CHECK(harness.process.meters().dropped == 1500u * (static_cast<unsigned>(i) + 1));
    harness.drive(4);  // The audio thread has received all of them, and they are still waiting.
  }
  CHECK(harness.onsets(0).empty());
  harness.client.send(message("/in/1/force", {0.1}));
  CHECK(harness.client.sync().empty());
  const auto now = static_cast<std::int64_t>(harness.sound[0].size());
  harness.drive(2);
  CHECK(harness.onsets(0) == std::vector<std::int64_t>{now});
  harness.client.send(message("/panic"));
  CHECK(harness.client.sync().empty());
  harness.drive(1);
  harness.client.send(bundle(ahead(), pushes));
  CHECK(harness.client.sync().empty());
}

TEST_CASE("late events are reported at intervals with their number", "[osc]") {
  Harness harness;
  harness.drive(200);
  const std::int64_t start_ns = monotonic_ns();
  std::int64_t answers = 0;
  for (int i = 0; i < 738; ++i) {
    harness.client.send(
        bundle(harness.tag(harness.time_ns(24000)), {message("/in/1/force", {0.1})}));
    if (i % 50 == 49) {
      for (const Answer& answer : harness.client.sync()) {
        CHECK(has(answer, "/error", "/in/1/force", "late by 0."));
        ++answers;
      }
    }
  }
  CHECK(answers > 0);
  CHECK(answers <= (monotonic_ns() - start_ns) / 1'000'000'000 + 2);
}

TEST_CASE("replies get no reply, and malformed packets few", "[osc]") {
  Harness harness;
  harness.client.send(message("/error", {"/a", "b"}));
  harness.client.send(bundle(1, {message("/done"), message("/status.reply")}));
  CHECK(harness.client.sync().empty());

  const std::int64_t start_ns = monotonic_ns();
  std::int64_t answers = 0;
  for (int i = 0; i < 200; ++i) {
    harness.client.send(RAW("rubbish"));
  }
  for (const Answer& answer : harness.client.sync()) {
    CHECK(has(answer, "/error", "", ""));
    ++answers;
  }
  CHECK(answers > 0);
  CHECK(answers <= 10 * ((monotonic_ns() - start_ns) / 1'000'000'000 + 2));
}

TEST_CASE("ten thousand malformed packets do not disturb the server or the sound", "[osc]") {
  Harness harness;
  harness.drive(1);
  const std::vector<Bytes> seeds = {
      message("/note/on", {60, 100}),
      message("/note/off", {60}),
      message("/cc", {1, 64.0f}),
      message("/bend", {0.5}),
      message("/param/m_K", {0.01}),
      message("/param/{m_K,m_Z}", {0.01f}),
      message("/param/*"),
      message("/in/1/force", {1.0f, 0.01}),
      message("/in/2/force", {-1e9f}),
      message("/model/load", {"two", 1}),
      message("/preset/load", {"none"}),
      message("/describe"),
      bundle(1, {message("/note/on", {60, 100}), message("/in/1/force", {0.5})}),
      bundle(harness.tag(harness.time_ns(9600)),
             {bundle(1, {message("/panic")}), message("/in/1/force", {0.5})})};
  Client other(harness.server->port());  // Gets replies while the first client is over its budget.
  std::mt19937 random(20240607);
  const auto below = [&](std::size_t limit) {
    return std::uniform_int_distribution<std::size_t>(0, limit - 1)(random);
  };
  for (int i = 0; i < 10000; ++i) {
    Bytes packet = seeds[below(seeds.size())];
    if (i % 5 == 0) {
      packet.resize(below(200));
      for (std::uint8_t& byte : packet) {
        byte = static_cast<std::uint8_t>(below(256));
      }
    }
    for (std::size_t changes = i % 5 == 0 ? 0 : below(4); changes > 0 && !packet.empty();
         --changes) {
      const std::size_t at = below(packet.size());
      const auto place = packet.begin() + static_cast<std::ptrdiff_t>(at);
      switch (below(5)) {
        case 0:
          packet[at] = static_cast<std::uint8_t>(below(256));
          break;
        case 1:
          packet[at] ^= static_cast<std::uint8_t>(1u << below(8));
          break;
        case 2:
          packet.resize(at);
          break;
        case 3:
          packet.erase(place);
          break;
        default:
          packet.insert(place, 4, static_cast<std::uint8_t>(below(2) * 255));
          break;
      }
    }
    harness.client.send(packet);
    if (i % 50 == 49) {
      other.sync();
      harness.drive(2);
    }
  }
  CHECK(Client(harness.server->port()).ask(message("/status")).address == "/status.reply");
  harness.drive(20);
  for (const std::vector<float>& channel : harness.sound) {
    CHECK(std::all_of(channel.begin(), channel.end(), [](float x) { return std::isfinite(x); }));
  }
  CHECK(harness.process.meters().frames == harness.sound[0].size());
}

}  // namespace
}  // namespace ressort::osc_test
