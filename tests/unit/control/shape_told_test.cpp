// Shaping the current sound from the console and by OSC: changes, messages, undo.
#include <cmath>

#include "app/control/osc/server.h"
#include "tests/support/app/console_harness.h"
#include "tests/support/app/osc_client.h"
#include "tests/support/pitch.h"

namespace ressort::shape_told_test {
namespace {

const char* const string_text =
    "@k param 0.1\n@z param 0.002\n@s string 20 1. k z 0. 0.\n@in1 frcInput [@s 0.3]\n"
    "@out1 posOutput [@s 0.71]\n";

// For 18 moving masses, by hand: lambda = K (2 sin(pi / 2 / 19))^2, and zeta is the same with Z; f
// and T60 of the published scheme.
double stiffness_for(double f0_hz, double t60_s, double rate_hz) {
  const double r = std::pow(10.0, -3.0 / (rate_hz * t60_s));
  const double lambda = 1.0 + r * r - 2.0 * r * std::cos(2.0 * M_PI * f0_hz / rate_hz);
  const double step = 44100.0 / rate_hz;
  return lambda / std::pow(2.0 * std::sin(M_PI / 38.0) * step, 2.0);
}

struct StringHarness {
  Folder folder;
  Harness harness;
  StringHarness() {
    REQUIRE(has(harness.say("load " + folder.write("mine.mdl", string_text)), "mine: 18 masses"));
    harness.play();
  }
  double now(const char* name) { return harness.session.parameter(name).value_or(0.0); }
};

// Collapses blanks.
std::string squeezed(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c != ' ' || out.empty() || out.back() != ' ') {
      out += c;
    }
  }
  return out;
}

}  // namespace

TEST_CASE("the console shapes the current sound, and undo reverts it", "[shape_told]") {
  StringHarness fixture;
  Harness& h = fixture.harness;
  const std::string told = h.say("shape f0 300 t60 2");
  CHECK(has(told, "300.0 Hz"));
  CHECK(has(squeezed(told), " Hz 300.0 Hz 300.0 Hz 0.00 JND"));
  CHECK(has(squeezed(told), "2.00 s 2.00 s 0.00 JND"));
  CHECK(has(told, "'undo' reverts it"));
  // Within a hundredth of a just noticeable difference: 0.05 cents.
  CHECK(fixture.now("k") == Approx(stiffness_for(300.0, 2.0, 48000.0)).epsilon(1e-4));
  h.play();
  CHECK(has(h.say("undo"), "k = 0.1"));
  CHECK(fixture.now("k") == 0.1);
  CHECK(fixture.now("z") == 0.002);
  h.play();
  const std::string high = h.say("shape f0 9000");
  CHECK(has(high, "is as high as it gets"));
  CHECK(has(high, "k is at its highest"));
}

TEST_CASE("keys stay in tune after shaping", "[shape_told]") {
  const Folder folder;
  Harness h;
  h.say("load " + write_triangle(folder));
  const auto pitch_hz = [&] {
    h.say("noteon 69 60");
    std::vector<double> sound;
    for (int i = 0; i < 400; ++i) {
      const std::vector<float> block = h.play();
      sound.insert(sound.end(), block.begin(), block.end());
    }
    return support::measured_hz(sound, 48000.0, 440.0);
  };
  constexpr double a_tenth_of_a_cent = 440.0 * 5.8e-5;
  CHECK(pitch_hz() == Approx(440.0).margin(a_tenth_of_a_cent));
  const double before = *h.session.parameter("m_K");
  // A sounding note continues and is in tune at once.
  h.say("noteon 69 60");
  h.loudest(5);
  const std::string told = h.say("shape inharmonicity 0.0001");
  INFO(told);
  CHECK(std::fabs(*h.session.parameter("m_K") / before - 1.0) > 0.01);
  CHECK(h.loudest(5) > 1e-3);
  CHECK(pitch_hz() == Approx(440.0).margin(a_tenth_of_a_cent));
  h.say("undo");
  CHECK(*h.session.parameter("m_K") == before);
  CHECK(pitch_hz() == Approx(440.0).margin(a_tenth_of_a_cent));
}

TEST_CASE("an attack can be printed and requested", "[shape_told]") {
  StringHarness fixture;
  Harness& h = fixture.harness;
  const std::string told = squeezed(h.say("shape t60 2"));
  // Printed although it was not requested: the attack of a struck string is that of the 50 Hz
  // low-pass.
  CHECK(has(told, "attack "));
  CHECK_FALSE(has(told, "attack - -"));
  h.play();
  CHECK(has(h.say("shape attack_ms 400"), "is as slow as it gets"));
  CHECK(has(h.say("shape attack 0"), "must be a number above 0"));
}

TEST_CASE("the console rejects invalid targets", "[shape_told]") {
  Harness idle;
  CHECK(has(idle.say("shape t60 3"), "no model is loaded"));
  StringHarness fixture;
  Harness& h = fixture.harness;
  CHECK(has(h.say("shape"), "the command is 'shape FIGURE VALUE ...'"));
  CHECK(has(h.say("shape t60"), "the command is"));
  CHECK(has(h.say("shape t60 3 f0"), "expected FIGURE VALUE"));
  CHECK(has(h.say("shape 3 t60"), "expected a figure's name"));
  CHECK(has(h.say("shape centroit 3"), "did you mean 'centroid'?"));
  CHECK(has(h.say("shape t60 3 t60 4"), "t60 is given twice"));
  for (const char* const wrong : {"0", "-1"}) {
    CHECK(has(h.say(std::string("shape t60 ") + wrong), "must be a number above 0"));
  }
  CHECK(fixture.now("k") == 0.1);
  h.say("load " + fixture.folder.write("bow.mdl",
                                       "@m osc 1. 0.1 0.001 0. 0.\n@in1 posInput 0.\n"
                                       "@b nlBow @in1 @m 0.01 0.05\n@out1 posOutput @m\n"));
  CHECK(has(h.say("shape t60 3"), "is not linear: here is a bow"));
}

TEST_CASE("OSC shapes the current sound and replies with figures", "[shape_told]") {
  StringHarness fixture;
  auto server = OscServer::open({.port = 0}, fixture.harness.process, fixture.harness.session, {});
  REQUIRE(server);
  Client client((*server)->port());
  const Answer done = client.ask(message("/timbre/target", {"f0", 300.0F, "t60", 2.0F}));
  CHECK(done.address == "/done");
  REQUIRE(done.values.size() == 7);
  CHECK(done.text(0) == "/timbre/target");
  CHECK(done.text(1) == "f0");
  CHECK(std::get<float>(done.values[2]) == Approx(300.0).epsilon(1e-4));
  CHECK(std::fabs(std::get<float>(done.values[3])) < 0.01F);
  CHECK(done.text(4) == "t60");
  CHECK(std::get<float>(done.values[5]) == Approx(2.0).epsilon(1e-3));
  CHECK(fixture.now("k") == Approx(stiffness_for(300.0, 2.0, 48000.0)).epsilon(1e-4));
  const Answer nearest = client.ask(message("/timbre/target", {"f0", 9000.0F}));
  CHECK(nearest.address == "/done");
  CHECK(has(nearest.text(4), "is as high as it gets"));
  CHECK(client.ask(message("/timbre/target", {"f0", -3.0F})).address == "/fail");
  CHECK(client.ask(message("/timbre/target")).address == "/error");
  CHECK(has(client.ask(message("/timbre/target", {"centroit", 3.0F})).text(1), "did you mean"));
}

}  // namespace ressort::shape_told_test
