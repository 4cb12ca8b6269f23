// The panel without a browser: its drawing against the render. panel_http_test.cpp tests access,
// tests/panel the page in a browser.
#include "app/panel/panel.h"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <functional>
#include <future>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "app/panel/access.h"
#include "app/panel/page.h"
#include "app/panel/picture.h"
#include "core/compile/instrument.h"
#include "core/kernels/registry.h"
#include "tests/support/app/data_folder.h"
#include "tests/support/app/osc_bytes.h"
#include "tests/support/app/process_harness.h"

namespace ressort::panel_test {
namespace {

using namespace support;
using namespace std::chrono_literals;

// --- drawing -------------------------------------------------------------------------------------

struct Scene {
  const char* name;
  std::string text;
  std::vector<std::string> heard;  // Masses, in order of outputs from 1.
};

std::vector<Scene> scenes_with_taps() {
  const auto with_taps = [](Scene scene) {
    for (std::size_t i = 0; i < scene.heard.size(); ++i) {
      scene.text += scenes::output(static_cast<int>(i) + 1, scene.heard[i]);
    }
    return scene;
  };
  // Unequal masses, whose roots scale the modes, and one that does not start at 0.
  const std::string uneven =
      "@g ground 0.\n@a mass 1. 0. 0.\n@b mass 3. 0.2 0.2\n@c mass 2. 0. 0.\n@h ground 0.\n"
      "@k1 springDamper @g @a 0.05 0.001\n@k2 springDamper @a @b 0.1 0.001\n"
      "@k3 springDamper @b @c 0.07 0.001\n@k4 springDamper @c @h 0.05 0.001\n"
      "@in1 frcInput @a\n";
  const std::string beaten = ringing_string().substr(0, ringing_string().rfind("@out1")) +
                             "@w mass 5. 0.01 0.01\n@c1 contact @w @s_m4 0.05 0.001 0.\n";
  return {with_taps({"string",
                     scenes::string("s", 12, "0.1", "0.0005") + "@in1 frcInput @s_m2\n",
                     {"s_m1", "s_m2", "s_m6", "s_m9"}}),
          with_taps({"uneven masses", uneven, {"a", "b", "c"}}),
          with_taps({"contact", beaten, {"s_m1", "s_m4", "s_m8", "w"}}),
          {"places on waveguides and a mass",
           "@s waveguide 1. 220. 3. 0.4 0.1\n@t openWaveguide 0.5 110. 3. 0.6 0.\n"
           "@w mass 3. 0. 0.\n@b springDamper [@s 0.9] [@t 0.3] 0.2 0.01\n"
           "@h springDamper @w [@s 0.6] 0.05 0.001\n@in1 frcInput [@s 0.2]\n"
           "@out1 posOutput [@s 0.2]\n@out2 posOutput [@s 0.9]\n@out3 posOutput [@t 0.3]\n"
           "@out4 posOutput @w\n",
           {"s:0.2", "s:0.9", "t:0.3", "w"}},
          {"places on a body",
           "@bell body 40. rim waist crown\n@b1 mode @bell 310.7 4.2 1. -0.61 0.02\n"
           "@b2 mode @bell 601.2 1.3 0.8 0.35 0.9\n@b3 mode @bell 1533. 0.5 -0.3 0.5 1.4\n"
           "@in1 frcInput [@bell rim]\n@out1 posOutput [@bell rim]\n"
           "@out2 posOutput [@bell crown]\n@out3 posOutput [@bell 0.25]\n",
           {"bell:rim", "bell:crown", "bell:0.25"}}};
}

TEST_CASE("the drawing matches the render for every kernel", "[panel]") {
  std::set<Method> seen;
  for (const Scene& scene : scenes_with_taps()) {
    const Network network = network_of(scene.text);
    for (const Method method : all_methods()) {
      for (const Precision precision : {Precision::float64, Precision::float32}) {
        Player player(scene.text, struck(1), {.precision = precision, .method = method});
        seen.insert(player.compiled.plan.parts[0].method);
        const Picture picture = make_picture(player.engine(), network, 1);
        player.run(64);
        player.run(1000 + 37, {note_on(0, 69)}, {256, 37});
        MotionFrame frame;
        frame.count = player.engine().read_positions(frame.numbers);
        std::vector<float> positions(picture.masses.size());
        find_positions(picture, frame, positions);
        INFO(scene.name << " by " << method_name(method));
        double most = 0.0;
        for (std::size_t i = 0; i < scene.heard.size(); ++i) {
          const auto dot =
              std::find_if(picture.masses.begin(), picture.masses.end(), [&](std::uint32_t mass) {
                return mass != Picture::no_mass && struck_name(network, mass) == scene.heard[i];
              });
          REQUIRE(dot != picture.masses.end());
          const double shown = positions[static_cast<std::size_t>(dot - picture.masses.begin())];
          most = std::max(most, std::fabs(player.out[i].back()));
          CHECK(std::fabs(shown - player.out[i].back()) < 1e-6);
        }
        CHECK(most > 1e-3);  // It must move for the comparison to mean anything.
      }
    }
  }
  CHECK(seen.contains(Method::direct));
  CHECK(seen.contains(Method::modal));
  CHECK(seen.size() >= 4);
}

TEST_CASE("a large network is drawn in part", "[panel]") {
  const std::string text = "@s string 5000 1. 0.1 0.0001 0 0\n" +
                           std::string("@in1 frcInput [@s 0.3]\n@out1 posOutput [@s 0.3]\n");
  Player player(text, struck(1), {.method = Method::direct});
  const Picture picture = make_picture(player.engine(), network_of(text), 7);
  CHECK(picture.number == 7);
  CHECK(picture.masses.size() > most_dots / 2);
  CHECK(picture.masses.size() <= most_dots);
  player.run(200, {note_on(0, 69)});
  MotionFrame frame;
  frame.count = player.engine().read_positions(frame.numbers);
  CHECK(frame.count == picture.masses.size());
}

// A soft strike of half a period of 80 Hz on a lossless string: the drawing between its places
// equals the motion of places that hold nothing. The tolerance is a sample to either side, the
// rounding of a place; linear interpolation would be off by a thirty-second of the string.
TEST_CASE("a waveguide's drawing matches its displacement", "[panel]") {
  for (const std::string kind : {"waveguide", "openWaveguide"}) {
    const std::string text = "@s " + kind + " 1. 55. 1000. 1. 0.1\n@out1 posOutput [@s 0.23]\n" +
                             "@out2 posOutput [@s 0.81]\n";
    std::string probed = text;
    for (std::size_t i = 1; i + 1 < Engine::waveguide_points; ++i) {
      probed += "@out" + std::to_string(i + 2) + " posOutput [@s " +
                std::to_string(static_cast<double>(i) / 32.0) + "]\n";
    }
    const CompileOptions bare{.rate_hz = 48000.0, .bare = true, .method = Method::direct};
    Player drawn(text, Preset(), bare);
    Player heard(probed, Preset(), bare);
    const Picture picture = make_picture(drawn.engine(), network_of(text), 1);
    REQUIRE(picture.masses.size() == 2 + Engine::waveguide_points);
    REQUIRE(picture.groups[0].waveguides.size() == 1);
    const Picture::Waveguide& waveguide = picture.groups[0].waveguides[0];
    CHECK(waveguide.first == 2);
    const auto blow = [&](const Player& player) {
      const auto& struck = player.compiled.instrument.struck;
      const auto at = std::find_if(struck.begin(), struck.end(),
                                   [](const StruckInfo& info) { return info.name == "s:0.23"; });
      REQUIRE(at != struck.end());
      std::vector<Event> events;
      for (std::uint32_t n = 0; n < 300; ++n) {
        events.push_back({.frame = n,
                          .kind = EventKind::strike,
                          .value = 1e-3 * (1.0 - std::cos(2.0 * std::numbers::pi * n / 300.0)),
                          .value2 = static_cast<double>(at->first)});
      }
      return events;
    };
    drawn.run(300, blow(drawn));
    heard.run(300, blow(heard));
    double most = 0.0;
    double apart = 0.0;
    double straight = 0.0;  // Error of a string drawn at its places only.
    for (int time = 0; time < 40; ++time) {
      drawn.run(97);
      heard.run(97);
      MotionFrame frame;
      frame.count = drawn.engine().read_positions(frame.numbers);
      std::vector<float> positions(picture.masses.size());
      find_positions(picture, frame, positions);
      const auto here = [&](double u) {
        const std::array<std::pair<double, double>, 4> at = {
            {{0.0, 0.1}, {0.23, positions[0]}, {0.81, positions[1]}, {1.0, 0.1}}};
        std::size_t k = 0;
        while (at[k + 1].first < u) {
          ++k;
        }
        return at[k].second + (u - at[k].first) / (at[k + 1].first - at[k].first) *
                                  (at[k + 1].second - at[k].second);
      };
      for (std::size_t i = 1; i + 1 < Engine::waveguide_points; ++i) {
        const double there = heard.out[i + 1].back();
        most = std::max(most, std::fabs(there - 0.1));
        apart = std::max(apart, std::fabs(there - positions[waveguide.first + i]));
        straight = std::max(straight, std::fabs(there - here(static_cast<double>(i) / 32.0)));
      }
    }
    INFO(kind << ": " << apart / most << " of the greatest swing, straight lines "
              << straight / most);
    CHECK(apart < 0.02 * most);
    CHECK(straight > 0.3 * most);
  }
}

TEST_CASE("the drawing names the places of a body, and the strings", "[panel]") {
  const std::string text =
      "@bell body 1. clapper left right\n@b1 mode @bell 200. 3. 1. 0.5 -0.5\n"
      "@b2 mode @bell 500. 3. 0.2 -0.8 0.4\n@s modalString 8 1. 300. 0. 1. 0. 0. 2 3. 0.\n"
      "@in1 frcInput [@bell clapper]\n@in2 frcInput [@s 0.25]\n@out1 posOutput [@bell left]\n"
      "@out1 posOutput [@s 0.25]\n";
  Player player(text, struck(1), {});
  const Picture picture = make_picture(player.engine(), network_of(text), 1);
  const auto drawing = nlohmann::json::parse(network_json(picture));
  const auto& bodies = drawing["bodies"];
  REQUIRE(bodies.size() == 2);
  CHECK(bodies[0]["name"] == "bell");
  CHECK(bodies[0]["strings"] == 0);
  CHECK(bodies[0]["places"] == std::vector<std::string>{"clapper", "left", "right"});
  CHECK(bodies[0]["modes"] == std::vector<std::vector<double>>{{1.0, 0.5, -0.5}, {0.2, -0.8, 0.4}});
  CHECK(bodies[1]["strings"] == 2);
  const std::vector<std::string> names = drawing["names"];
  const auto place = std::find(names.begin(), names.end(), "s:0.25");
  REQUIRE(place != names.end());
  const auto at = static_cast<std::size_t>(place - names.begin());
  CHECK(drawing["x"][at].get<double>() == drawing["wide"].get<double>() / 4.0);
}

TEST_CASE("viewing changes no bit of the sound and allocates nothing", "[panel]") {
  const std::string waveguides =
      "@s waveguide 1. 220. 3. 0.4 0.\n@t openWaveguide 0.5 110. 3. 0.6 0.\n"
      "@b springDamper [@s 0.9] [@t 0.3] 0.2 0.01\n@in1 frcInput [@s 0.2]\n"
      "@out1 posOutput [@s 0.2]\n";
  const std::pair<std::string, Method> scenes[] = {{ringing_string(), Method::direct},
                                                   {ringing_string(), Method::modal},
                                                   {waveguides, Method::direct}};
  for (const auto& scene : scenes) {
    const std::string& text = scene.first;
    const Method method = scene.second;
    Harness plain(true, 2);
    Harness watched(true, 2);
    int looks = 0;
    for (Harness* const harness : {&plain, &watched}) {
      auto compiled = compile_network(network_of(text), struck(4), {.method = method});
      REQUIRE(compiled);
      const Picture picture = make_picture(*compiled->engine, network_of(text), 3);
      delete harness->process.slot.offer(new PlayingEngine{
          .engine = std::move(compiled->engine), .serial = 1, .picture = picture.number});
      for (int i = 0; i < 400; ++i) {
        if (i % 40 == 0) {
          harness->now(note_on(0, 50 + i / 40));
        }
        if (harness == &watched && i % 3 != 0) {
          (i % 2 == 0 ? harness->process.wants_motion : harness->process.wants_slow_motion).raise();
        }
        harness->run(static_cast<std::size_t>(17 + i % 200), 64);
        if (harness->process.motion.take()) {
          ++looks;
          const MotionFrame& frame = harness->process.motion.reading();
          CHECK(frame.picture == 3);
          CHECK(frame.frame <= harness->played);
        }
      }
    }
    CHECK(looks > 20);
    CHECK(plain.out == watched.out);
    CHECK(peak(plain.y()) > 1e-3);
    CHECK(watched.heap_calls == 0);
    // The newest frame contains the played sound.
    watched.process.wants_motion.raise();
    watched.run(static_cast<std::size_t>(2.0 * Process::longest_strobe_s * rate), 64);
    watched.process.motion.take();
    watched.process.wants_motion.raise();
    watched.run(64, 64);
    REQUIRE(watched.process.motion.take());
    const auto& heard = watched.process.motion.reading().heard;
    for (std::size_t i = 0; i < heard.size(); ++i) {
      const std::size_t at = watched.played - heard.size() + i;
      REQUIRE(heard[i] == static_cast<float>(0.5 * (watched.out[0][at] + watched.out[1][at])));
    }
  }
}

TEST_CASE("slow motion is stroboscopic at the sounding pitch", "[panel]") {
  for (const int key : {45, 57, 69, 76}) {
    Harness harness(false, 1);
    const std::string text = ringing_string();
    auto compiled = compile_network(network_of(text), struck(2), {});
    REQUIRE(compiled);
    const Picture picture = make_picture(*compiled->engine, network_of(text), 1);
    delete harness.process.slot.offer(new PlayingEngine{
        .engine = std::move(compiled->engine), .serial = 1, .picture = picture.number});
    harness.now(note_on(0, key));
    const double hz = 440.0 * std::exp2((key - 69) / 12.0);
    int frames = 0;
    int at_their_moment = 0;
    const auto heard_at = static_cast<std::size_t>(
        std::find_if(picture.masses.begin(), picture.masses.end(),
                     [&](std::uint32_t mass) {
                       return network_of(text).masses[mass].name == Name("s_m6");
                     }) -
        picture.masses.begin());
    for (int block = 0; block < 1500; ++block) {
      harness.process.wants_slow_motion.raise();
      harness.run(64, 64);
      if (!harness.process.motion.take() || block < 40) {
        continue;
      }
      ++frames;
      const MotionFrame& frame = harness.process.motion.reading();
      const double seconds = static_cast<double>(frame.frame) / rate;
      const double apart = seconds * (hz - 1.0 / Engine::strobe_period_s);
      at_their_moment += std::fabs(apart - std::rint(apart)) < 0.021 ? 1 : 0;
      std::vector<float> positions(picture.masses.size());
      find_positions(picture, frame, positions);
      REQUIRE(std::fabs(positions[heard_at] - harness.y().back()) < 1e-6);
    }
    INFO(key << ": " << at_their_moment << " of " << frames);
    CHECK(frames > 30);
    CHECK(at_their_moment >= 9 * frames / 10);
  }
  // Without a pitch it shows the current state immediately.
  Harness silent(false, 1);
  delete silent.process.slot.offer(constant("0.5"));
  silent.process.wants_slow_motion.raise();
  silent.run(64, 64);
  CHECK(silent.process.motion.take());
}

}  // namespace
}  // namespace ressort::panel_test
