// Exact modes against closed-form solutions of the continuous network.
#include <complex>

#include "core/compile/plan.h"
#include "core/kernels/modal/modal_form.h"
#include "tests/support/comparison.h"

namespace ressort::modes_exact_test {
namespace {

using support::Comparison;
using support::isas;
using support::KernelRunner;
using support::network_of;
using support::show;

constexpr Budget physical{.cents = 1e-6};
constexpr double pi = std::numbers::pi;

Program in_modes(const std::string& text, const Budget& budget) {
  Program program = make_program(network_of(text), 44100.0, true);
  std::optional<Modes> modes = modal_form(program, budget);
  REQUIRE(modes);
  program.form = std::move(*modes);
  return program;
}

// Returns [output][frame] of free motion.
template <class T>
std::vector<std::vector<double>> let_ring(const Program& program, std::size_t frames,
                                          Isa isa = best_isa()) {
  KernelRunner<T> fighter(program, 1.0, isa);
  const std::vector<double> rest(program.inputs.size(), 0.0);
  std::vector<std::vector<double>> heard(program.outputs.size());
  for (std::size_t at = 0; at < frames; at += 60) {
    const auto some = fighter.play(std::vector<std::vector<double>>(60, rest));
    for (std::size_t i = 0; i < some.size(); ++i) {
      heard[i % heard.size()].push_back(some[i]);
    }
  }
  return heard;
}

// Returns the solution of q'' + Z q' + K q = 0 at time n that is a at -1 and b at 0.
double damped_cosine(double k, double z, double a, double b, double n) {
  const std::complex<double> root = std::sqrt(std::complex<double>(0.25 * z * z - k));
  const std::complex<double> one = std::exp(-0.5 * z + root);
  const std::complex<double> two = std::exp(-0.5 * z - root);
  const std::complex<double> first = (b - two * a) / (1.0 - two / one);
  return (first * std::exp((-0.5 * z + root) * n) + (b - first) * std::exp((-0.5 * z - root) * n))
      .real();
}

struct Pole {
  double cents = 0.0;        // relative to the continuous oscillator
  double t60_percent = 0.0;  // excess over the continuous oscillator's T60, in percent
};

// Returns the pole, from the recurrence x[n+1] = a x[n] - b x[n-1] of the samples.
Pole pole_of(const std::vector<double>& x, double k, double z) {
  double xx = 0.0, xy = 0.0, yy = 0.0, xt = 0.0, yt = 0.0;
  for (std::size_t n = 2; n + 1 < x.size(); ++n) {
    xx += x[n] * x[n];
    xy += x[n] * x[n - 1];
    yy += x[n - 1] * x[n - 1];
    xt += x[n] * x[n + 1];
    yt += x[n - 1] * x[n + 1];
  }
  const double determinant = xx * yy - xy * xy;
  const double a = (xt * yy - yt * xy) / determinant;
  const double b = -(xx * yt - xy * xt) / determinant;
  const double angle = std::acos(a / (2.0 * std::sqrt(b)));
  const double wanted = std::sqrt(k - 0.25 * z * z);
  return {1200.0 * std::log2(angle / wanted), 100.0 * (-z / std::log(b) - 1.0)};
}

TEST_CASE("An exact oscillator has its pitch and its decay", "[modes_exact]") {
  for (const auto& [k, z] : {std::pair{0.1, 0.001}, {1.0, 0.0001}, {2.0, 0.01}, {3.9, 0.01}}) {
    const std::string text = "@a osc 1. " + show(k) + " " + show(z) + " 1. 1.\n" +
                             "@in1 frcInput @a\n@out1 posOutput @a\n";
    const Pole exact = pole_of(let_ring<double>(in_modes(text, physical), 2000)[0], k, z);
    INFO(show(k) << ": " << show(exact.cents) << " cents, " << show(exact.t60_percent) << " %");
    CHECK(std::fabs(exact.cents) < 1e-6);
    CHECK(std::fabs(exact.t60_percent) < 1e-6);
  }
  // The published scheme has neither the pitch nor the decay.
  const std::string text = "@a osc 1. 0.1 0.001 1. 1.\n@in1 frcInput @a\n@out1 posOutput @a\n";
  const Pole plain = pole_of(let_ring<double>(in_modes(text, {}), 2000)[0], 0.1, 0.001);
  CHECK(std::fabs(plain.cents - 7.71720773873) < 1e-6);
  CHECK(plain.t60_percent < -0.04);
}

// Every mass of a fixed string starts at a random position and speed.
std::string thrown_string(int count, double k, double z) {
  std::string text = "@K param " + show(k) + "\n@Z param " + show(z) + "\n@l ground 0.\n";
  support::Random random(7);
  for (int i = 0; i < count; ++i) {
    const double x = random.uniform(-1.0, 1.0);
    text += scenes::at("m", i) + " mass 1. " + show(x) + " " + show(x - random.uniform(-0.1, 0.1)) +
            "\n";
  }
  text += "@r ground 0.\n";
  for (int i = 0; i <= count; ++i) {
    text += scenes::at("s", i) + " springDamper " + (i == 0 ? "@l" : scenes::at("m", i - 1)) + " " +
            (i == count ? "@r" : scenes::at("m", i)) + " K Z\n";
  }
  return text + scenes::output(1, "m3") + scenes::output(2, "m" + std::to_string(count - 2));
}

// Returns the sum of the string's modes. Sample 0 is the first output, and springs act from then
// on.
std::vector<double> ringing_string(const Program& program, std::uint32_t heard, double k, double z,
                                   std::size_t frames) {
  const std::uint32_t count = program.moving;
  std::vector<double> x(frames, 0.0);
  for (std::uint32_t j = 1; j <= count; ++j) {
    const auto shape = [&](std::uint32_t i) {
      return std::sqrt(2.0 / (count + 1)) * std::sin(pi * j * (i + 1) / (count + 1));
    };
    double before = 0.0;
    double now = 0.0;
    for (std::uint32_t i = 0; i < count; ++i) {
      before += shape(i) * program.position[i];
      now += shape(i) * (program.position[i] + program.velocity[i]);
    }
    const double half = std::sin(0.5 * pi * j / (count + 1));
    const double factor = 4.0 * half * half;
    for (std::size_t n = 0; n < frames; ++n) {
      x[n] += shape(heard) * damped_cosine(k * factor, z * factor, before, now, double(n));
    }
  }
  return x;
}

TEST_CASE("A string with exact modes is the sum of its damped cosines", "[modes_exact]") {
  struct Case {
    int count;
    double k, z;
  };
  // The highest modes of the last string are overdamped.
  for (const auto& [count, k, z] :
       {Case{50, 0.1, 0.001}, Case{30, 1.5, 0.01}, Case{20, 0.02, 0.3}}) {
    const Program program = in_modes(thrown_string(count, k, z), physical);
    for (const Isa isa : isas()) {
      const auto heard = let_ring<double>(program, isa == best_isa() ? 44100 : 3000, isa);
      for (std::size_t o = 0; o < 2; ++o) {
        const auto wanted = ringing_string(program, program.outputs[o].node, k, z, heard[o].size());
        Comparison comparison;
        for (std::size_t n = 0; n < wanted.size(); ++n) {
          comparison.add(wanted[n], heard[o][n]);
        }
        INFO(count << " masses, " << isa_name(isa) << ": " << comparison.snr_db() << " dB");
        CHECK(comparison.snr_db() > 150.0);
      }
    }
  }
}

TEST_CASE("Exact modes are as accurate in float as the published scheme", "[modes_exact]") {
  const std::string text = thrown_string(50, 0.1, 0.001);
  const auto noise = [&](const Budget& budget) {
    const Program program = in_modes(text, budget);
    const auto precise = let_ring<double>(program, 44100)[0];
    const auto single = let_ring<float>(program, 44100)[0];
    Comparison comparison;
    for (std::size_t n = 0; n < precise.size(); ++n) {
      comparison.add(precise[n], single[n]);
    }
    return comparison.snr_db();
  };
  const double published = noise({});
  const double exact = noise(physical);
  INFO(published << " dB, " << exact << " dB");
  CHECK(exact > 85.0);
  CHECK(exact > published - 6.0);
}

TEST_CASE("A constant force moves exact modes to the static deflection", "[modes_exact]") {
  const std::string text =
      scenes::string("s", 5, "0.8", "0.2") + "@in1 frcInput @s_m2\n" + scenes::output(1, "s_m2");
  KernelRunner<double> fighter(in_modes(text, physical), 1.0, best_isa());
  std::vector<double> heard;
  for (int i = 0; i < 100; ++i) {
    heard = fighter.play(std::vector<std::vector<double>>(60, {0.3}));
  }
  // Two chains of three springs each, in parallel.
  CHECK(std::fabs(heard.back() / (0.3 * 3.0 / (2.0 * 0.8)) - 1.0) < 1e-12);
}

// The same with a changing stiffness, by the published scheme at many times the rate.
std::vector<double> finely(double k, double z, double to, std::size_t from, std::size_t ramp,
                           std::size_t frames) {
  constexpr int fine = 256;
  double x = damped_cosine(k, z, 1.0, 1.0, 0.0);
  const double later = damped_cosine(k, z, 1.0, 1.0, 1.0 / fine);
  double v = (later - x) * fine;
  std::vector<double> heard;
  for (std::size_t n = 0; n < frames; ++n) {
    heard.push_back(x);
    for (int i = 0; i < fine; ++i) {
      const double t = static_cast<double>(n) + (i + 0.5) / fine;
      const double done = std::clamp((t - static_cast<double>(from)) / double(ramp), 0.0, 1.0);
      const double stiffness = k + done * (to - k);
      // Half a step of velocity, a whole step of position, half a step of velocity
      // (Störmer-Verlet).
      v -= 0.5 / fine * (stiffness * x + z * v);
      x += v / fine;
      v = (v - 0.5 / fine * stiffness * x) / (1.0 + 0.5 / fine * z);
    }
  }
  return heard;
}

TEST_CASE("Exact modes follow a changing stiffness", "[modes_exact]") {
  constexpr std::size_t frames = 3000;
  constexpr std::size_t from = 600;
  const std::string text = "@K param 0.1\n@Z param 0.001\n@a osc 1. K Z 1. 1.\n" +
                           std::string("@in1 frcInput @a\n@out1 posOutput @a\n");
  const auto play = [&](const Budget& budget) {
    const Program program = in_modes(text, budget);
    KernelRunner<double> fighter(program, 1.0, best_isa());
    std::vector<double> heard;
    for (std::size_t at = 0; at < frames; at += 60) {
      if (at == from) {
        fighter.turn({0.14, 0.001}, 1.0, true);
      }
      const auto some = fighter.play(std::vector<std::vector<double>>(60, {0.0}));
      heard.insert(heard.end(), some.begin(), some.end());
    }
    return heard;
  };
  // The first sample with the new stiffness uses the previous position.
  const auto wanted = finely(0.1, 0.001, 0.14, from - 1, 128, frames + 1);
  const auto snr = [&](const std::vector<double>& heard) {
    Comparison comparison;
    for (std::size_t n = 0; n < frames; ++n) {
      comparison.add(wanted[n + 1], heard[n]);
    }
    return comparison.snr_db();
  };
  INFO(snr(play(physical)) << " dB, published " << snr(play({})) << " dB");
  CHECK(snr(play(physical)) > 50.0);
  CHECK(snr(play({})) < 10.0);
}

TEST_CASE("The plan chooses exact modes if the published scheme exceeds the budget",
          "[modes_exact]") {
  const auto plan_for = [](const std::string& stiffness, const Budget& budget) {
    const Network network = network_of(scenes::string("s", 50, stiffness, "0.0001") +
                                       "@in1 frcInput @s_m4\n" + scenes::output(1, "s_m9"));
    const auto [machine, parts, more] =
        make_plan(make_machine(network, 44100.0, true), {}, {}, patient_modes, budget);
    const Modes* const modes = machine.parts[0].form.get_if<Modes>();
    INFO(describe(parts));
    return std::pair{modes != nullptr && modes->is_exact, describe(parts)};
  };
  CHECK(plan_for("0.1", {.cents = 3.0}).first);
  CHECK(plan_for("0.1", {.cents = 3.0}).second.find("continuous network") != std::string::npos);
  CHECK_FALSE(plan_for("0.1", {.cents = 40.0}).first);
  CHECK_FALSE(plan_for("0.005", {.cents = 3.0}).first);
  CHECK_FALSE(plan_for("0.1", {}).first);
}

TEST_CASE("The errors of the published scheme match theory", "[modes_exact]") {
  const auto of = [](const std::string& stiffness, const std::string& damping) {
    const Program program = support::program_of(scenes::string("s", 50, stiffness, damping) +
                                                scenes::output(1, "s_m9"));
    return AccuracyMeter(program, {{program.parameters, 1.0}}, patient_modes).of(Form());
  };
  // The highest mode of such a string is off by 31.7 cents and 0.2 %: its K is 0.4 cos^2(pi/102),
  // so its frequency is 2 asin(sqrt(K)/2) instead of sqrt(K - Z^2/4).
  CHECK(of("0.1", "0.001").cents == Approx(31.7).epsilon(0.01));
  CHECK(of("0.1", "0.001").t60_percent > 0.19);
  CHECK(of("0.1", "0.001").t60_percent < 0.21);
}

}  // namespace
}  // namespace ressort::modes_exact_test
