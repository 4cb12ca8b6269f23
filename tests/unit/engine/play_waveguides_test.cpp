// Waveguides as an instrument: keys, bends, damping, many voices, also in single precision.
#include "core/analysis/stability.h"
#include "core/compile/schemes.h"
#include "core/model/language/expression.h"
#include "tests/support/pitch.h"
#include "tests/support/player.h"

namespace ressort::play_waveguides_test {
namespace {

using namespace support;

const std::string string =
    "@s waveguide 1. 220. 3. 0.5 0.\n@in1 frcInput [@s 0.31]\n@out1 posOutput [@s 0.8]\n";

double cents(std::span<const double> y, double hz) {
  return 1200.0 * std::log2(measured_hz(y, 44100.0, hz) / hz);
}

}  // namespace

TEST_CASE("keys set the pitch of a waveguide", "[play_waveguides]") {
  for (const Precision precision : {Precision::float64, Precision::float32}) {
    for (const int key : {28, 45, 57, 69, 88, 103}) {
      Player player(string, struck(2), {.precision = precision});
      player.run(44100, {note_on(0, key)});
      const double hz = 440.0 * std::exp2((key - 69) / 12.0);
      INFO("key " << key);
      CHECK(std::fabs(cents(std::span(player.y()).subspan(4410), hz)) < 0.1);
      CHECK(player.heap_calls == 0);
    }
  }
}

TEST_CASE("a waveguide's note is damped, sleeps, and repeats exactly", "[play_waveguides]") {
  Preset preset = struck(1);
  preset.damper_s = 0.2;
  Player player(string, preset);
  player.run(88200, {note_on(0, 60), note_off(22050, 60)});
  const std::vector<double> first = player.y();
  CHECK(peak(std::span(first).subspan(44100)) < 1e-3 * peak(first));
  CHECK(player.engine().meters().voices == 0);
  player.run(22050, {note_on(0, 60)});
  const std::span<const double> again = std::span(player.y()).subspan(88200);
  REQUIRE(peak(again) == Approx(peak(std::span(first).subspan(0, 22050))).epsilon(1e-9));
}

TEST_CASE("chords of waveguides are the sum of their notes", "[play_waveguides]") {
  Player chord(string, struck(8));
  chord.run(20000, {note_on(0, 40), note_on(100, 52), note_on(200, 59), note_on(300, 64)});
  std::vector<double> sum(20000, 0.0);
  for (const auto& [at, key] : {std::pair(0u, 40), {100u, 52}, {200u, 59}, {300u, 64}}) {
    Player one(string, struck(8));
    one.run(20000, {note_on(at, key)});
    for (std::size_t n = 0; n < sum.size(); ++n) {
      sum[n] += one.y()[n];
    }
  }
  for (std::size_t n = 0; n < sum.size(); ++n) {
    REQUIRE(chord.y()[n] == Approx(sum[n]).margin(1e-12 * peak(sum)));
  }
}

TEST_CASE("keys do not change a model with fixed waveguides", "[play_waveguides]") {
  Preset preset = struck(1);
  preset.fixed = {"s"};
  const auto made = compile_network(network_of(string), preset, {});
  REQUIRE(made);
  CHECK_FALSE(made->instrument.mode);
  REQUIRE(made->plan.notes.size() == 1);
  CHECK(made->plan.notes[0] == "keys do not set the pitch: every waveguide is fixed");
  for (const int key : {0, 60, 127}) {
    Player player(string, preset);
    player.run(22050, {note_on(0, key)});
    CHECK(std::fabs(cents(std::span(player.y()).subspan(4410), 220.0)) < 0.1);
  }
}

TEST_CASE("springs to a waveguide need no stability proof, springs among masses do",
          "[play_waveguides]") {
  const std::string held = string + "@a mass 1. 0. 0.\n@b mass 1. 0. 0.\n@k spring [@s 0.5] @a ";
  CHECK(compile_network(network_of(held + "1000.\n@l spring @a @b 1.9\n"), struck(1), {}));
  const auto made = compile_network(network_of(held + "0.1\n@l spring @a @b 2.1\n"), struck(1), {});
  CHECK((!made || made->stability.verdict == Verdict::unstable));
  const Network pushed = network_of(held + "-0.1\n");
  const auto forced = compile_network(pushed, struck(1), {.force = true});
  REQUIRE(forced);
  CHECK(forced->stability.verdict == Verdict::unproved);
  const auto values = parameter_values(pushed);
  CHECK(Stability(without_passive(pushed, forced->schemes.links), 1.0)
            .certify({values, values})
            .verdict == Verdict::unproved);
}

}  // namespace ressort::play_waveguides_test
