// Controls whose ranges are in swings: multiples of a loud note's displacement, measured at load.
#include <cstdio>

#include "tests/support/player.h"

namespace ressort::hands_test {
namespace {

using namespace support;

// Returns a string with a felt above it. `times` scales every mass and stiffness, so that swings
// and the depth of the felt shrink by it.
std::string felted_string(double scale, const char* hand = "0.") {
  const auto times = [&](double number) {
    char text[32];
    std::snprintf(text, sizeof text, "%.12f ", scale * number);
    return std::string(text);
  };
  return "@s string 30 " + times(1.0) + times(0.1) + "0. " + times(0.0005) + "0. 0.\n" +
         "@in1 frcInput [@s 0.3]\n@in2 posInput " + hand + "\n" + "@felt contact [@s 0.6] @in2 " +
         times(0.05) + times(0.05) + "\n" + "@out1 posOutput [@s 0.8]\n";
}

std::vector<double> struck(const std::string& text, const Preset& preset, double lever) {
  Player player(text, preset, {.find_gain = true});
  player.run(30000, {controller(0, 16, lever), note_on(10000, 60, 0.8)});
  return {player.y().begin() + 10000, player.y().end()};
}
std::vector<double> struck_with(double scale, double lever) {
  const std::string text = felted_string(scale);
  return struck(text, default_preset(network_of(text), false), lever);
}
std::vector<double> struck_alone() {
  const std::string text = felted_string(1.0, "1000.");
  Preset preset = default_preset(network_of(text), false);
  preset.controls.resize(1);
  return struck(text, preset, 0.0);
}

}  // namespace

TEST_CASE("The default preset has a control for every contact that no key plays", "[hands]") {
  const Preset preset = default_preset(network_of(felted_string(1.0)), false);
  REQUIRE(preset.controls.size() == 2);
  CHECK(preset.controls[1] == ControlSetting{.source = ControlSource::controller,
                                             .number = 16,
                                             .target = "in2",
                                             .gesture = Gesture::touch,
                                             .low = -2.0,
                                             .high = 1.0,
                                             .in_swings = true});
}

TEST_CASE("A control in swings goes from off to pressed at any scale of a model", "[hands]") {
  const std::vector<double> free_string = struck_alone();
  // Measured by the velocity, because a pressed finger displaces the string.
  const auto loss_db = [&](const std::vector<double>& y) {
    return 20.0 * std::log10(largest_step(std::span(free_string).last(10000)) /
                             largest_step(std::span(y).last(10000)));
  };
  std::vector<double> losses;
  for (const double scale : {1.0, 1e-3, 1e3}) {
    INFO(scale);
    // At 0 the control has no effect. The gain makes all equally loud.
    const std::vector<double> off = struck_with(scale, 0.0);
    double apart = 0.0;
    for (std::size_t n = 0; n < off.size(); ++n) {
      apart = std::max(apart, std::fabs(off[n] - free_string[n]));
    }
    CHECK(apart < 1e-9);
    CHECK(peak(off) > 0.4);
    // The felt damps more and more, until it damps nearly everything when pressed.
    double before_db = loss_db(off);
    for (const double lever : {0.5, 0.55, 0.6, 0.7}) {
      INFO(lever);
      const double db = loss_db(struck_with(scale, lever));
      CHECK(db > before_db);
      losses.push_back(db);
      before_db = db;
    }
    CHECK(before_db > 30.0);
    CHECK(loss_db(struck_with(scale, 1.0)) > 30.0);
  }
  for (std::size_t i = 0; i < losses.size(); ++i) {
    CHECK(losses[i] == Approx(losses[i % 4]).epsilon(1e-6));
  }
}

TEST_CASE("A range in swings needs a contact or a pluck", "[hands]") {
  const auto complaint = [](const std::string& model, const std::string& lines) {
    const auto parsed = parse_preset("model = \"x.mdl\"\n[[control]]\nfrom = \"cc16\"\n" + lines);
    if (!parsed.ok()) {
      return parsed.errors.front().message;
    }
    const auto compiled = compile_network(network_of(model), parsed.preset, {});
    return compiled ? std::string() : compiled.error().message;
  };
  const std::string hand = "to = \"in2\"\nhow = \"touch\"\nrange = [-2, 1]\nunit = \"swing\"\n";
  CHECK(complaint(felted_string(1.0), hand).empty());
  CHECK(complaint(felted_string(1.0), "to = \"in2\"\nrange = [-2, 1]\nunit = \"swing\"\n") ==
        "only a touch is measured in swings");
  CHECK(complaint(felted_string(1.0), "to = \"in2\"\nhow = \"touch\"\nunit = \"inch\"\n") ==
        "'unit' must be position or swing");
  CHECK(complaint("@m mass 1. 0. 0.\n@g ground 0.\n@in2 posInput 0.\n@a spring @m @g 0.1 0.\n"
                  "@b spring @in2 @m 0.1 0.\n@out1 posOutput @m\n",
                  hand) == "'in2' has no contact or pluck, so its range cannot be in swings");
}

}  // namespace ressort::hands_test
