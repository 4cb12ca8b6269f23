// Fixed parts of a preset: keys tune the string and leave the body unchanged.
#include "core/compile/compile.h"
#include "core/model/preset/fit.h"
#include "tests/support/harness.h"
#include "tests/support/pitch.h"

namespace ressort::fixed_test {
namespace {

using namespace support;

constexpr double rate_hz = 44100.0;

// A string of 22 masses, tied to a body with three modes between the keys. A key at one of these
// modes would have a split pitch (a wolf note).
const std::string guitar =
    "@s string 24 1. 0.05 0.0002 0. 0.\n"
    "@box body 4000. bridge top\n"
    "@box_1 mode @box 100. 0.4 1. 1.\n"
    "@box_2 mode @box 205. 0.3 0.8 -0.7\n"
    "@box_3 mode @box 410. 0.2 0.6 0.5\n"
    "@bridge spring [@s 0.9565217391304348] [@box bridge] 0.2 0.002\n"
    "@in1 frcInput [@s 0.2]\n"
    "@out1 posOutput [@s 0.5]\n"
    "@out2 posOutput [@box top]\n";

Preset preset_of(const std::string& fixed) {
  const ParsedPreset parsed =
      parse_preset("model = \"guitar.mdl\"\ngain = 1\n" + fixed +
                   "[[control]]\nfrom = \"note\"\nto = \"in1\"\nhow = \"impulse\"\n");
  REQUIRE(parsed.ok());
  return parsed.preset;
}

// Returns outputs 1 and 2 of a note.
std::vector<std::vector<double>> note(int key, const Preset& preset) {
  auto compiled = compile_network(network_of(guitar), preset, {});
  REQUIRE(compiled);
  constexpr std::size_t frames = 60000;
  std::vector<std::vector<double>> sound(2, std::vector<double>(frames));
  const Event on{
      .kind = EventKind::note_on, .index = static_cast<std::uint16_t>(key), .value = 0.8};
  for (std::size_t at = 0; at < frames; at += 1000) {
    std::vector<double*> to = {sound[0].data() + at, sound[1].data() + at};
    compiled->engine->process(at == 0 ? std::span(&on, 1) : std::span<const Event>(), {}, to, 1000);
  }
  return sound;
}

}  // namespace

TEST_CASE("keys tune a string on a fixed body", "[fixed]") {
  const Preset preset = preset_of("fixed = [\"box\"]\n");
  for (const int key : {40, 45, 52, 57, 64, 69, 76}) {
    const double hz = 440.0 * std::exp2((key - 69) / 12.0);
    const std::vector<double> sound = note(key, preset)[0];
    const double found = measured_hz(std::span(sound).subspan(2000, 50000), rate_hz, hz);
    INFO("key " << key << ": " << 1200.0 * std::log2(found / hz) << " cents");
    CHECK(std::fabs(1200.0 * std::log2(found / hz)) < 0.1);
  }
}

TEST_CASE("a fixed body keeps its modes at every key", "[fixed]") {
  // 100 Hz is far from these keys and their partials.
  for (const int key : {57, 64}) {
    const auto level_at = [&](const Preset& preset, double hz) {
      const std::vector<double> sound = note(key, preset)[1];
      double re = 0.0;
      double im = 0.0;
      for (std::size_t n = 0; n < 20000; ++n) {
        const double turn = 2.0 * std::numbers::pi * hz * static_cast<double>(n) / rate_hz;
        re += sound[n] * std::cos(turn);
        im += sound[n] * std::sin(turn);
      }
      return std::hypot(re, im);
    };
    INFO("key " << key);
    const double beside = level_at(preset_of("fixed = [\"box\"]\n"), 100.5);
    CHECK(beside > 3.0 * level_at(preset_of("fixed = [\"box\"]\n"), 130.0));
    CHECK(beside > 3.0 * level_at(preset_of(""), 100.5));
  }
}

TEST_CASE("a label that the model does not have cannot be fixed", "[fixed]") {
  const std::vector<Error> found =
      find_preset_errors(network_of(guitar), preset_of("fixed = [\"bix\"]\n"));
  REQUIRE(found.size() == 1);
  CHECK(found[0].message == "the model has no element 'bix' for 'fixed'");
}

}  // namespace ressort::fixed_test
