// Oversampling: several steps per sample equal the network at a multiple of the rate, decimated.
#include <complex>
#include <numbers>

#include "core/kernels/oversampled/oversampled_form.h"
#include "core/model/language/expression.h"
#include "tests/support/harness.h"

namespace ressort::oversampled_test {
namespace {

using support::Bare;
using support::isas;
using support::Motion;
using support::network_of;
using support::show;

constexpr std::uint32_t times = 4;

// Springs, gravity, a position input that makes a contact, a force input, and a force output.
std::string touched() {
  return scenes::string("s", 9, "0.1", "0.002") +
         "@h mass 1.5 0.001 0.\n@k springDamper @h @s_m4 0.05 0.001\n"
         "@o osc 2. 0.02 0.003 0.01 0.\n@j springDamper @o @s_m2 0.03 0.\n"
         "@in1 posInput 0.3\n@c contact @in1 @s_m6 0.05 0.001 0.\n@in2 frcInput @s_m1\n" +
         scenes::output(1, "s_m3") + scenes::output(2, "o") + "@out3 frcOutput @s_m6\n";
}

TEST_CASE("several steps a sample equal as many samples at a higher rate", "[oversampled]") {
  const Program coarse = make_program(network_of(touched()), 44100.0, true);
  for (const Isa isa : isas()) {
    Program program = coarse;
    program.form = oversampled_form(oversampled_program(coarse, times), times);
    Bare<double> found(program, 1, isa);
    Bare<double> wanted(make_program(network_of(touched()), 44100.0 * times, true), 1, isa);
    const Motion hand(7, 20.0, 200.0);
    double before = 0.3;
    double peak = 0.0;
    double worst = 0.0;
    bool has_touched = false;
    for (std::size_t n = 0; n < 4000; ++n) {
      const double at = 0.3 - 0.6 * std::fabs(hand(n));
      const double force = n % 500 < 3 ? 0.02 : 0.0;
      const auto heard = found.step({at, force});
      std::vector<double> fine;
      for (std::uint32_t i = 1; i <= times; ++i) {
        fine = wanted.step({before + (at - before) * i / times, force / (times * times)});
      }
      for (std::size_t o = 0; o < 3; ++o) {
        peak = std::max(peak, std::fabs(fine[o]));
        worst = std::max(worst, std::fabs(heard[o] - fine[o]));
      }
      has_touched = has_touched || at < 0.0;
      before = at;
    }
    INFO("off by " << show(worst) << " of " << show(peak));
    CHECK(has_touched);
    CHECK(peak > 0.01);
    // The displacement of the input is summed in another order.
    CHECK(worst < 1e-11 * peak);
  }
}

TEST_CASE("ramps and states are passed on to the finer steps", "[oversampled]") {
  Program program = make_program(network_of(touched()), 44100.0, true);
  program.form = oversampled_form(oversampled_program(program, times), times);
  Bare<double> one(program);
  Bare<double> other(program);
  std::vector<double> x(program.position.size());
  std::vector<double> v(x.size());
  for (std::size_t n = 0; n < 100; ++n) {
    one.step({0.3, n == 0 ? 0.1 : 0.0});
  }
  // A kernel continues from a saved state, except for the link forces of that sample.
  REQUIRE(one.kernel().save(0, x.data(), v.data()));
  other.kernel().set_state(0, x.data(), v.data());
  std::vector<double> y(x.size());
  std::vector<double> w(x.size());
  REQUIRE(other.kernel().save(0, y.data(), w.data()));
  CHECK(x == y);
  CHECK(v == w);
  // A spring that becomes stiffer reaches its new value within 64 samples.
  std::vector<double> turned = program.parameters;
  turned[1] *= 1.5;
  one.set_coefficients(0, turned, 1.0, true);
  one.kernel().coefficients.ramp(64);
  for (std::size_t n = 0; n < 64; ++n) {
    one.step({0.3, 0.0});
  }
  for (std::uint32_t c = 0; c < program.coefficients.size(); ++c) {
    const double wanted = coefficient_value(program, program.coefficients[c], turned, 1.0);
    CHECK(one.kernel().coefficients.value[c * one.lanes()] == Approx(wanted).epsilon(1e-12));
  }
}

// An oscillator, plucked off its rest.
Program oscillator(double stiffness, bool by_key) {
  Program program = make_program(
      network_of("@m osc 1. " + print_number(stiffness) + " 0. 1. 0.\n@out1 posOutput @m\n"),
      44100.0, true);
  program.form = oversampled_form(oversampled_program(program, times), times, by_key);
  return program;
}

// The frequency of an oscillator of mass 1 that takes `times` steps of symplectic Euler a sample.
double omega_of(double stiffness) {
  return 2.0 * times * std::asin(std::sqrt(stiffness) / (2.0 * times));
}

TEST_CASE("a low voice takes one step a sample at the pitch of several", "[oversampled]") {
  constexpr double stiffness = 0.05;  // 1,570 Hz: one step would be 3.4 cents sharp
  const double omega = omega_of(stiffness);
  Bare<double> bare(oscillator(stiffness, true), 2);
  const double ratio = std::sin(0.5 * omega) / (times * std::sin(0.5 * omega / times));
  bare.kernel().tune(0, {.warp = ratio * ratio, .share = 1.0 / (times * times), .is_new = true});
  bare.kernel().reset(0);
  std::vector<std::vector<double>> heard(2);
  for (int n = 0; n < 20000; ++n) {
    bare.step({});
    heard[0].push_back(bare.outputs(0)[0]);
    heard[1].push_back(bare.outputs(1)[0]);
  }
  for (const std::vector<double>& y : heard) {
    // The phase relative to a tone of omega, from a Hann window of 1,000 samples.
    const auto phase_at = [&](std::size_t first) {
      std::complex<double> sum;
      for (std::size_t n = 0; n < 1000; ++n) {
        const double window =
            1.0 - std::cos(2.0 * std::numbers::pi * static_cast<double>(n) / 1000.0);
        sum += window * y[first + n] * std::polar(1.0, -omega * static_cast<double>(first + n));
      }
      return std::arg(sum);
    };
    // 0.001 cents over 18,000 samples are 0.0023 rad.
    CHECK(std::fabs(phase_at(19000) - phase_at(1000)) < 0.0023);
  }
  // The voice of one step moves further per step than that of four, so the two differ.
  CHECK(heard[0] != heard[1]);
}

TEST_CASE("a voice that is bent beyond the limit of one step takes several", "[oversampled]") {
  // The stiffness 5 is unstable at one step a sample, and stable at four. The bend keeps the
  // position and the velocity, so the amplitude stays within 1 / sqrt(K) of velocity and position.
  constexpr double stiffness = 0.05;
  const Program program = oscillator(stiffness, true);
  Bare<double> bare(program);
  bare.kernel().tune(0, {.warp = 1.0, .share = 0.01, .is_new = true});
  bare.kernel().reset(0);
  double before = 0.0;
  for (int n = 0; n < 1000; ++n) {
    before = bare.step({})[0];
  }
  bare.kernel().tune(0, {.warp = 1.0, .share = 1.0});
  double x = 0.0;
  double v = 0.0;
  REQUIRE(bare.kernel().save(0, &x, &v));
  CHECK(x == before);
  bare.set_coefficients(0, program.parameters, 100.0, false);
  double peak = 0.0;
  for (int n = 0; n < 20000; ++n) {
    peak = std::max(peak, std::fabs(bare.step({})[0]));
  }
  CHECK(peak > 0.9 * std::fabs(x));
  CHECK(peak < 1.3 * std::hypot(x, v / std::sqrt(100.0 * stiffness)));
}

}  // namespace
}  // namespace ressort::oversampled_test
