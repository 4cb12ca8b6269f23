// The precision of the direct kernel in float.
#include "app/realtime/denormals.h"
#include "tests/support/player.h"

namespace ressort::float_test {
namespace {

using support::Bare;
using support::Comparison;
using support::isas;
using support::network_of;
using support::program_of;
using support::show;

// A mass at distance `reach` from a ground at `offset`. Its spring and damper are exact in float,
// so the precision of the coefficients plays no role.
struct Swing {
  double hertz = 440.0;
  double offset = 0.0;
  double reach = 1.0;
  float stiffness = 0.0f;
  float damping = 0.0f;

  Swing(double hertz_in, double offset_in, double reach_in)
      : hertz(hertz_in), offset(offset_in), reach(reach_in) {
    const double r = std::pow(10.0, -3.0 / (3.0 * 44100.0));  // T60 of 3 s
    damping = static_cast<float>(1.0 - r * r);
    stiffness = static_cast<float>(1.0 + r * r -
                                   2.0 * r * std::cos(2.0 * std::numbers::pi * hertz / 44100.0));
  }

  Program program() const {
    Program program =
        program_of("@m mass 1. 0. 0.\n@g ground " + number(offset) + "\n@s springDamper @m @g " +
                   number(stiffness) + " " + number(damping) + "\n" + scenes::output(1, "m"));
    program.position[0] = offset + reach;
    return program;
  }

  // Returns the accuracy of the elongation over a second, compared with the widest arithmetic.
  template <class T>
  double nearness_db(const Program& formed, Isa isa) const {
    Bare<T> bare(formed, 1, isa);
    long double x = reach;
    long double v = 0;
    long double force = 0;
    Comparison comparison;
    for (int n = 0; n < 44100; ++n) {
      v += force;
      x += v;
      force = -(static_cast<long double>(stiffness) * x + static_cast<long double>(damping) * v);
      comparison.add(static_cast<double>(x), bare.step({})[0] - offset);
    }
    return comparison.snr_db();
  }

  static std::string number(double value) {
    char text[40];
    std::snprintf(text, sizeof text, "%.17g", value);
    return text;
  }
};

}  // namespace

TEST_CASE("float keeps 100 dB of a motion around 0", "[float]") {
  for (const double hertz : {20.0, 110.0, 440.0, 8000.0}) {
    for (const Isa isa : isas()) {
      const Swing swing(hertz, 0.0, 1.0);
      const double plain = swing.nearness_db<float>(swing.program(), isa);
      INFO(hertz << " Hz: " << plain << " dB");
      CHECK(plain >= 100.0);
    }
  }
}

// d'Alembert: an undamped string at K = M passes its waves on from mass to mass. They return after
// 2 (N + 1) samples.
TEST_CASE("an undamped string at K = M repeats to the last bit", "[float]") {
  for (const Isa isa : isas()) {
    INFO(isa_name(isa));
    Program program = program_of(scenes::string("s", 50, "1.", "0.") + scenes::output(1, "s_m9"));
    for (std::uint32_t i = 0; i < 50; ++i) {
      program.position[i] = 0x1p-10 * static_cast<double>(i < 20 ? i + 1 : 50 - i);
    }
    Bare<float> bare(program, 1, isa);
    constexpr std::size_t period = 102;
    std::vector<double> first;
    std::size_t differing = 0;
    for (std::size_t n = 0; n < 1001 * period; ++n) {
      const double x = bare.step({})[0];
      if (n < period) {
        first.push_back(x);
      } else {
        differing += x != first[n % period] ? 1 : 0;
      }
    }
    CHECK(differing == 0);
    CHECK(support::peak(first) > 0x1p-7);
    CHECK(support::largest_step(first) > 0.0);
  }
}

TEST_CASE("a preset plays in its own precision, unless another is asked for", "[float]") {
  const std::string ringing =
      "@m osc 1. 0.01 0.0001 0. 0.\n@in1 frcInput @m\n" + scenes::output(1, "m");
  const auto played = [&](Precision of_preset, std::optional<Precision> asked) {
    Preset preset = support::struck(1);
    preset.precision = of_preset;
    support::Player player(ringing, preset, {.precision = asked});
    const bool is_told =
        describe(player.compiled.plan).find("in single precision") != std::string::npos;
    CHECK(is_told == (asked.value_or(of_preset) == Precision::float32));
    player.run(4410, {support::note_on(0, 60)});
    return player.y();
  };
  const auto exact = played(Precision::float64, {});
  const auto rounded = played(Precision::float32, {});
  CHECK(exact != rounded);
  CHECK(played(Precision::float32, Precision::float64) == exact);
  CHECK(played(Precision::float64, Precision::float32) == rounded);
}

// Denormal forces are flushed to 0, so the mass keeps swinging at the smallest normal numbers, 680
// dB below 1. No denormal number slows down the computation.
TEST_CASE("a decayed signal contains no denormals if these are flushed", "[float]") {
  Program program = program_of("@m osc 1. 0.1 0.001 0. 0.\n" + scenes::output(1, "m"));
  program.position[0] = 1.0;
  const auto left_after = [&](std::size_t frames) {
    Bare<float> bare(program);
    double x = 0.0;
    double most = 0.0;
    for (std::size_t n = 0; n < frames + 100; ++n) {
      x = std::fabs(bare.step({})[0]);
      most = n >= frames ? std::max(most, x) : 0.0;
    }
    return most;
  };
  constexpr double least = 1.1754943508222875e-38;
  CHECK(left_after(170'000) > least);
  CHECK(left_after(180'000) < least);
  CHECK(left_after(180'000) > 0.0);
  const DenormalsFlushed flushed;
  const double left = left_after(180'000);
  INFO(show(left) << " is left");
  CHECK((left == 0.0 || left > least));
  CHECK(left < 1e-34);
}

}  // namespace ressort::float_test
