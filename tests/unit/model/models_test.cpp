// The shipped instruments.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "app/session/files.h"
#include "app/session/loader.h"
#include "core/compile/compile.h"
#include "tests/support/catch.h"
#include "tests/support/harness.h"
#include "tests/support/networks/scenes.h"
#include "tests/support/thorough.h"

namespace ressort::models_test {

namespace {

struct Instrument9 {
  const char* name;
  std::string scene;  // built by scenes.h from the published numbers
};

const std::vector<Instrument9>& nine() {
  static const std::vector<Instrument9> all{
      {"IPlayTheTriangle", scenes::iplay_the_triangle()},
      {"PolyTriangle", scenes::poly_triangle()},
      {"PluckedHarmonics", scenes::plucked_harmonics()},
      {"BowedString", scenes::bowed_string()},
      {"LargeTriangleMesh", scenes::large_triangle_mesh()},
      {"Resonator", scenes::resonator()},
      {"PhysicalLFO", scenes::physical_lfo()},
      {"20x30mesh", scenes::mesh_20x30()},
      {"1000massString", scenes::string_1000()},
  };
  return all;
}

// Returns the names of all links' ends, independent of the order of the lines.
std::multiset<std::tuple<Law, std::string, std::string>> ends(const Network& network) {
  std::multiset<std::tuple<Law, std::string, std::string>> found;
  for (const Link& link : network.links) {
    found.emplace(link.law, network.masses[link.a].name, network.masses[link.b].name);
  }
  return found;
}

}  // namespace

TEST_CASE("the models are the published networks", "[models]") {
  for (const Instrument9& instrument : nine()) {
    INFO(instrument.name);
    const auto scene = load_scene(std::string(instrument.name) + ".mdl", {.bare = true});
    REQUIRE(scene);
    CHECK(scene->warnings.empty());
    const Network expected = support::network_of(instrument.scene);
    CHECK(scene->network.masses.size() == expected.masses.size());
    CHECK(ends(scene->network) == ends(expected));
    CHECK(scene->network.inputs.size() == expected.inputs.size());
    // If a model was published with one output, we added a second one.
    REQUIRE(scene->network.outputs.size() >= expected.outputs.size());
    for (std::size_t i = 0; i < expected.outputs.size(); ++i) {
      CHECK(scene->network.masses[scene->network.outputs[i].mass].name ==
            expected.masses[expected.outputs[i].mass].name);
    }
  }
}

TEST_CASE("every preset has four to eight named controls, with the usual names", "[models]") {
  const std::pair<int, std::string> usual[] = {{74, "Brightness"}, {71, "Ring"}};
  for (const std::string& name : known_presets()) {
    INFO(name);
    const auto scene = load_scene(name, {});
    REQUIRE(scene);
    std::map<int, std::string> names;
    std::set<int> numbers;
    for (const ControlSetting& control : scene->preset.controls) {
      if (control.source == ControlSource::controller) {
        numbers.insert(control.number);
        if (!control.name.empty()) {
          CHECK_FALSE(control.help.empty());
          names[control.number] = control.name;
        }
      }
    }
    CHECK(names.size() >= 4);
    CHECK(names.size() <= 8);
    // SixStructures has a level for each structure in place of Brightness and Touch.
    for (const auto& [number, meaning] : usual) {
      CHECK((names[number] == meaning || (name == "SixStructures" && number != 71)));
    }
    CHECK((numbers.contains(16) || name == "SixStructures"));
    for (const int number : numbers) {
      // The pedal of the piano is no knob, and SixStructures has nine.
      CHECK((names.contains(number) || number == 64 || (name == "SixStructures" && number == 2)));
    }
  }
}

// At equal loudness, pure sustained sounds have the lowest peaks, and clicks with echoes the
// highest. presets/README.md gives the reasons.
TEST_CASE(
    "every preset has two outputs, a forte between -22 and -1 dBFS, and 14 to 34 dB of velocity",
    "[models]") {
  const std::vector<std::string> names = known_presets();
  CHECK(names.size() >= 24);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string& name = names[i];
    if (!support::is_in_turn(i, 2)) {
      continue;
    }
    INFO(name);
    const auto scene = load_scene(name, {});
    REQUIRE(scene);
    REQUIRE(scene->has_preset);
    std::vector<double> levels_db;
    auto compiled = compile_network(scene->network, scene->preset, {});
    REQUIRE(compiled);
    CHECK(compiled->instrument.stiffness_margin >= 1.0);  // at all corners of the ranges
    CHECK(compiled->instrument.outputs == 2);
    for (const double velocity : {20.0, 64.0, 100.0, 127.0}) {
      const std::size_t frames = 66150;  // a bow starts slowly
      std::vector<std::vector<double>> channels(
          static_cast<std::size_t>(compiled->instrument.outputs), std::vector<double>(frames));
      std::vector<double*> outputs;
      for (auto& channel : channels) {
        outputs.push_back(channel.data());
      }
      const Event events[] = {{.kind = EventKind::panic},
                              {.kind = EventKind::note_on, .index = 60, .value = velocity / 127.0}};
      compiled->engine->process(events, {}, outputs, frames);
      double peak = 0.0;
      for (const auto& channel : channels) {
        for (const double sample : channel) {
          peak = std::max(peak, std::fabs(sample));
        }
      }
      levels_db.push_back(20.0 * std::log10(peak));
    }
    CAPTURE(levels_db[0], levels_db[1], levels_db[2], levels_db[3]);
    CHECK(std::is_sorted(levels_db.begin(), levels_db.end()));
    CHECK(levels_db[2] > -22.0);
    CHECK(levels_db[2] < -1.0);
    CHECK(levels_db[3] < 0.0);
    // The quill of a harpsichord plucks with almost the same force, however hard its key is struck.
    CHECK(levels_db[3] - levels_db[0] > (name == "Harpsichord" ? 2.0 : 14.0));
    CHECK(levels_db[3] - levels_db[0] < 34.0);
  }
}

}  // namespace ressort::models_test
