// IR-T8: the modes identified from a network's sound equal the network's modes.
#include "core/identification/identify.h"
#include "tests/support/harness.h"
#include "tests/support/ringing.h"

namespace ressort::recordings_test {

using namespace support;

namespace {

// A string of `count` masses between two grounds, struck by a unit force at one and heard at
// another.
std::string string_model(int count, double mass, double stiffness, double damping, int hit,
                         int heard) {
  const auto number = [](double value) { return show(value); };
  std::string text = "@a ground 0.\n@b ground 0.\n";
  for (int i = 0; i < count; ++i) {
    text += "@m" + std::to_string(i) + " mass " + number(mass) + " 0. 0.\n";
  }
  for (int i = 0; i <= count; ++i) {
    const std::string left = i == 0 ? "@a" : "@m" + std::to_string(i - 1);
    const std::string right = i == count ? "@b" : "@m" + std::to_string(i);
    text += "@s" + std::to_string(i) + " springDamper " + left + " " + right + " " +
            number(stiffness) + " " + number(damping) + "\n";
  }
  return text + "@in1 frcInput @m" + std::to_string(hit) + "\n@out1 posOutput @m" +
         std::to_string(heard) + "\n";
}

}  // namespace

TEST_CASE("IR-T8: the modes of a string's sound are those of the string", "[recordings]") {
  const std::uint64_t seed = GENERATE(1u, 2u, 3u);
  INFO("seed " << seed);
  Random random(seed);
  const int count = 6 + static_cast<int>(random.below(8));
  const double mass = random.uniform(0.5, 3.0);
  const double stiffness = random.uniform(0.02, 0.2) * mass;
  const double damping = random.uniform(0.0005, 0.002) * mass;
  const int hit = 0;
  const int heard = count - 1;  // No mode has a node at an end.
  Bare<double> string(program_of(string_model(count, mass, stiffness, damping, hit, heard)));
  std::vector<double> sound;
  for (int n = 0; n < 44100; ++n) {
    sound.push_back(string.step({n == 0 ? 1.0 : 0.0})[0]);
  }
  // Closed form: mode k has 4 K/M sin^2(k pi / 2(N+1)), and the same for Z.
  std::vector<KnownMode> known;
  for (int k = 1; k <= count; ++k) {
    const double sine = std::sin(k * std::numbers::pi / (2.0 * (count + 1)));
    const double lambda = 4.0 * stiffness / mass * sine * sine;
    const double zeta = 4.0 * damping / mass * sine * sine;
    known.push_back(
        {.frequency_hz = 44100.0 / (2.0 * std::numbers::pi) *
                         std::acos((2.0 - lambda - zeta) / (2.0 * std::sqrt(1.0 - zeta))),
         .t60_s = -2.0 * std::log(1000.0) / (44100.0 * std::log(1.0 - zeta))});
  }
  const Identification found = identified({sound}, 44100.0, {.floor_db = -120.0});
  REQUIRE(found.modes.size() == known.size());
  for (std::size_t k = 0; k < known.size(); ++k) {
    INFO(known[k].frequency_hz << " Hz, " << known[k].t60_s << " s");
    const Misses miss = miss_of(known[k], found.modes[k], 0.0);
    CHECK(miss.frequency_hz < 1e-6);  // Required: 0.01 Hz, 0.1 %.
    CHECK(miss.t60_percent < 1e-5);
  }
}

}  // namespace ressort::recordings_test
