// Sums of damped sinusoids against direct summation, and the fit from wrong starts.
#include "core/identification/damped.h"

#include "core/identification/fit.h"
#include "core/identification/spectrum.h"
#include "tests/support/ringing.h"

namespace ressort::damped_test {

using namespace support;

TEST_CASE("Power sums equal direct summation, near 1 and far from it", "[damped]") {
  Random random(1);
  for (int round = 0; round < 200; ++round) {
    const std::size_t count = 1 + random.below(3000);
    const double away = std::pow(10.0, random.uniform(-7.0, 0.4));
    const double turn = random.uniform(0.0, 3.1);
    const Complex log_z(-away * std::fabs(std::cos(turn)), away * std::sin(turn));
    const PowerSums found = power_sums(Powers(log_z, count), count);
    for (int power = 0; power < 3; ++power) {
      std::complex<long double> sum;
      long double size = 0.0L;
      for (std::size_t n = 0; n < count; ++n) {
        const auto place = static_cast<long double>(n);
        const std::complex<long double> term =
            std::pow(place, static_cast<long double>(power)) *
            std::exp(std::complex<long double>(log_z.real(), log_z.imag()) * place);
        sum += term;
        size += std::abs(term);
      }
      INFO("count " << count << " log z " << show(log_z.real()) << " " << show(log_z.imag()));
      CHECK(std::abs(std::complex<long double>(found.of_power[power]) - sum) <= 1e-9L * size);
    }
  }
}

TEST_CASE("Damped sinusoids and moments equal their definitions", "[damped]") {
  const Complex log_z(-0.01, 0.7);
  const Complex c(0.3, -1.1);
  std::vector<double> sound(1000, 0.25);
  add_damped(sound, {&c, 1}, {&log_z, 1});
  Complex zeroth;
  Complex first;
  for (std::size_t n = 0; n < sound.size(); ++n) {
    const Complex power = std::exp(log_z * static_cast<double>(n));
    CHECK(std::fabs(sound[n] - (0.25 + (c * power).real())) < 1e-14);
    zeroth += sound[n] * power;
    first += static_cast<double>(n) * sound[n] * power;
  }
  const Moments moments = moments_of(sound, {&log_z, 1})[0];
  CHECK(std::abs(moments.zeroth - zeroth) < 1e-12);
  CHECK(std::abs(moments.first - first) < 1e-10);
}

TEST_CASE("Spectral power equals signal power, and white noise's density its variance",
          "[damped]") {
  Random random(2);
  const std::vector<std::vector<double>> noise = {
      with_noise(std::vector<double>(50000), 0.5, random)};
  double square = 0.0;
  for (const double x : noise[0]) {
    square += x * x / 50000.0;
  }
  const Power power(noise, 50000);
  CHECK(power.between(0.0, 4.0) == Approx(square));
  CHECK(power.density(1.0, 0.2) == Approx(0.25).epsilon(0.1));
  CHECK(power.floor(1.0, 0.2) == Approx(0.25).epsilon(0.1));
  CHECK(power.between(0.5, 1.0) == Approx(0.25 * 0.5 / std::numbers::pi).epsilon(0.1));
}

TEST_CASE("A fit converges from wrong starts and never gets worse", "[damped]") {
  const std::vector<KnownMode> known = {{440.0, 2.0, 1.0, 0.3}, {660.0, 1.0, 0.5, 1.0}};
  const std::vector<std::vector<double>> sound = {ringing(known, 1.0)};
  const auto pole = [](double hertz, double t60_s) {
    return Complex(-std::log(1000.0) / (44100.0 * t60_s), 2.0 * std::numbers::pi * hertz / 44100.0);
  };
  SECTION("near") {
    DampedFit fit(sound);
    REQUIRE(fit.set_poles({pole(440.3, 1.0), pole(659.7, 3.0)}));
    fit.refine(30, 1e-7, {});
    CHECK(std::abs(fit.modes()[0].log_z - pole(440.0, 2.0)) < 1e-12);
    CHECK(std::abs(fit.modes()[1].log_z - pole(660.0, 1.0)) < 1e-12);
    CHECK(std::abs(fit.modes()[1].c[0] - std::polar(0.5, 1.0)) < 1e-9);
  }
  SECTION("far") {
    DampedFit fit(sound);
    REQUIRE(fit.set_poles({pole(430.0, 0.1), pole(720.0, 0.2)}));
    const double before = fit.rest_energy();
    fit.refine(30, 1e-7, {});
    CHECK(fit.rest_energy() <= before);
  }
  SECTION("twins") {
    DampedFit fit(sound);
    REQUIRE(fit.set_poles({pole(440.0, 2.0), pole(440.0, 2.0), pole(660.0, 1.0)}));
    CHECK(fit.rest_energy() < 1e-12);
    fit.refine(5, 1e-7, {});
    CHECK(fit.rest_energy() < 1e-12);
  }
}

TEST_CASE("Modes that others can replace leave the amplitudes of the rest", "[damped]") {
  const std::vector<KnownMode> known = {{440.0, 0.2, 1.0, 0.3}, {660.0, 0.1, 0.5, 1.0}};
  const std::vector<std::vector<double>> sound = {ringing(known, 0.3)};
  const auto pole = [](double hertz, double t60_s) {
    return Complex(-std::log(1000.0) / (44100.0 * t60_s), 2.0 * std::numbers::pi * hertz / 44100.0);
  };
  std::vector<Complex> poles = {pole(440.0, 0.2), pole(660.0, 0.1)};
  for (int k = 0; k < 40; ++k) {
    poles.push_back(pole(400.0 + 4.0 * k, 0.1));  // A bandwidth of 22 Hz.
  }
  DampedFit fit(sound);
  REQUIRE(fit.set_poles(poles));
  std::size_t next = poles.size();
  CHECK(fit.eliminate([&](const std::vector<double>& drops) {
    for (const double drop : drops) {
      CHECK(drop >= 0.0);
    }
    return --next > 1 ? next : poles.size();
  }) == 40);
  CHECK(std::abs(fit.modes()[0].c[0] - std::polar(1.0, 0.3)) < 1e-6);
  CHECK(std::abs(fit.modes()[1].c[0] - std::polar(0.5, 1.0)) < 1e-6);
}

}  // namespace ressort::damped_test
