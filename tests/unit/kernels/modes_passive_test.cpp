// Passive links on modes: the same motion as on masses, and no energy gain.
#include "tests/support/heap.h"
#include "tests/support/modes.h"
#include "tests/support/thorough.h"

namespace ressort::modes_passive_test {
namespace {

using support::check_same;
using support::ComparisonOptions;
using support::in_modes;
using support::isas;
using support::KernelRunner;
using support::show;

constexpr double pi = std::numbers::pi;

// Fingers that touch a mesh, leave it and return, and a soft pick.
std::string touched_mesh() {
  return scenes::square_mesh("m", 8, 9, "0.1", "0.001") +
         "@in1 posInput 0.02\n@in2 posInput 0.05\n@in3 posInput 0.08\n"
         "@t1 contact @m_m2_3 @in1 0.05 0.01 0.\n@t2 contact @m_m5_5 @in2 0.05 0.01 0.\n"
         "@pick nlPluck @in3 @m_m4_4 0.02 0.05\n@in4 frcInput @m_m6_2\n" +
         scenes::output(1, "m_m3_3") + scenes::output(2, "m_m7_1") + scenes::output(3, "m_m2_3");
}

TEST_CASE("Passive links act on modes as on masses", "[modes_passive]") {
  const Program program = in_modes(touched_mesh(), Passivity::always);
  REQUIRE(!is_plain(program));
  for (const bool turns : {false, true}) {
    for (const double reach : {0.02, 0.06, 0.2}) {
      for (const Isa isa : isas()) {
        check_same<double>(
            program,
            {.frames = 8820, .reach = reach, .highest_hz = 30.0, .turns = turns, .isa = isa}, 1e-9);
      }
    }
  }
}

TEST_CASE("A passive link alone acts on modes as on masses", "[modes_passive]") {
  // The other end is a moving input. Two fingers touch in turn.
  for (const std::string links : {
           "@in1 posInput 0.\n@b nlBow @in1 @s_m15 0.02 0.01\n",
           "@in1 posInput 0.\n@p nlPluck @in1 @s_m15 0.02 0.05\n",
           "@in1 posInput 0.\n@p nlPluck @in1 @s_m15 0.02 0.05\n"
           "@in2 posInput 0.1\n@t contact @s_m4 @in2 0.1 0.01 0.\n",
       }) {
    CAPTURE(links);
    const Program program =
        in_modes(scenes::string("s", 30, "0.1", "0.005") + links + scenes::output(1, "s_m4") +
                     scenes::output(2, "s_m17") + scenes::output(3, "s_m29"),
                 Passivity::always);
    REQUIRE(!is_plain(program));
    for (const Isa isa : isas()) {
      check_same<double>(program, {.frames = 8820, .highest_hz = 30.0, .isa = isa}, 1e-9);
    }
  }
}

// Fingers of two places each on a mesh, as pure dampers or with the given stiffness, in contact for
// most of the time.
std::string held_mesh(double k, double z) {
  std::string text = scenes::square_mesh("m", 8, 9, "0.1", "0.001") +
                     "@in1 posInput -0.01\n@in2 posInput -0.02\n@in3 frcInput @m_m6_2\n";
  for (const int i : {1, 2, 4, 5}) {
    text += "@t" + std::to_string(i) + " contact @m_m2_" + std::to_string(i) +
            (i < 3 ? " @in1 " : " @in2 ") + show(k) + " " + show(z) + " 0.\n";
  }
  return text + "@pick nlPluck @in2 @m_m5_5 0.02 0.001\n" + scenes::output(1, "m_m3_3") +
         scenes::output(2, "m_m7_1");
}

TEST_CASE("Contacts that stay closed act on modes as on masses", "[modes_passive]") {
  for (const auto& [k, z] : {std::pair{0.0, 0.01}, std::pair{0.05, 0.0}, std::pair{3.0, 0.5}}) {
    CAPTURE(k, z);
    const Program program = in_modes(held_mesh(k, z), Passivity::always);
    for (const bool turns : {false, true}) {
      for (const Isa isa : isas()) {
        check_same<double>(
            program,
            {.frames = 4410, .reach = 0.02, .highest_hz = 30.0, .turns = turns, .isa = isa}, 1e-9);
      }
    }
  }
}

// A string with links of each law, some on one mass, some between two masses.
std::string busy_string() {
  return scenes::string("s", 30, "0.1", "0.005") +
         "@in1 posInput 0.\n@in2 posInput 0.1\n@in3 frcInput @s_m9\n@floor ground -0.05\n"
         "@c1 contact @floor @s_m4 0.3 0.02 0.\n@c2 contact @s_m4 @in2 0.3 0.02 0.\n"
         "@n nlSpring3 @s_m7 @s_m20 0.02 0.5 0.001\n@m nlSpring2 @s_m12 @floor 0.02 0.1 0.001\n"
         "@b nlBow @in1 @s_m15 0.02 0.01\n@p nlPluck @in1 @s_m23 0.02 0.05\n" +
         scenes::output(1, "s_m4") + scenes::output(2, "s_m17") + scenes::output(3, "s_m29");
}

TEST_CASE("Passive links of all laws act on one body", "[modes_passive]") {
  const Program program = in_modes(busy_string(), Passivity::always);
  for (const bool turns : {false, true}) {
    for (const std::uint64_t seed : {1u, 2u, 3u}) {
      check_same<double>(program, {.frames = 8820, .seed = seed, .push = 0.05, .turns = turns},
                         1e-9);
    }
  }
}

// A lossless string of equal masses that hits hard contacts, with a stiffening spring.
struct Lossless {
  static constexpr int count = 12;
  static constexpr double k = 0.1;
  static constexpr double hard = 2.0;
  static constexpr double cubic = 20.0;
  static constexpr double floor = -0.1;
  std::string text() const {
    std::string text = "@l ground 0.\n@r ground 0.\n@floor ground " + show(floor) + "\n";
    for (int i = 0; i < count; ++i) {
      const double x = 0.3 * std::sin(1.7 * i);
      text += scenes::at("m", i) + " mass 1. " + show(x) + " " + show(x) + "\n";
    }
    for (int i = 0; i <= count; ++i) {
      text += scenes::at("s", i) + " spring " + (i == 0 ? "@l" : scenes::at("m", i - 1)) + " " +
              (i == count ? "@r" : scenes::at("m", i)) + " " + show(k) + "\n";
    }
    text += "@c1 contact @floor @m2 " + show(hard) + " 0. 0.\n@c2 contact @floor @m7 " +
            show(hard) + " 0. 0.\n@n nlSpring3 @m4 @m9 0. " + show(cubic) + " 0.\n";
    for (int i = 0; i < count; ++i) {
      text += scenes::output(i + 1, "m" + std::to_string(i));
    }
    return text;
  }
  // Returns the potential of the nonlinear links.
  static double potential(const std::vector<double>& x) {
    double sum = 0.25 * cubic * std::pow(x[4] - x[9], 4);
    for (const std::size_t i : {2u, 7u}) {
      const double depth = std::max(0.0, floor - x[i]);
      sum += 0.5 * hard * depth * depth;
    }
    return sum;
  }
  // Returns the energy of the modes, whose shapes are sines: 1/2 d^2 / gain + 1/2 K q q+ each,
  // where the scheme has lK = gain K. Exact modes have lK = 2 - 2 cos sqrt(K).
  static double energy(const std::vector<double>& now, const std::vector<double>& next,
                       bool is_exact) {
    double sum = 0.5 * (potential(now) + potential(next));
    for (int j = 1; j <= count; ++j) {
      double q = 0.0;
      double after = 0.0;
      for (int i = 0; i < count; ++i) {
        const double shape =
            std::sqrt(2.0 / (count + 1)) * std::sin(pi * j * (i + 1) / (count + 1));
        q += shape * now[static_cast<std::size_t>(i)];
        after += shape * next[static_cast<std::size_t>(i)];
      }
      const double half = std::sin(0.5 * pi * j / (count + 1));
      const double stiffness = 4.0 * half * half * k;
      const double gain = is_exact ? (2.0 - 2.0 * std::cos(std::sqrt(stiffness))) / stiffness : 1.0;
      sum += 0.5 * (after - q) * (after - q) / gain + 0.5 * stiffness * q * after;
    }
    return sum;
  }
};

TEST_CASE("Hard contacts on modes gain no energy in a million samples", "[modes_passive]") {
  const auto samples = support::of_all<std::size_t>(200'000, 1'000'000);
  for (const Budget& budget : {Budget{}, Budget{.cents = 1e-6}}) {
    const Program program = in_modes(Lossless().text(), Passivity::always, budget);
    const bool is_exact = program.form.get<Modes>().is_exact;
    KernelRunner<double> fighter(program, 1.0, best_isa());
    const std::vector<std::vector<double>> nobody(64);
    std::vector<double> last;
    double first_energy = 0.0;
    double most = 0.0;
    double least = 1e300;
    std::size_t touches = 0;
    for (std::size_t at = 0; at < samples; at += 64) {
      const std::vector<double> heard = fighter.play(nobody);
      for (std::size_t n = 0; n < 64; ++n) {
        const auto begin = heard.begin() + std::ptrdiff_t(n * Lossless::count);
        const std::vector<double> x(begin, begin + Lossless::count);
        if (!last.empty() && at + n > 1) {
          const double energy = Lossless::energy(last, x, is_exact);
          first_energy = first_energy == 0.0 ? energy : first_energy;
          most = std::max(most, energy);
          least = std::min(least, energy);
          touches += x[2] < Lossless::floor && last[2] >= Lossless::floor;
        }
        last = x;
      }
    }
    INFO((is_exact ? "exact: " : "published: ")
         << touches << " touches, energy " << show(first_energy) << ", from "
         << show(least / first_energy - 1.0) << " to " << show(most / first_energy - 1.0));
    CHECK(touches > samples / 1000);
    CHECK(most / first_energy - 1.0 < 1e-10);
    CHECK(least / first_energy - 1.0 > -1e-10);
  }
}

TEST_CASE("Contacts on modes equal those on masses for 5 ms", "[modes_passive]") {
  check_same<double>(in_modes(Lossless().text(), Passivity::always), {.frames = 220}, 1e-11);
}

TEST_CASE("Modes sleep while no passive link touches, and wake when one does", "[modes_passive]") {
  const std::string text = scenes::square_mesh("m", 8, 9, "0.1", "0.02") +
                           "@in1 posInput 1.\n@t1 contact @m_m2_3 @in1 0.5 0.01 0.\n"
                           "@in2 frcInput @m_m6_2\n" +
                           scenes::output(1, "m_m3_3") + scenes::output(2, "m_m7_1");
  const Program sleepy = in_modes(text, Passivity::always, {.silence_db = -60.0});
  Program awake = sleepy;
  Modes all_awake = awake.form.get<Modes>();
  all_awake.silence = 0.0;
  awake.form = std::move(all_awake);
  KernelRunner<double> one(sleepy, 1.0, best_isa());
  KernelRunner<double> other(awake, 1.0, best_isa());
  double worst = 0.0;
  double peak = 0.0;
  double modes = 0.0;
  constexpr std::size_t frames = 40'000;
  for (std::size_t at = 0; at < frames; at += 25) {
    std::vector<std::vector<double>> inputs;
    for (std::size_t n = at; n < at + 25; ++n) {
      const double t = static_cast<double>(n % 10'000);
      inputs.push_back({t < 500.0 ? 0.5 + 0.7 * std::cos(0.0125 * t) : 1.0, n == 3 ? 1.0 : 0.0});
    }
    const std::vector<double> found = one.play(inputs);
    const std::vector<double> wanted = other.play(inputs);
    for (std::size_t i = 0; i < found.size(); ++i) {
      worst = std::max(worst, std::fabs(found[i] - wanted[i]));
      peak = std::max(peak, std::fabs(wanted[i]));
    }
    modes += 25.0 * static_cast<double>(one.kernel().awake().modes) / frames;
  }
  const auto of = static_cast<double>(one.kernel().awake().of);
  INFO(modes << " of " << of << ", off by " << show(worst) << " of " << show(peak));
  CHECK(modes < 0.5 * of);
  CHECK(worst > 0.0);
  CHECK(worst < 1e-3 * peak);
}

TEST_CASE("Passive links on modes allocate no memory", "[modes_passive]") {
  Program program = in_modes(busy_string(), Passivity::always);
  support::Bare<double> bare(program);
  std::vector<double> value(64 * program.inputs.size());
  std::vector<double> velocity(value.size());
  std::vector<double> outputs(64 * program.outputs.size());
  std::size_t calls = 0;
  bool has_touched = false;
  for (int block = 0; block < 200; ++block) {
    for (std::size_t i = 0; i < value.size(); ++i) {
      const double t = 64.0 * block + static_cast<double>(i / program.inputs.size());
      velocity[i] = 1e-3 * std::cos(2e-3 * t);
      value[i] = 0.5 * std::sin(2e-3 * t);
    }
    const support::HeapWatch heap;
    bare.kernel().step({.frames = 64,
                        .value = value.data(),
                        .velocity = velocity.data(),
                        .outputs = outputs.data()});
    calls += heap.calls();
    has_touched = has_touched || outputs[0] != 0.0;
  }
  CHECK(has_touched);
  CHECK(calls == 0);
}

TEST_CASE("Networks with too many passive links have no modal form", "[modes_passive]") {
  const auto held = [](int count) {
    std::string text = scenes::string("s", 40, "0.1", "0.01") + "@floor ground -0.1\n";
    for (int i = 0; i < count; ++i) {
      text += scenes::at("c", i) + " contact @floor " + scenes::at("s_m", i) + " 0.3 0. 0.\n";
    }
    return support::program_of(text + scenes::output(1, "s_m4"), Passivity::always);
  };
  CHECK(modal_form(held(32)).has_value());
  CHECK_FALSE(modal_form(held(33)).has_value());
}

TEST_CASE("The compliance of omitted modes acts on passive links, too", "[modes_passive]") {
  // A finger lies hard on a row of masses that only air damping holds, so each mode contributes to
  // its rest position. The reaction force is measured by the displacement of the mass, relative to
  // the displacement by a small force.
  std::string text = "@in1 posInput 0.\n@in2 frcInput @m17\n";
  for (int i = 0; i < 40; ++i) {
    text += scenes::at("m", i) + " osc 1. 0.2 0.01 0. 0.\n";
    if (i > 0) {
      text += scenes::at("s", i) + " springDamper " + scenes::at("m", i - 1) + " " +
              scenes::at("m", i) + " 0.1 0.005\n";
    }
  }
  text += "@c contact @m17 @in1 5. 0.01 0.\n" + scenes::output(1, "m17");
  const auto pressed = [&](double silence_db, bool gives) {
    Program program = in_modes(text, Passivity::always, {.silence_db = silence_db});
    Modes modes = program.form.get<Modes>();
    modes.silence = 0.0;
    for (ModalHold& hold : modes.holds) {
      for (double& give : hold.give) {
        give = gives ? give : 0.0;
      }
    }
    program.form = modes;
    const auto rest = [&](double finger, double force) {
      KernelRunner<double> fighter(program, 1.0, best_isa());
      std::vector<double> heard;
      for (std::size_t at = 0; at < 20'000; at += 50) {
        const double done = std::min(1.0, static_cast<double>(at) / 10'000.0);
        heard = fighter.play(std::vector<std::vector<double>>(50, {done * finger, force}));
      }
      return heard.back();
    };
    return std::pair{rest(-0.2, 0.0) / rest(1.0, 0.01), modes.modes};
  };
  const auto [all, every] = pressed(-Budget::unlimited, true);
  const auto [soft, some] = pressed(-3.0, true);
  const auto [hard, same] = pressed(-3.0, false);
  INFO(some << " of " << every << " modes: " << show(all) << ", giving way " << show(soft)
            << ", not " << show(hard));
  CHECK(some < every);
  CHECK(std::fabs(soft / all - 1.0) < 1e-9);
  CHECK(std::fabs(hard / all - 1.0) > 1e-3);
}

}  // namespace
}  // namespace ressort::modes_passive_test
