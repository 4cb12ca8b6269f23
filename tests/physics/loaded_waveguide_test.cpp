// A waveguide with attached elements stays in tune over the keys, measured from the sound.
#include "core/compile/compile.h"
#include "tests/support/harness.h"
#include "tests/support/pitch.h"

namespace ressort::loaded_waveguide_test {
namespace {

using namespace support;

// Returns the deviation of a key's lowest partial from the key, at the model's output.
double cents_of(const std::string& text, const std::string& keys, int key, double rate_hz) {
  const ParsedPreset parsed =
      parse_preset("model = \"guide.mdl\"\ngain = 1\n" + keys +
                   "[[control]]\nfrom = \"note\"\nto = \"in1\"\nhow = \"impulse\"\n");
  REQUIRE(parsed.ok());
  auto compiled = compile_network(network_of(text), parsed.preset, {.rate_hz = rate_hz});
  REQUIRE(compiled);
  const auto frames = static_cast<std::size_t>(1.2 * rate_hz);
  std::vector<double> sound(frames);
  const Event on{
      .kind = EventKind::note_on, .index = static_cast<std::uint16_t>(key), .value = 0.8};
  for (std::size_t at = 0; at < frames; at += 1000) {
    double* to = sound.data() + at;
    compiled->engine->process(at == 0 ? std::span(&on, 1) : std::span<const Event>(), {}, {&to, 1},
                              std::min<std::size_t>(1000, frames - at));
  }
  const double hz = 440.0 * std::exp2((key - 69) / 12.0);
  const auto start = static_cast<std::size_t>(0.05 * rate_hz);
  return 1200.0 * std::log2(measured_hz(std::span(sound).subspan(start), rate_hz, hz) / hz);
}

const std::string box =
    "@box body 15000. bridge top\n"
    "@box_1 mode @box 100. 0.4 1. 1.\n"
    "@box_2 mode @box 205. 0.3 0.8 -0.7\n"
    "@box_3 mode @box 412. 0.2 0.6 0.5\n";

}  // namespace

TEST_CASE("a string on a stiff bridge is in tune at every key", "[loaded_waveguide]") {
  // The part of the string behind the bridge shortens it: tuned as an unloaded waveguide, keys were
  // 53 cents sharp. No key here is within 50 cents of a mode of the body, where the pitch would
  // split.
  const std::string guitar = "@s waveguide 1.4 110. 8. 0.4 0.\n" + box +
                             "@bridge spring [@s 0.97] [@box bridge] 4. 0.002\n"
                             "@in1 frcInput [@s 0.2]\n@out1 posOutput [@s 0.6]\n";
  for (const double rate_hz : {44100.0, 48000.0, 96000.0}) {
    for (int key = 36; key <= 84; key += 3) {
      const double off = cents_of(guitar, "fixed = [\"box\"]\n", key, rate_hz);
      INFO("key " << key << " at " << rate_hz << " Hz: " << off << " cents");
      CHECK(std::fabs(off) < 0.01);
    }
  }
}

TEST_CASE("masses and springs on a waveguide keep it in tune", "[loaded_waveguide]") {
  const std::string loads[] = {
      // A mass and a plain spring elsewhere in the network.
      "@m mass 8. 0. 0.\n@k spring [@s 0.31] @m 0.3 0.001\n@g ground 0.\n@h spring @m @g 0.2\n",
      // A finger that damps and stiffens.
      "@g ground 0.\n@h spring [@s 0.45] @g 0.01 0.002\n",
      // A string of masses beside it.
      "@t string 9 1. 0.02 0.0005 0. 0.\n@k spring [@s 0.77] [@t 0.5] 0.02 0.0005\n",
      // Two places tied to one mass.
      "@m mass 30. 0. 0.\n@k spring [@s 0.9] @m 0.7\n@l spring [@s 0.95] @m 0.6 0.01\n",
      // A body held by two springs, one of them between its own places.
      "@b body 400. p q\n@b_1 mode @b 310. 2. 1. -0.4\n@b_2 mode @b 701. 1. 0.5 1.\n"
      "@k spring [@s 0.9] [@b p] 0.2 0.001\n@l spring [@b p] [@b q] 0.05\n",
      // Another waveguide, tied by its bridge.
      "@t waveguide 1. 370. 3. 0.3 0.\n@k spring [@s 0.93] [@t 0.88] 0.9 0.01\n"};
  for (const std::string& load : loads) {
    for (const int key : {40, 55, 66, 79}) {
      const double off = cents_of("@s waveguide 1.4 130. 8. 0.4 0.\n" + load +
                                      "@in1 frcInput [@s 0.2]\n@out1 posOutput [@s 0.62]\n",
                                  "", key, 48000.0);
      INFO(load << "key " << key << ": " << off << " cents");
      CHECK(std::fabs(off) < 0.01);
    }
  }
}

}  // namespace ressort::loaded_waveguide_test
