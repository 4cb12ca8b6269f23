// What single precision keeps, with positions as one number and as the sum of two.
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

Program compensated(Program program) {
  program.form = Compensated{};
  return program;
}

// A mass beside a ground at `offset`, `reach` away from it, on a spring and damper that a float
// holds exactly: how fast it moves is then not a matter of precision.
struct Swing {
  double hertz = 440.0;
  double offset = 0.0;
  double reach = 1.0;
  float stiffness = 0.0f;
  float damping = 0.0f;

  Swing(double hertz_in, double offset_in, double reach_in)
      : hertz(hertz_in), offset(offset_in), reach(reach_in) {
    const double r = std::pow(10.0, -3.0 / (3.0 * 44100.0));  // 60 dB in 3 s
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

  // How near to the same in the widest arithmetic the elongation is, over a second.
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

TEST_CASE("float keeps 100 dB of what moves about 0", "[float]") {
  for (const double hertz : {20.0, 110.0, 440.0, 8000.0}) {
    for (const Isa isa : isas()) {
      const Swing swing(hertz, 0.0, 1.0);
      const double plain = swing.nearness_db<float>(swing.program(), isa);
      const double twofold = swing.nearness_db<double>(compensated(swing.program()), isa);
      INFO(hertz << " Hz: " << plain << " dB, compensated " << twofold);
      CHECK(plain >= 100.0);
      CHECK(twofold >= 100.0);
    }
  }
}

TEST_CASE("what moves a little far from 0 is lost in float, unless compensated", "[float]") {
  for (const double hertz : {20.0, 110.0, 440.0, 8000.0}) {
    for (const Isa isa : isas()) {
      const Swing near(hertz, 1.0, 0.01);
      const Swing far(hertz, 100.0, 0.01);
      const double near_plain = near.nearness_db<float>(near.program(), isa);
      const double near_twofold = near.nearness_db<double>(compensated(near.program()), isa);
      const double far_plain = far.nearness_db<float>(far.program(), isa);
      const double far_twofold = far.nearness_db<double>(compensated(far.program()), isa);
      INFO(hertz << " Hz about 1: " << near_plain << " dB, compensated " << near_twofold
                 << "; about 100: " << far_plain << ", compensated " << far_twofold);
      CHECK(near_plain < 75.0);
      CHECK(near_twofold >= 105.0);
      CHECK(far_plain < 35.0);
      CHECK(far_twofold >= 100.0);
    }
  }
}

// d'Alembert: a string at K = M that never decays passes its waves on from mass to mass, there and
// back in 2 (N + 1) samples.
TEST_CASE("an undamped string at K = M comes back to the last bit", "[float]") {
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

// Twenty masses that fly off together: what swings between them does not know.
TEST_CASE("a drift leaves what swings inside to the compensated form", "[float]") {
  constexpr std::size_t last_second = 60;
  const auto chain = [](double drift) {
    std::string text = "@K param 0.1\n";
    for (int i = 0; i < 20; ++i) {
      text += scenes::at("m", i) + " mass 1. 0. 0.\n";
      text += i > 0 ? scenes::at("s", i) + " springDamper " + scenes::at("m", i - 1) + " " +
                          scenes::at("m", i) + " K 0.\n"
                    : "";
    }
    Program program = program_of(text + scenes::output(1, "m0") + scenes::output(2, "m19"));
    for (std::uint32_t i = 0; i < 20; ++i) {
      program.velocity[i] = drift;
      program.position[i] = 0.01 * std::cos(std::numbers::pi * (i + 0.5) / 20.0);  // one mode
    }
    program.parameters[0] = static_cast<double>(0.1f);
    return program;
  };
  Bare<double> still(chain(0.0));
  Bare<float> plain(chain(1e-3));
  Bare<double> twofold(compensated(chain(1e-3)));
  Comparison of_plain;
  Comparison of_twofold;
  const auto stretch = [](const std::vector<double>& out) { return out[1] - out[0]; };
  for (std::size_t n = 0; n < last_second * 44100; ++n) {
    const double expected = stretch(still.step({}));
    const double found = stretch(plain.step({}));
    const double found_twofold = stretch(twofold.step({}));
    if (n >= (last_second - 1) * 44100) {
      of_plain.add(expected, found);
      of_twofold.add(expected, found_twofold);
    }
  }
  INFO("after 60 s " << of_plain.snr_db() << " dB, compensated " << of_twofold.snr_db());
  CHECK(of_twofold.snr_db() >= 60.0);
  CHECK(of_plain.snr_db() < 10.0);
}

TEST_CASE("silence far from 0 is silence in the compensated form", "[float]") {
  Program program =
      program_of("@m mass 1. 0. 0.\n@g ground 1.\n@s springDamper @m @g 0.01 0.0001\n" +
                 scenes::output(1, "m"));
  program.position[0] = 1.01;
  for (const Isa isa : isas()) {
    INFO(isa_name(isa));
    Bare<float> plain(program, 1, isa);
    Bare<double> twofold(compensated(program), 1, isa);
    double left = 0.0;
    double left_twofold = 0.0;
    for (std::size_t n = 0; n < 60 * 44100; ++n) {
      const double x = plain.step({})[0];
      const double y = twofold.step({})[0];
      if (n >= 59 * 44100) {
        left = std::max(left, std::fabs(x - 1.0));
        left_twofold = std::max(left_twofold, std::fabs(y - 1.0));
      }
    }
    CHECK(left_twofold == 0.0);
    CHECK(left > 1e-7);
  }
}

// A force that is flushed pulls no longer: what is left swings at the edge of what there is, for
// ever, 680 dB below 1; but no number that would take longer to compute.
TEST_CASE("what has decayed is no denormal where these are flushed", "[float]") {
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

TEST_CASE("an engine plays compensated, hands and all", "[float]") {
  const std::string text = scenes::string("s", 12, "0.1", "0.002") +
                           "@in1 frcInput @s_m3\n@in2 posInput 0.\n"
                           "@h springDamper @in2 @s_m8 s_K 0.001\n" +
                           scenes::output(1, "s_m5");
  Preset preset = support::struck(3);
  preset.keyboard = true;
  const std::vector<Event> events = {support::note_on(0, 57),
                                     support::note_on(3000, 62),
                                     support::parameter(5000, 1, 0.11),
                                     {.frame = 9000,
                                      .kind = EventKind::gesture,
                                      .gesture = Gesture::position,
                                      .index = 2,
                                      .value = 0.3}};
  support::Player exact(text, preset, {.method = Method::direct});
  support::Player found(text, preset, {.precision = Precision::compensated32});
  exact.run(44100, events, {256, 37});
  found.run(44100, events, {256, 37});
  Comparison comparison;
  for (std::size_t n = 0; n < 44100; ++n) {
    comparison.add(exact.y()[n], found.y()[n]);
  }
  INFO(describe(found.compiled.plan) << comparison.snr_db() << " dB");
  CHECK(comparison.peak > 1e-3);
  CHECK(comparison.snr_db() > 90.0);
  CHECK(found.heap_calls == 0);
}

}  // namespace ressort::float_test
