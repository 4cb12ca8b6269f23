// Measures the pitch of shipped presets as `play` plays them, from the sound only, and verifies
// that the measurement detects a deviation of one cent.
#include "app/realtime/denormals.h"
#include "app/session/compile_scene.h"
#include "app/session/loader.h"
#include "tests/support/pitch.h"
#include "tests/support/player.h"
#include "tests/support/thorough.h"

namespace ressort::heard_pitch_test {
namespace {

using support::note_on;
using support::Player;

// Returns the deviation of a key's partial from the key in cents, with the key bent by
// `bent_cents`.
double heard_cents(const std::string& name, double rate_hz, int key, double bent_cents) {
  const DenormalsFlushed flushed;
  const auto scene = load_scene(name, {});
  REQUIRE(scene);
  std::vector<std::string> warnings;
  auto made = compile_scene(*scene, {.rate_hz = rate_hz}, warnings);
  REQUIRE(made);
  const int transpose = made->instrument.transpose;
  const double wanted_hz = 440.0 * std::exp2((key + transpose - 69) / 12.0);
  Player player(*std::move(made));
  // A Hann window's main lobe is two bins wide on either side, which must exceed a few cents.
  const double seconds = std::min(1.0 + 60.0 / wanted_hz, 800.0 / wanted_hz);
  const auto first = static_cast<std::size_t>(0.1 * rate_hz);
  const double semitones = 2.0;  // Range of the pitch wheel.
  player.run(first + static_cast<std::size_t>(seconds * rate_hz),
             {{.kind = EventKind::bend, .value = bent_cents / (100.0 * semitones)},
              note_on(0, key, 100.0 / 127.0)});
  const std::vector<double>& left = player.out.front();
  const std::vector<double>& right = player.out.back();
  const double left_peak = support::peak(std::span(left).subspan(first));
  const auto& louder = left_peak < support::peak(std::span(right).subspan(first)) ? right : left;
  REQUIRE(support::peak(louder) > 1e-4);
  const double hz = support::measured_hz(std::span(louder).subspan(first), rate_hz, wanted_hz,
                                         1.5 / (seconds * wanted_hz));
  return 1200.0 * std::log2(hz / wanted_hz);
}

void check_keys(const std::string& name, double rate_hz, std::initializer_list<int> keys) {
  for (const int key : keys) {
    INFO(name << " at " << rate_hz << " Hz, key " << key);
    const double cents = heard_cents(name, rate_hz, key, 0.0);
    CHECK(std::fabs(cents) < 0.1);
    const double beside = heard_cents(name, rate_hz, key, 1.0);
    CHECK(std::fabs(beside) > 0.9);
    CHECK(std::fabs(beside - cents - 1.0) < 0.02);
  }
}

TEST_CASE("shipped instruments sound within a cent of their keys' pitch", "[heard_pitch]") {
  std::size_t number = 0;
  for (const char* const name :
       {"Vibraphone", "Marimba", "Glockenspiel", "BassGuitar", "ElectricGuitar", "PolyTriangle",
        "IPlayTheTriangle", "PluckedHarmonics", "Resonator", "SixStructures", "ChurchBell"}) {
    if (support::is_in_turn(number++, 2)) {
      check_keys(name, 48000.0, {45, 69});
    }
  }
}

// All presets that are tuned by keys and ring at small amplitudes, except those whose partials are
// pairs of modes that beat (Guitar, Harp, Piano): the tuner measures these.
TEST_CASE("all instruments sound in tune over the keyboard at three rates",
          "[.][heard_pitch_everywhere]") {
  for (const double rate_hz : {44100.0, 48000.0, 96000.0}) {
    for (const char* const name :
         {"1000massString",    "20x30mesh",        "BarMetals",        "BassGuitar",
          "BellPlate",         "BellThirds",       "Bourdon",          "Celesta",
          "ChurchBell",        "ElectricGuitar",   "Glockenspiel",     "Gong",
          "HandBell",          "Harpsichord",      "IPlayTheTriangle", "Kalimba",
          "LargeTriangleMesh", "MajorBell",        "Marimba",          "MarimbaTube",
          "MusicBox",          "PluckedHarmonics", "PolyTriangle",     "Resonator",
          "SixStructures",     "SteelDrum",        "TubularBells",     "Vibraphone",
          "Xylophone"}) {
      check_keys(name, rate_hz, {36, 45, 57, 69, 81, 93});
    }
    // The sticks' noise lasts as long as the tone of keys that no kettledrum has.
    check_keys("Timpani", rate_hz, {36, 45, 57, 69});
  }
}

}  // namespace
}  // namespace ressort::heard_pitch_test
