// Bodies drawn from statistics, compared with the formulas of statistical room and plate acoustics.
#include "app/commands/body/statistical.h"

#include <complex>
#include <sstream>

#include "app/commands/body/body.h"
#include "tests/support/harness.h"

namespace ressort::statistical_body_test {

using namespace support;

namespace {

constexpr double rate_hz = 44100.0;
constexpr std::uint64_t seeds = 20;

struct ModeLine {
  double hz = 0.0;
  double t60_s = 0.0;
  double bridge = 0.0;
  double left = 0.0;
  double right = 0.0;
};

// Reads the mode lines of a model.
std::vector<ModeLine> modes_in(const std::string& model) {
  std::vector<ModeLine> modes;
  std::istringstream lines(model);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string label;
    std::string keyword;
    std::string body;
    ModeLine mode;
    if (words >> label >> keyword >> body >> mode.hz >> mode.t60_s >> mode.bridge >> mode.left >>
            mode.right &&
        keyword == "mode") {
      modes.push_back(mode);
    }
  }
  return modes;
}

StatisticalBodyOptions plate(std::uint64_t seed) {
  return {.statistics = {.density = {{500.0, 0.02}, {8000.0, 0.02}},
                         .loss = {{1.0, 0.02}},
                         .mass = 12.0,
                         .seed = seed}};
}

}  // namespace

// Skudrzyk: the mean driving-point conductance is n/(4 M), per sample 44,100 times that. The
// velocity is the centred difference, because force times centred velocity is the power.
TEST_CASE("the mean conductance at the bridge is n/(4 M)", "[statistical_body]") {
  constexpr std::size_t frames = 8192;  // T60 is at most 0.22 s, 9700 samples
  constexpr double band_hz[] = {1000.0, 4000.0};
  double sum = 0.0;
  double count = 0.0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    Bare<double> body(
        program_of(statistical_model(plate(seed)) + "@out3 posOutput [@body bridge]\n"));
    std::vector<double> x(frames + 2, 0.0);
    for (std::size_t n = 1; n < x.size(); ++n) {
      x[n] = body.step({n == 1 ? 1.0 : 0.0})[2];
    }
    for (double hz = band_hz[0]; hz < band_hz[1]; hz += 10.0) {
      const auto turn = std::polar(1.0, -2.0 * std::numbers::pi * hz / rate_hz);
      std::complex<double> phase = 1.0;
      for (std::size_t n = 0; n < frames; ++n) {
        sum += 0.5 * (x[n + 1] - (n == 0 ? 0.0 : x[n - 1])) * phase.real();
        phase *= turn;
      }
      count += 1.0;
    }
  }
  CHECK(sum / count == Approx(rate_hz * 0.02 / (4.0 * 12.0)).epsilon(0.1));
}

// 0.05 modes/Hz from 200 to 400 Hz are 10; then a line over the logarithm of the frequency down to
// 0.02 at 3200 Hz, whose integral over 1..8 times 400 Hz is 0.05 x - 0.03 (x ln x - x)/ln 8.
TEST_CASE("the number of modes is the integral of the density", "[statistical_body]") {
  StatisticalBodyOptions options = plate(1);
  options.statistics.density = {{200.0, 0.05}, {400.0, 0.05}, {3200.0, 0.02}};
  const auto integral = [](double x) {
    return 400.0 * (0.05 * x - 0.03 * (x * std::log(x) - x) / std::log(8.0));
  };
  const double expected[] = {10.0, integral(8.0) - integral(1.0)};
  double found[] = {0.0, 0.0};
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    options.statistics.seed = seed;
    for (const ModeLine& mode : modes_in(statistical_model(options))) {
      CHECK(mode.hz >= 200.0);
      CHECK(mode.hz <= 3200.0);
      found[mode.hz < 400.0 ? 0 : 1] += 0.01;
    }
  }
  // The count of a renewal process has a variance of 0.27 per mode: 2 % and 0.6 % for 100 seeds.
  CHECK(found[0] == Approx(expected[0]).epsilon(0.06));
  CHECK(found[1] == Approx(expected[1]).epsilon(0.02));
  CHECK(mean_mode_count(options.statistics.density) ==
        Approx(expected[0] + expected[1]).epsilon(1e-4));
}

