// What is stepped once in many samples, against the continuous network and against every sample.
#include "core/kernels/direct/fourth_form.h"
#include "core/kernels/slow/slow_form.h"
#include "tests/support/player.h"
#include "tests/support/poles.h"

namespace ressort::slow_test {
namespace {

using support::Bare;
using support::Comparison;
using support::Continuous;
using support::isas;
using support::program_of;

Program lfo() {
  return program_of(scenes::physical_lfo());
}

Program slowed(Program program, std::uint32_t frames) {
  auto form = slow_by(program, frames);
  REQUIRE(form);
  program.form = *std::move(form);
  return program;
}

Program struck_lfo() {
  Program program = lfo();
  program.velocity[0] = 1e-5;
  return program;
}

// For a second, two turns of the slowest mode.
template <class T>
double nearness_db(const Program& program, Isa isa) {
  constexpr std::size_t frames = 44100;
  const auto expected = Continuous(program).at(program.outputs[0].node, frames + 1);
  Bare<T> bare(program, 1, isa);
  Comparison comparison;
  for (std::size_t n = 1; n <= frames; ++n) {
    comparison.add(expected[n], bare.step({0.0})[0]);
  }
  return comparison.snr_db();
}

// As the published scheme would do at the low rate.
Program published_slowly(Program program, std::uint32_t frames) {
  Slow form = *slow_by(program, frames);
  Program coarse = *form.coarse;
  coarse.form = Direct{};
  form.coarse = std::make_shared<const Program>(std::move(coarse));
  program.form = std::move(form);
  return program;
}

}  // namespace

TEST_CASE("an LFO needs one step in 64 samples", "[slow]") {
  const struct {
    std::uint32_t frames;
    double wanted_db;
  } cases[] = {{64, 80.0}, {256, 52.0}};
  for (const auto& [frames, wanted_db] : cases) {
    const double published = nearness_db<double>(published_slowly(struck_lfo(), frames), Isa::base);
    for (const Isa isa : isas()) {
      const double found = nearness_db<double>(slowed(struck_lfo(), frames), isa);
      INFO("once in " << frames << ": " << found << " dB, as published " << published);
      CHECK(found >= wanted_db);
      CHECK(published < found - 30.0);
    }
    const double in_float = nearness_db<float>(slowed(struck_lfo(), frames), best_isa());
    INFO("once in " << frames << ": " << in_float << " dB in float");
    CHECK(in_float >= wanted_db - 3.0);
  }
}

TEST_CASE("how seldom follows from the fastest mode", "[slow]") {
  CHECK(slow_form(lfo(), 1.0)->frames == 64);  // 4e-6 * 64^2 = 0.016, * 128^2 = 0.066
  CHECK(slow_form(lfo(), 4.0)->frames == 32);
  CHECK_FALSE(slow_form(lfo(), 4000.0));
  CHECK_FALSE(slow_form(program_of(scenes::poly_triangle()), 1.0));
  CHECK_FALSE(slow_form(
      program_of(scenes::physical_lfo() + "@in2 posInput 1.\n@c contact @str_m3 @in2 1e-6 0. 0.\n"),
      1.0));
}

// Forces of all kinds act, up to two coarse steps late.
TEST_CASE("what is slow feels what comes in within two steps", "[slow]") {
  constexpr std::uint32_t frames = 64;
  constexpr std::size_t samples = 100'000;
  const support::Motion hand(7, 0.2, 3.0);
  const auto perform = [&](const Program& program, std::size_t late) {
    Bare<double> bare(program);
    std::vector<double> out;
    for (std::size_t n = 0; n < samples; ++n) {
      const double at = n < 5000 + late ? 0.0 : hand(n - 5000 - late);
      out.push_back(bare.step({1e-9 * at})[0]);
    }
    return out;
  };
  const auto found = perform(slowed(lfo(), frames), 0);
  const auto nearness = [&](std::size_t late) {
    Comparison comparison;
    const auto expected = perform(lfo(), late);
    for (std::size_t n = 0; n < samples; ++n) {
      comparison.add(expected[n], found[n]);
    }
    return comparison.snr_db();
  };
  double best = 0.0;
  std::size_t best_late = 0;
  for (std::size_t late = 0; late <= 3 * frames; late += frames / 4) {
    const double here = nearness(late);
    if (here > best) {
      best = here;
      best_late = late;
    }
  }
  INFO(best_late << " samples late, " << best << " dB");
  CHECK(best_late <= 2 * frames);
  CHECK(best > 60.0);
}

// The kernels that step it have been told nothing by then. What is published is damped a sample
// late, by a share of Z.
TEST_CASE("what is slow is struck before its first step, too", "[slow]") {
  const std::vector<std::uint32_t> node = {1};  // which is heard
  const std::vector<double> change = {1e-5};
  Bare<double> exact(lfo());
  Bare<double> slow(slowed(lfo(), 64));
  exact.kernel().strike(0, node, change);
  slow.kernel().strike(0, node, change);
  for (std::size_t n = 0; n < 32; ++n) {
    const double expected = exact.step({0.0})[0];
    REQUIRE(expected > 0.0);
    CHECK(std::fabs(slow.step({0.0})[0] - expected) < 2e-4 * expected);
  }
}

TEST_CASE("what is slow turns its parameters and goes on elsewhere", "[slow]") {
  const Program program = struck_lfo();
  Bare<double> exact(program);
  Bare<double> slow(slowed(program, 64));
  const auto turn = [&](auto& bare) {
    auto parameters = program.parameters;
    parameters[1] *= 1.3;  // str_K
    bare.set_coefficients(0, parameters, 1.0, true);
    bare.kernel().coefficients.ramp(2000);
  };
  Comparison comparison;
  for (std::size_t n = 0; n < 60'000; ++n) {
    if (n == 20'000) {
      turn(exact);
      turn(slow);
    }
    comparison.add(exact.step({0.0})[0], slow.step({0.0})[0]);
  }
  INFO("turned: " << comparison.snr_db() << " dB");
  CHECK(comparison.snr_db() > 40.0);  // the ramp is felt up to two steps late

  // Where everything is at any time, as if it had been stepped sample by sample.
  std::vector<double> x(program.position.size());
  std::vector<double> v(x.size());
  std::vector<double> found_x(x.size());
  std::vector<double> found_v(x.size());
  Program fine = program;
  fine.form = *fourth_form(program);
  Bare<double> again(fine);
  Bare<double> again_slow(slowed(program, 64));
  for (std::size_t n = 0; n < 3000; ++n) {
    again.step({0.0});
    again_slow.step({0.0});
    if (n % 37 == 0) {
      REQUIRE(again.kernel().save(0, x.data(), v.data()));
      REQUIRE(again_slow.kernel().save(0, found_x.data(), found_v.data()));
      for (std::uint32_t node = 0; node < program.moving; ++node) {
        CHECK(std::fabs(found_x[node] - x[node]) < 1e-4 * 0.01);
        CHECK(std::fabs(found_v[node] - v[node]) < 3e-3 * 1e-5);
      }
    }
  }
}

TEST_CASE("only a budget makes a part slow", "[slow]") {
  const std::string text =
      scenes::physical_lfo() + scenes::string("s", 20, "0.1", "0.001") + scenes::output(2, "s_m9");
  const auto methods_for = [&](const Budget& budget) {
    const Machine machine =
        make_machine(support::network_of(text), Network::reference_rate_hz, true);
    std::vector<Method> methods;
    for (const Part& part : make_plan(machine, {}, {}, patient_modes, budget).parts) {
      methods.push_back(part.method);
    }
    return methods;
  };
  const auto count = [](const std::vector<Method>& methods) {
    return std::count(methods.begin(), methods.end(), Method::slow);
  };
  CHECK(count(methods_for({})) == 0);
  CHECK(count(methods_for({.silence_db = -60.0})) == 0);  // what comes in would act later
  CHECK(count(methods_for({.cents = 1.0})) == 1);

  Preset preset = support::struck(2);
  preset.transpose = -72;  // where both can play the keys
  support::Player plain(text, preset, {.method = Method::direct});
  support::Player slow(text, preset, {.method = Method::slow});
  Comparison lfo_output;
  Comparison string_output;
  const std::vector<Event> events = {support::note_on(100, 60), support::note_on(30'000, 64)};
  plain.run(132'300, events, {256, 37});
  slow.run(132'300, events, {256, 37});
  for (std::size_t n = 0; n < 132'300; ++n) {
    lfo_output.add(plain.out[0][n], slow.out[0][n]);
    string_output.add(plain.out[1][n], slow.out[1][n]);
  }
  INFO(describe(slow.compiled.plan) << lfo_output.snr_db() << " dB");
  CHECK(lfo_output.peak > 0.0);
  CHECK(lfo_output.snr_db() > 30.0);  // up to 128 samples late
  CHECK(slow.heap_calls == 0);
}

}  // namespace ressort::slow_test
