// Noise whose level and decay are known, beside a mode.
#include "core/identification/noise_bands.h"

#include "tests/support/ringing.h"

namespace ressort::noise_bands_test {

using namespace support;

TEST_CASE("Bands have the level and the decay of the noise", "[noise_bands]") {
  // White noise of rms 0.1 that decays with a T60 of 0.2 s. A band of width B holds a share of
  // B / 22050 of its power: 3000 Hz are -8.7 dB.
  Random random(3);
  const double alpha = std::log(1000.0) / 0.2;
  std::vector<double> noise = with_noise(std::vector<double>(44100), 0.1, random);
  for (std::size_t n = 0; n < noise.size(); ++n) {
    noise[n] *= std::exp(-alpha * static_cast<double>(n) / 44100.0);
  }
  const Identification found{.rate_hz = 44100.0, .sound = {noise}, .residual = {noise}};
  const std::vector<NoiseBand> bands = noise_bands(found);
  REQUIRE(bands.size() == 14);
  const NoiseBand& band = bands[11];
  CHECK(band.low_hz == 7000.0);
  CHECK(band.high_hz == 10000.0);
  // 3000 Hz for 30 ms are about 180 independent values, whose power deviates by 10 %; twice that
  // is allowed.
  CHECK(band.t60_s == Approx(0.2).epsilon(0.2));
  CHECK(band.level[0] == Approx(0.1 * std::sqrt(3000.0 / 22050.0)).epsilon(0.2));
}

TEST_CASE("Bands without noise are left out", "[noise_bands]") {
  const std::vector<double> sound = ringing({{300.0, 1.0, 1.0, 0.0}}, 1.0);
  const Identification found{
      .rate_hz = 44100.0, .sound = {sound}, .residual = {std::vector<double>(sound.size())}};
  CHECK(noise_bands(found).empty());
}

}  // namespace ressort::noise_bands_test