TEST_CASE("modes repel each other, and their shapes are Gaussian and independent",
          "[statistical_body]") {
  std::vector<double> spacings;
  double moments[5] = {};  // bridge^2, bridge^4, bridge left, bridge right, left right
  double shapes = 0.0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const std::vector<ModeLine> modes = modes_in(statistical_model(plate(seed)));
    for (std::size_t i = 0; i < modes.size(); ++i) {
      const double khz = modes[i].hz / 1000.0;
      const double bridge = modes[i].bridge;
      const double left = modes[i].left / khz;
      const double right = modes[i].right / khz;
      moments[0] += bridge * bridge;
      moments[1] += std::pow(bridge, 4.0);
      moments[2] += bridge * left;
      moments[3] += bridge * right;
      moments[4] += left * right;
      shapes += 1.0;
      if (i > 0) {
        spacings.push_back(0.02 * (modes[i].hz - modes[i - 1].hz));
      }
    }
  }
  double variance = 0.0;
  double close = 0.0;
  const double count = static_cast<double>(spacings.size());
  for (const double spacing : spacings) {
    variance += (spacing - 1.0) * (spacing - 1.0) / count;
    close += spacing < 0.2 ? 1.0 / count : 0.0;
  }
  // Rayleigh spacings of mean 1. Independent frequencies would give 1 and 0.18.
  CHECK(variance == Approx(4.0 / std::numbers::pi - 1.0).epsilon(0.1));
  CHECK(close == Approx(1.0 - std::exp(-std::numbers::pi * 0.01)).epsilon(0.35));
  // Standard deviations of the means of 3000 products: 0.026, 0.18 and 0.018.
  CHECK(moments[0] / shapes == Approx(1.0).margin(0.08));
  CHECK(moments[1] / shapes == Approx(3.0).margin(0.6));
  for (std::size_t i = 2; i < 5; ++i) {
    CHECK(std::fabs(moments[i] / shapes) < 0.06);
  }
}

TEST_CASE("T60 follows the loss factor, and given modes their Q", "[statistical_body]") {
  StatisticalBodyOptions options = plate(3);
  options.statistics.loss = {{1000.0, 0.01}, {4000.0, 0.03}};
  options.statistics.given = {
      {.frequency_hz = 110.0, .q = 30.0, .bridge = 2.0, .left = -0.5, .right = 0.25}};
  const std::vector<ModeLine> modes = modes_in(statistical_model(options));
  const double decay = std::log(1000.0) / std::numbers::pi;  // 2.199
  CHECK(modes[0].hz == 110.0);
  CHECK(modes[0].t60_s == Approx(decay * 30.0 / 110.0).epsilon(1e-5));
  CHECK(modes[0].bridge == 2.0);
  CHECK(modes[0].left == Approx(-0.5 * 0.11));
  CHECK(modes[0].right == Approx(0.25 * 0.11));
  for (std::size_t i = 1; i < modes.size(); ++i) {
    const double octaves = std::clamp(std::log2(modes[i].hz / 1000.0), 0.0, 2.0);
    CHECK(modes[i].t60_s == Approx(decay / (modes[i].hz * (0.01 + 0.01 * octaves))).epsilon(1e-5));
  }
}

TEST_CASE("the radiation curve is a slope in dB per octave at the outputs alone",
          "[statistical_body]") {
  const StatisticalBodyOptions flat = plate(5);
  StatisticalBodyOptions falling = flat;
  falling.statistics.radiation = {{1000.0, 0.0}, {16000.0, -48.0}};
  const std::vector<ModeLine> before = modes_in(statistical_model(flat));
  const std::vector<ModeLine> after = modes_in(statistical_model(falling));
  REQUIRE(before.size() == after.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    const double db = -12.0 * std::max(0.0, std::log2(before[i].hz / 1000.0));
    CHECK(after[i].bridge == before[i].bridge);
    CHECK(20.0 * std::log10(after[i].left / before[i].left) == Approx(db).margin(1e-3));
    CHECK(20.0 * std::log10(after[i].right / before[i].right) == Approx(db).margin(1e-3));
  }
}

TEST_CASE("equal seeds give equal files, other seeds other modes", "[statistical_body]") {
  CHECK(statistical_model(plate(7)) == statistical_model(plate(7)));
  CHECK(modes_in(statistical_model(plate(7)))[0].hz != modes_in(statistical_model(plate(8)))[0].hz);
}

TEST_CASE("the options of statistical bodies are checked", "[statistical_body]") {
  const auto curve = parse_curve("100:0.05,1e3:0.02", 0.0, 1.0);
  REQUIRE(curve);
  CHECK(*curve == std::vector<CurvePoint>{{100.0, 0.05}, {1000.0, 0.02}});
  CHECK(parse_curve("0.02", 0.0, 1.0)->size() == 1);
  for (const char* wrong : {"", "x", "2", "100:0.1,", "100:0.1,100:0.2", "200:0.1,100:0.1", "0:0.1",
                            "30000:0.1", "100:2", "100:-1", "100", "100:0.1:3", "nan"}) {
    INFO(wrong);
    CHECK_FALSE(parse_curve(wrong, 0.0, 1.0));
  }
  const auto mode = parse_mode("275,30,1.5,-0.4");
  REQUIRE(mode);
  CHECK(mode->bridge == 1.5);
  CHECK(mode->left == -0.4);
  CHECK(mode->right == -0.4);
  CHECK(parse_mode("275,30")->left == 1.0);
  for (const char* wrong : {"", "275", "275,0", "0,30", "275,30,1,1,1,1", "275,30,x", "275;30"}) {
    INFO(wrong);
    CHECK_FALSE(parse_mode(wrong));
  }
}

}  // namespace ressort::statistical_body_test
