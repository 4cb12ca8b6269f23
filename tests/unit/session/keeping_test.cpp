// A player's changes: learned controllers, undo and saving.
#include <chrono>
#include <cmath>
#include <thread>

#include "app/session/files.h"
#include "app/text.h"
#include "tests/support/app/console_harness.h"

namespace ressort::keeping_test {
namespace {

// Waits until the condition holds, at most two seconds.
bool becomes_true(Harness& harness, const std::function<bool()>& is_so) {
  for (int i = 0; i < 200 && !is_so(); ++i) {
    harness.play();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return is_so();
}

void turn(Harness& harness, int controller, double value) {
  const TimedEvent event{{.kind = EventKind::controller,
                          .index = static_cast<std::uint16_t>(controller),
                          .value = value}};
  REQUIRE(harness.process.send(harness.process.from_midi, {&event, 1}));
  harness.play();
}

struct LoadedHarness {
  DataFolder data;
  Folder folder;
  Harness harness;

  LoadedHarness() {
    data.write("models/triangle.mdl", scenes::poly_triangle());
    data.write("presets/tri.toml", triangle_preset);
    REQUIRE(has(harness.say("load tri"), "tri: 3 masses"));
    harness.play();
  }
};

}  // namespace

TEST_CASE("a parameter learns the next knob that moves, and forgets it", "[keeping]") {
  LoadedHarness fixture;
  Harness& h = fixture.harness;
  turn(h, 20, 0.9);  // before anyone has requested it
  CHECK(has(h.say("learn M_k"), "m_K"));
  turn(h, 21, 0.25);
  REQUIRE(becomes_true(h, [&] { return h.session.mapping().size() == 1; }));
  CHECK(h.session.mapping()[0].setting.input.number == 21);
  // From 0.01 to 0.2 in equal ratios: half way is the root of 0.01 * 0.2.
  turn(h, 21, 0.5);
  const double middle = std::sqrt(0.01 * 0.2);
  CHECK(becomes_true(
      h, [&] { return std::fabs(h.session.parameter("m_K").value_or(0.0) - middle) < 1e-15; }));
  CHECK(has(h.say("explain"), "cc21"));
  CHECK(has(h.say("unlearn m_K"), "1 controller"));
  turn(h, 21, 1.0);
  for (int i = 0; i < 10; ++i) {
    h.play();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  CHECK(std::fabs(*h.session.parameter("m_K") - middle) < 1e-15);
  CHECK(has(h.say("learn nothing"), "error"));
  CHECK(has(h.say("learn m_Q"), "did you mean 'm_K'?"));
}

TEST_CASE("values are saved and loaded, and presets are not overwritten without --force",
          "[keeping]") {
  LoadedHarness fixture;
  Harness& h = fixture.harness;
  h.say("set m_K 0.125");
  CHECK(has(h.say("save \"my own\""), "saved to"));
  CHECK(has(h.say("save \"my own\""), "--force"));
  CHECK(has(h.say("save \"my own\" --force"), "saved to"));
  CHECK(has(h.say("save tri"), "is a preset of the program"));
  for (const char* const name : {"../x", ".x", "a/b", "''", "x\x1b"}) {
    CHECK(has(h.say("save " + std::string(name)), "error"));
  }
  const auto known = known_presets();
  // After the program's presets, whose numbers stay.
  CHECK(known == std::vector<std::string>{"tri", "my own"});
  h.say("set m_K 0.1");
  CHECK(has(h.say("load \"MY OWN\""), "my own: 3 masses"));
  h.play();
  CHECK(*h.session.parameter("m_K") == 0.125);
  // OSC may load the user's presets too.
  CHECK(find_scene("my own", Reach::own_folders));
}

TEST_CASE("a learned knob acts in every sound that has its parameter", "[keeping]") {
  LoadedHarness fixture;
  Harness& h = fixture.harness;
  fixture.data.write("presets/tri2.toml", triangle_preset);
  fixture.data.write("models/mass.mdl",
                     "@g ground 0.\n@m mass 1. 0. 0.\n@l springDamper @g @m 0.1 0.0001\n"
                     "@in1 frcInput @m\n@out1 posOutput @m\n");
  h.say("learn m_K");
  turn(h, 21, 0.5);
  REQUIRE(becomes_true(h, [&] { return h.session.mapping().size() == 1; }));
  REQUIRE(has(h.say("load tri2"), "tri2: 3 masses"));
  h.loudest(12);
  turn(h, 21, 1.0);
  CHECK(becomes_true(h, [&] { return h.session.parameter("m_K") == 0.2; }));
  CHECK(has(h.say("explain"), "controls m_K, learned"));
  REQUIRE(has(h.say("load mass"), "mass: 1 mass"));
  h.loudest(12);  // until the crossfade is over
  CHECK(has(h.say("explain"), "mapped to m_K, which this sound does not have"));
  turn(h, 21, 0.25);
  REQUIRE(has(h.say("load tri"), "tri: 3 masses"));
  h.loudest(12);
  CHECK(h.session.parameter("m_K") == 0.1);
  turn(h, 21, 0.0);
  CHECK(becomes_true(h, [&] { return h.session.parameter("m_K") == 0.01; }));
}

TEST_CASE("a model without a preset is saved as a preset", "[keeping]") {
  LoadedHarness fixture;
  Harness& h = fixture.harness;
  const std::string model = fixture.folder.write("bell.mdl", scenes::poly_triangle());
  REQUIRE(has(h.say("load " + model), "bell: 3 masses"));
  h.play();
  h.say("set m_K 0.15");
  const double gain = h.session.current()->instrument.gain;
  CHECK(has(h.say("save bell2"), "saved to"));
  REQUIRE(has(h.say("load bell2"), "bell2: 3 masses"));
  CHECK(*h.session.parameter("m_K") == 0.15);
  CHECK(h.session.current()->instrument.gain == gain);
  CHECK(h.session.current()->model_path == model);
}

TEST_CASE("undo reverts a change, a sweep, a load, and itself", "[keeping]") {
  LoadedHarness fixture;
  Harness& h = fixture.harness;
  CHECK(has(h.say("undo"), "nothing to undo"));
  h.say("set m_K 0.15");
  h.say("set m_K 0.16");  // within a second: one change
  h.say("undo");
  CHECK(*h.session.parameter("m_K") == 0.1);
  h.say("undo");
  CHECK(*h.session.parameter("m_K") == 0.16);
  REQUIRE(has(h.say("load triangle"), "triangle: 3 masses"));
  h.play();
  CHECK(has(h.say("undo"), "tri is restored"));
  CHECK(h.session.current()->name == "tri");
  CHECK(*h.session.parameter("m_K") == 0.16);
}

TEST_CASE("names are found in any case, and similar ones are suggested", "[keeping]") {
  LoadedHarness fixture;
  Harness& h = fixture.harness;
  CHECK(has(h.say("LOAD TRI"), "tri: 3 masses"));
  CHECK(has(h.say("load tir"), "did you mean 'tri'?"));
  CHECK(has(h.say("get M_K"), "m_K = 0.1"));
  CHECK(has(h.say("get k_M"), "did you mean 'm_K'?") == false);  // too far off for a suggestion
  CHECK(has(h.say("stauts"), "did you mean 'status'?"));
  CHECK(has(h.say("presets"), "three masses, struck"));
}

TEST_CASE("waiting ends when the program ends", "[keeping]") {
  LoadedHarness fixture;
  Harness& h = fixture.harness;
  CHECK(h.say("wait 0.01").empty());
  CHECK(has(h.say("wait soon"), "error"));
  CHECK(has(h.say("wait 1e9"), "error"));
  std::thread ending([&] { h.session.end(); });
  CHECK(h.say("wait 3600").empty());
  ending.join();
}

TEST_CASE("status shows the last notes and a level", "[keeping]") {
  LoadedHarness fixture;
  Harness& h = fixture.harness;
  CHECK(has(h.say("status"), "none yet"));
  for (const int key : {0, 60, 61, 69, 127}) {
    h.say("noteon " + std::to_string(key) + " 64");
    h.play();
  }
  CHECK(has(h.say("status"), "last C4 (64), C#4 (64), A4 (64), G9 (64)"));
  CHECK(has(h.said, "[#"));
}

TEST_CASE("similar words are found by their letters", "[keeping]") {
  const std::vector<std::string> known = {"load", "status", "PolyTriangle"};
  CHECK(nearest_word("LAOD", known) == "load");
  CHECK(nearest_word("polytrangle", known) == "PolyTriangle");
  CHECK_FALSE(nearest_word("xyz", known));
  CHECK_FALSE(nearest_word(std::string(100, 'a'), known));
  CHECK(did_you_mean("statu", known) == "; did you mean 'status'?");
}

TEST_CASE("lines are wrapped at spaces and indented to their column", "[keeping]") {
  CHECK(wrapped("one two three", 20) == "one two three");
  CHECK(wrapped("one two three", 8) == "one two\nthree");
  CHECK(wrapped("a   one two three", 11) == "a   one two\n    three");
  CHECK(wrapped("  a  \u00e9\u00e9 \u00e9\u00e9 \u00e9\u00e9\nb", 11) ==
        "  a  \u00e9\u00e9 \u00e9\u00e9\n     \u00e9\u00e9\nb");
  CHECK(wrapped("unbreakable", 4) == "unbreakable");
  CHECK(wrapped("", 4).empty());
}

}  // namespace ressort::keeping_test
