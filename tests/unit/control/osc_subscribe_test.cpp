// OSC subscriptions, lists and saving, and note velocities.
#include <functional>

#include "app/control/osc/server.h"
#include "app/control/registry.h"
#include "tests/support/app/console_harness.h"
#include "tests/support/app/osc_client.h"

namespace ressort::osc_subscribe_test {
namespace {

struct OscHarness {
  DataFolder data;
  std::string news;
  std::mutex mutex;
  Harness harness;
  std::unique_ptr<OscServer> server;

  OscHarness() {
    data.write("models/triangle.mdl", scenes::poly_triangle());
    data.write("presets/tri.toml", triangle_preset);
    REQUIRE(has(harness.say("load tri"), "tri: 3 masses"));
    harness.play();
    auto opened = OscServer::open({.port = 0}, harness.process, harness.session,
                                  [this](const std::string& text) {
                                    const std::lock_guard lock(mutex);
                                    news += text + "\n";
                                  });
    REQUIRE(opened);
    server = *std::move(opened);
  }
};

// Returns the next message with this address, skipping others.
Answer next(Client& client, const std::string& address) {
  for (int i = 0; i < 100; ++i) {
    auto answer = client.receive();
    REQUIRE(answer);
    if (answer->address == address) {
      return *answer;
    }
  }
  FAIL("nothing comes from " << address);
  return {};
}

float value(const Answer& answer) {
  return std::get<float>(answer.values.at(0));
}

}  // namespace

TEST_CASE("subscribers receive every change from any source", "[osc_subscribe]") {
  OscHarness osc;
  Harness& h = osc.harness;
  Client listener(osc.server->port());
  Client other(osc.server->port());
  const Answer lease = listener.ask(message("/subscribe", {30}));
  CHECK(lease.address == "/subscribe.reply");
  CHECK(value(lease) == 30.0f);
  CHECK(next(listener, "/loaded").text(0) == "tri");  // The complete state first.
  CHECK(value(next(listener, "/param/m_K")) == 0.1f);

  h.say("set m_K 0.15");  // Changed by the console.
  CHECK(value(next(listener, "/param/m_K")) == 0.15f);
  h.play();
  other.send(message("/param/m_K", {0.125f}));  // Changed by another client.
  CHECK(value(next(listener, "/param/m_K")) == 0.125f);
  h.play();
  h.say("learn m_K");  // Changed by a knob.
  const auto turn = [&](double value) {
    const TimedEvent event{{.kind = EventKind::controller, .index = 7, .value = value}};
    REQUIRE(h.process.send(h.process.from_midi, {&event, 1}));
    h.play();
  };
  turn(0.5);
  while (h.session.mapping().empty()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  turn(1.0);
  while (value(next(listener, "/param/m_K")) != 0.2f) {  // echoes of the changes before
  }
  h.say("load triangle");  // Another scene.
  CHECK(next(listener, "/loaded").text(0) == "triangle");

  listener.send(message("/unsubscribe"));
  CHECK(next(listener, "/done").text(0) == "/unsubscribe");
  h.say("load tri");
  other.sync();
  CHECK_FALSE(listener.receive(200));
  CHECK(listener.ask(message("/unsubscribe")).address == "/error");
}

// A tablet sends from one port and listens at another one.
TEST_CASE("a tablet gets changes at the port that it names", "[osc_subscribe]") {
  OscHarness osc;
  Client tablet(osc.server->port());
  Client screen(osc.server->port());
  tablet.send(message("/subscribe", {30, screen.port()}));
  CHECK(next(screen, "/subscribe.reply").values.size() == 1);
  CHECK(value(next(screen, "/param/m_K")) == 0.1f);
  tablet.send(message("/param/m_K", {0.125f}));
  CHECK(value(next(screen, "/param/m_K")) == 0.125f);
  CHECK_FALSE(tablet.receive(100));
  for (const int port : {0, 65536}) {
    CHECK(tablet.ask(message("/subscribe", {30, port})).address == "/error");
  }
  tablet.send(message("/unsubscribe", {screen.port()}));
  CHECK(next(screen, "/done").text(0) == "/unsubscribe");
}

TEST_CASE("all replies go to one port if the server is told so", "[osc_subscribe]") {
  OscHarness osc;
  Client screen(osc.server->port());
  const auto other = OscServer::open({.port = 0, .reply_port = screen.port()}, osc.harness.process,
                                     osc.harness.session, nullptr);
  REQUIRE(other);
  Client tablet((*other)->port());
  screen.turn_to((*other)->port());
  tablet.send(message("/param/m_K"));
  CHECK(value(next(screen, "/param/m_K")) == 0.1f);
  CHECK_FALSE(tablet.receive(100));
}

TEST_CASE("an OSC pattern in any part of an address means all that match", "[osc_subscribe]") {
  OscHarness osc;
  Client client(osc.server->port());
  const auto triangle = osc.harness.session.current();
  using Addresses = std::vector<std::string>;
  const auto meant = [&](const char* pattern) {
    return addresses_meant(pattern, triangle->instrument);
  };
  CHECK(meant("/note/o[nf]") == Addresses{"/note/on"});
  CHECK(meant("/note/{on,off}") == Addresses{"/note/off", "/note/on"});
  CHECK(meant("/par?m/[lm]_K") == Addresses{"/param/[lm]_K"});
  CHECK(meant("/in/*/force") == Addresses{"/in/1/force"});
  CHECK(meant("/*/1/fo*") == Addresses{"/in/1/force"});
  CHECK(meant("/in/*/pu*") == Addresses{"/in/*/pu*"});
  CHECK(value(client.ask(message("/p*/m_[A-K]"))) == 0.1f);
  CHECK(client.ask(message("/no*")).address == "/error");
}

TEST_CASE("a query in a bundle answers what the bundle has set", "[osc_subscribe]") {
  OscHarness osc;
  Client client(osc.server->port());
  client.send(bundle(1, {message("/param/m_K"), message("/param/m_K", {0.125f})}));
  CHECK(value(next(client, "/param/m_K")) == 0.125f);
}

TEST_CASE("presets are loaded one after the other", "[osc_subscribe]") {
  OscHarness osc;
  osc.data.write("presets/zither.toml", triangle_preset);
  Client client(osc.server->port());
  const auto told = [&](const char* address) {
    const Answer done = client.ask(message(address, {1.0f}));  // A button's value.
    return done.address + " " + done.text(0) + " " + done.text(1);
  };
  CHECK(told("/preset/next") == "/done /preset/next zither");
  CHECK(told("/preset/next") == "/done /preset/next tri");
  CHECK(told("/preset/previous") == "/done /preset/previous zither");
  CHECK(has(osc.harness.say("next"), "tri: 3 masses"));
  CHECK(has(osc.harness.say("load triangle"), "triangle: 3 masses"));
  CHECK(has(osc.harness.say("previous"), "zither: 3 masses"));
}

TEST_CASE("subscribers receive the positions of named controls", "[osc_subscribe]") {
  OscHarness osc;
  Harness& h = osc.harness;
  osc.data.write("models/finger.mdl", scenes::poly_triangle() +
                                          "@in2 posInput 0.\n"
                                          "@c contact @in2 @m_m0 0.01 0.01 0.5\n");
  osc.data.write("presets/knobs.toml",
                 "model = \"finger.mdl\"\n[parameters]\n"
                 "m_K = { value = 0.1, range = [0.01, 0.2] }\n"
                 "[[control]]\nfrom = \"cc74\"\nto = \"m_K\"\nname = \"Brightness\"\n"
                 "range = [0.05, 0.15]\n"
                 "[[control]]\nfrom = \"cc16\"\nto = \"in2\"\nname = \"Touch\"\n"
                 "how = \"touch\"\nrange = [-2.0, 0.0]\n"
                 "[[control]]\nfrom = \"cc2\"\nto = \"m_K\"\nrange = [0.06, 0.07]\n");
  REQUIRE(has(h.say("load knobs"), "knobs: 3 masses"));
  CHECK(has(h.say("explain"), "Brightness    controller 74 controls m_K, 0.05 to 0.15"));
  CHECK(has(h.say("explain"), "controller 2  controls m_K, 0.06 to 0.07"));
  h.play();
  Client listener(osc.server->port());
  Client other(osc.server->port());
  REQUIRE(listener.ask(message("/subscribe", {30})).address == "/subscribe.reply");
  CHECK(value(next(listener, "/control/brightness")) == 0.5f);  // 0.1 between 0.05 and 0.15
  CHECK(value(next(listener, "/control/touch")) == 0.0f);
  // A controller with a parameter is reported with every change of the parameter.
  h.say("set m_K 0.125");
  h.play();
  CHECK(value(next(listener, "/control/brightness")) == 0.75f);
  other.send(message("/control/brightness", {0.25f}));
  other.sync();
  h.play();
  CHECK(value(next(listener, "/control/brightness")) == 0.25f);
  CHECK(*h.session.parameter("m_K") == Approx(0.075).epsilon(1e-6));
  // One that moves an input is reported when it moves, whatever has moved it.
  const auto turn = [&](int controller, double position) {
    const TimedEvent event{{.kind = EventKind::controller,
                            .index = static_cast<std::uint16_t>(controller),
                            .value = position}};
    REQUIRE(h.process.send(h.process.from_midi, {&event, 1}));
    h.play();
  };
  turn(16, 0.5);
  CHECK(value(next(listener, "/control/touch")) == 0.5f);
  h.say("control touch 1");
  h.play();
  CHECK(value(next(listener, "/control/touch")) == 1.0f);
  CHECK(value(other.ask(message("/control/touch"))) == 1.0f);
  // A knob that has learned the name moves the control, and its own controller still does.
  h.say("learn Touch");
  turn(20, 0.5);
  while (h.session.mapping().empty()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  turn(20, 0.125);
  CHECK(value(next(listener, "/control/touch")) == 0.125f);
  CHECK(has(h.say("control"), "brightness  0.25\ntouch       0.12"));
}

// From 0.01 to 0.2 in equal ratios, 0.1 is at log(10) / log(20).
TEST_CASE("without named controls, parameters are controls", "[osc_subscribe]") {
  OscHarness osc;
  Harness& h = osc.harness;
  Client client(osc.server->port());
  CHECK(value(client.ask(message("/control/m_K"))) ==
        Approx(std::log(10.0) / std::log(20.0)).epsilon(1e-6));
  CHECK(has(h.say("control"), "m_K"));
  CHECK(has(h.say("explain"), "control, 0.01 to 0.2, exponential; now 0.1"));
  h.say("control M_K 0");
  h.play();
  CHECK(*h.session.parameter("m_K") == 0.01);
  client.send(message("/control/m_*", {1.0f}));
  client.sync();
  h.play();
  CHECK(*h.session.parameter("m_K") == Approx(0.2).epsilon(1e-12));
}

TEST_CASE("a subscription ends with its lease", "[osc_subscribe]") {
  OscHarness osc;
  Client listener(osc.server->port());
  CHECK(listener.ask(message("/subscribe", {0.05})).address == "/subscribe.reply");
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  while (listener.receive(100)) {
  }
  osc.harness.say("set m_K 0.15");
  CHECK_FALSE(listener.receive(200));
  for (const Bytes& bytes :
       {message("/subscribe", {0}), message("/subscribe", {61}), message("/subscribe", {"long"})}) {
    CHECK(listener.ask(bytes).address == "/error");
  }
  std::vector<std::unique_ptr<Client>> crowd;
  for (int i = 0; i < 16; ++i) {
    crowd.push_back(std::make_unique<Client>(osc.server->port()));
    CHECK(crowd.back()->ask(message("/subscribe")).address == "/subscribe.reply");
  }
  CHECK(listener.ask(message("/subscribe")).address == "/error");
  CHECK(next(*crowd[0], "/param/m_K").values.size() == 1);
}

TEST_CASE("models and presets are listed over OSC, and saved", "[osc_subscribe]") {
  OscHarness osc;
  Client client(osc.server->port());
  client.send(message("/presets"));
  const Answer preset = next(client, "/presets.reply");
  CHECK(preset.text(0) == "tri");
  CHECK(preset.text(1) == "three masses, struck");
  CHECK(std::get<std::int32_t>(next(client, "/presets.end").values.at(0)) == 1);
  client.send(message("/models"));
  CHECK(next(client, "/models.reply").text(0) == "triangle");
  CHECK(std::get<std::int32_t>(next(client, "/models.end").values.at(0)) == 1);

  CHECK(client.ask(message("/preset/save", {"mine"})).address == "/done");
  CHECK(client.ask(message("/preset/save", {"mine"})).address == "/fail");  // Never overwrites.
  CHECK(client.ask(message("/preset/save", {"tri"})).address == "/fail");
  CHECK(client.ask(message("/preset/save", {"../../mine"})).address == "/fail");
  CHECK(client.ask(message("/preset/save", {"/tmp/mine"})).address == "/fail");
  CHECK(client.ask(message("/preset/save", {1})).address == "/error");
  CHECK(std::filesystem::exists(osc.data.path("home/ressort/presets/mine.toml")));
  const std::lock_guard lock(osc.mutex);
  CHECK(has(osc.news, "OSC saved"));
}

TEST_CASE("a controller is learnt and forgotten over OSC", "[osc_subscribe]") {
  OscHarness osc;
  Client client(osc.server->port());
  const auto told = [&](const Bytes& bytes) {
    const auto answer = client.ask(bytes);
    return answer.address + " " + answer.text(0) + " " + answer.text(1);
  };
  Session& session = osc.harness.session;
  CHECK(told(message("/learn", {"m_K"})) == "/done /learn m_K");
  CHECK(session.waiting_target() == "m_K");
  CHECK(has(told(message("/learn", {"m_Q"})), "/fail /learn there is no parameter"));
  CHECK(told(message("/unlearn", {"m_K"})) == "/done /unlearn m_K");  // Ends the waiting.
  CHECK_FALSE(session.waiting_target());
  CHECK(told(message("/unlearn", {"m_K"})) == "/fail /unlearn no controller is assigned to 'm_K'");

  CHECK(told(message("/learn", {"m_K"})) == "/done /learn m_K");
  const TimedEvent turned{{.kind = EventKind::controller, .index = 21, .value = 0.5}};
  REQUIRE(osc.harness.process.send(osc.harness.process.from_midi, {&turned, 1}));
  for (int i = 0; i < 200 && session.mapping().empty(); ++i) {
    osc.harness.play();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  CHECK(session.mapping().size() == 1);
  CHECK_FALSE(session.waiting_target());
  CHECK(told(message("/unlearn", {"m_K"})) == "/done /unlearn m_K");
  CHECK(session.mapping().empty());
  CHECK(client.ask(message("/learn")).address == "/error");
}

TEST_CASE("an OSC error is logged locally, too", "[osc_subscribe]") {
  OscHarness osc;
  Client client(osc.server->port());
  CHECK(client.ask(message("/nowhere")).address == "/error");
  client.sync();
  const std::lock_guard lock(osc.mutex);
  CHECK(has(osc.news, "OSC: /nowhere: unknown address"));
}

TEST_CASE("an integer velocity is a MIDI velocity, a float a fraction of full velocity",
          "[osc_subscribe]") {
  OscHarness osc;
  const auto current = osc.harness.session.current();
  const auto velocity = [&](double number, const std::string& types) {
    const auto events =
        to_events({"/note/on", {60.0, number}, types}, current->instrument, current->serial);
    REQUIRE(events);
    return events->at(0).value;
  };
  CHECK(velocity(1.0, "ii") == 1.0 / 127.0);
  CHECK(velocity(1.0, "if") == 1.0);
  CHECK(velocity(0.5, "id") == 0.5);
  // A value above 1 is a MIDI velocity and no fraction.
  CHECK(velocity(100.0, "if") == 100.0 / 127.0);
  CHECK(velocity(1.0, "") == 1.0 / 127.0);  // From a score.
}

}  // namespace ressort::osc_subscribe_test
