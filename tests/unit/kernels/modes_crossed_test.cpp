// Modes of bodies with non-proportional damping.
#include <complex>

#include "tests/support/modes.h"

namespace ressort::modes_crossed_test {
namespace {

using support::check_same;
using support::ComparisonOptions;
using support::isas;
using support::Random;
using support::show;

constexpr Budget physical{.cents = 1e-6};
constexpr double pi = std::numbers::pi;

std::optional<Modes> crossed_form(const Program& program, const Budget& budget = {}) {
  return modal_form(program, budget, {}, true);
}

Program in_crossed_modes(const std::string& text, Passivity passive = Passivity::never,
                         const Budget& budget = {}) {
  return support::in_modes(text, passive, budget, true);
}

// Returns a triangle that is linked to the ground. The ratio of damping to stiffness of that link
// differs from the ratio of the sides.
std::string triangle() {
  return "@g ground 0.\n@a mass 1. 0. -0.01\n@b mass 1. 0. 0.\n@c mass 1. 0. 0.\n"
         "@h springDamper @g @a 0.05 0.01\n@i springDamper @a @b 0.1 0.001\n"
         "@j springDamper @b @c 0.1 0.001\n@k springDamper @c @a 0.1 0.001\n"
         "@in1 frcInput @a\n@out1 posOutput @b\n@out2 posOutput @a\n";
}

TEST_CASE("The poles of a triangle equal the known poles", "[modes_crossed]") {
  struct Pole {
    double hz, t60_s;
  };
  const auto check = [](const Budget& budget, const std::vector<Pole>& known) {
    const Program program = in_crossed_modes(triangle(), Passivity::never, budget);
    const Modes& modes = program.form.get<Modes>();
    REQUIRE(modes.modes == known.size());
    for (const auto& [hz, t60_s] : known) {
      double nearest_hz = 1e9;
      double nearest_s = 1e9;
      for (std::size_t i = 0; i < modes.modes; ++i) {
        const std::complex<double> s =
            std::log(std::complex<double>(1.0 + modes.pole[i], modes.pole[modes.modes + i]));
        nearest_hz = std::min(nearest_hz, std::fabs(44100.0 * s.imag() / (2.0 * pi) / hz - 1.0));
        const double found_s = -3.0 * std::log(10.0) / s.real() / 44100.0;
        nearest_s = std::min(nearest_s, std::fabs(found_s / t60_s - 1.0));
      }
      CHECK(nearest_hz < 1e-9);
      CHECK(nearest_s < 1e-9);
    }
  };
  check({}, {{858.455895090791, 0.11704167662148},
             {3897.059050705478, 0.10426891092156},
             {4132.595984001824, 0.030127177179114}});
  check(physical, {{857.3469979368184, 0.11716233357043},
                   {3844.30396770083, 0.10442562780018},
                   {4062.585604505056, 0.030338267322174}});
}

// Returns a body of random masses, springs and dampers. A quarter of the masses are oscillators,
// and a third of the links have no damping.
std::string random_body(std::uint64_t seed, std::size_t most_masses) {
  Random random(seed);
  const std::size_t count = 2 + random.below(most_masses - 1);
  const auto number = [&](double low, double high) { return show(random.uniform(low, high)); };
  std::string text = "@g ground " + number(-0.1, 0.1) + "\n@in1 posInput 0.\n";
  std::size_t links = 0;
  const auto link = [&](const std::string& a, const std::string& b) {
    const double z = random.below(3) == 0 ? 0.0 : random.uniform(0.0, 0.03);
    text += scenes::at("l", int(links++)) + " springDamper " + a + " " + b + " " +
            number(0.02, 0.15) + " " + show(z) + "\n";
  };
  const auto mass = [](std::size_t i) { return scenes::at("m", int(i)); };
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_osc = random.below(4) == 0;
    const std::string start = number(-0.1, 0.1);
    text += mass(i) + (is_osc ? " osc " : " mass ") + number(0.7, 3.0) + " " +
            (is_osc ? number(0.01, 0.1) + " " + number(0.0, 0.01) + " " : "") + start + " " +
            start + "\n";
    link(i == 0 ? "@g" : mass(random.below(i)), mass(i));
    if (random.below(2) == 0) {
      link(mass(random.below(i + 1)), mass(random.below(i + 1)));
    }
  }
  link("@in1", mass(random.below(count)));
  text += "@in2 frcInput " + mass(random.below(count)) + "\n";
  text += scenes::output(1, "m" + std::to_string(random.below(count)));
  return text + scenes::output(2, "m" + std::to_string(random.below(count)));
}

TEST_CASE("Crossed modes of random bodies equal the direct form", "[modes_crossed]") {
  std::size_t found = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const std::string text = random_body(seed, seed % 10 == 0 ? 60 : 12);
    const Program plain = support::program_of(text);
    std::optional<Modes> modes = crossed_form(plain);
    if (!modes || !modes->is_crossed) {
      continue;
    }
    ++found;
    Program program = plain;
    program.form = std::move(*modes);
    INFO("seed " << seed << ", " << plain.moving << " masses");
    check_same<double>(program, {.frames = 8820, .seed = seed}, 1e-9);
    if (seed % 5 == 0) {
      check_same<float>(program, {.frames = 8820, .seed = seed}, 1e-3);
      for (const Isa isa : isas()) {
        check_same<double>(program, {.frames = 2000, .seed = seed, .isa = isa}, 1e-10);
      }
    }
  }
  INFO(found << " of 60");
  CHECK(found >= 55);
}

TEST_CASE("Crossed modes start from any state and from the initial state", "[modes_crossed]") {
  const Program program = in_crossed_modes(random_body(4, 12));
  Program plain = program;
  plain.form = Form();
  support::Bare<double> one(program);
  support::Bare<double> other(plain);
  Random random(9);
  for (int round = 0; round < 5; ++round) {
    std::vector<double> x = program.position;
    std::vector<double> v = program.velocity;
    for (std::size_t i = 0; round > 0 && i < program.moving; ++i) {
      x[i] = random.uniform(-1.0, 1.0);
      v[i] = random.uniform(-0.1, 0.1);
    }
    one.kernel().set_state(0, x.data(), v.data());
    other.kernel().set_state(0, x.data(), v.data());
    for (int n = 0; n < 1000; ++n) {
      const auto found = one.step({0.0, 0.0});
      const auto wanted = other.step({0.0, 0.0});
      CHECK(std::fabs(found[0] - wanted[0]) < 1e-11);
      CHECK(std::fabs(found[1] - wanted[1]) < 1e-11);
    }
  }
}

// --- the continuous network ---------------------------------------------------------------------

using Square = std::vector<std::vector<double>>;

Square times(const Square& a, const Square& b) {
  const std::size_t n = a.size();
  Square c(n, std::vector<double>(n, 0.0));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < n; ++k) {
      for (std::size_t j = 0; j < n; ++j) {
        c[i][j] += a[i][k] * b[k][j];
      }
    }
  }
  return c;
}

// Computes e^a from the series for a/1024, squared ten times.
Square exponential_of(Square a) {
  const std::size_t n = a.size();
  for (auto& row : a) {
    for (double& value : row) {
      value /= 1024.0;
    }
  }
  Square sum(n, std::vector<double>(n, 0.0));
  // The identity is added at the end, because the sum with it would lose small digits.
  Square term = a;
  for (int k = 2; k < 14; ++k) {
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        sum[i][j] += term[i][j];
      }
    }
    term = times(term, a);
    for (auto& row : term) {
      for (double& value : row) {
        value /= k;
      }
    }
  }
  for (int i = 0; i < 10; ++i) {
    const Square square = times(sum, sum);
    for (std::size_t r = 0; r < n; ++r) {
      for (std::size_t c = 0; c < n; ++c) {
        sum[r][c] = 2.0 * sum[r][c] + square[r][c];
      }
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    sum[i][i] += 1.0;
  }
  return sum;
}

// A chain of masses with the state (x, x', f) and x'' = (f - K x - Z x')/M. The force f on the
// first mass is constant.
struct Chain {
  // The first link goes to the ground, each other link to the mass before.
  std::vector<double> mass, stiffness, damping;
  std::size_t count() const { return mass.size(); }
  std::string text() const {
    std::string text = "@g ground 0.\n";
    for (std::size_t i = 0; i < count(); ++i) {
      text += scenes::at("m", int(i)) + " mass " + show(mass[i]) + " 0. 0.\n" +
              scenes::at("s", int(i)) + " springDamper " +
              (i == 0 ? std::string("@g") : scenes::at("m", int(i) - 1)) + " " +
              scenes::at("m", int(i)) + " " + show(stiffness[i]) + " " + show(damping[i]) + "\n";
    }
    return text + "@in1 frcInput @m0\n" + scenes::output(1, "m" + std::to_string(count() - 1)) +
           scenes::output(2, "m0");
  }
  Square flow() const {
    const std::size_t n = count();
    Square a(2 * n + 1, std::vector<double>(2 * n + 1, 0.0));
    for (std::size_t i = 0; i < n; ++i) {
      a[i][n + i] = 1.0;
    }
    for (std::size_t l = 0; l < n; ++l) {
      for (const std::size_t i : {l, l - 1}) {
        for (const std::size_t j : {l, l - 1}) {
          if (i < n && j < n) {
            a[n + i][j] -= (i == j ? stiffness[l] : -stiffness[l]) / mass[i];
            a[n + i][n + j] -= (i == j ? damping[l] : -damping[l]) / mass[i];
          }
        }
      }
    }
    a[n][2 * n] = 1.0 / mass[0];
    return a;
  }
};

TEST_CASE("Exact crossed modes equal the matrix exponential of the network", "[modes_crossed]") {
  Random random(17);
  for (int round = 0; round < 20; ++round) {
    Chain chain;
    const std::size_t n = 2 + random.below(5);
    for (std::size_t i = 0; i < n; ++i) {
      // Returns a number that is rounded to the digits of the text.
      const auto number = [&](double low, double high) {
        return std::stod(show(random.uniform(low, high)));
      };
      chain.mass.push_back(number(0.7, 3.0));
      chain.stiffness.push_back(number(0.02, 1.0));
      chain.damping.push_back(random.below(2) == 0 ? 0.0 : number(0.0, 0.3));
    }
    chain.damping[0] = 0.02;
    const Program program = in_crossed_modes(chain.text(), Passivity::never, physical);
    REQUIRE(program.form.get<Modes>().is_exact);
    support::Bare<double> bare(program);
    const Square step = exponential_of(chain.flow());
    std::vector<double> state(2 * n + 1, 0.0);
    double worst = 0.0;
    double peak = 0.0;
    // The force is constant within each sample. 8820 samples are 0.2 s.
    for (int t = 0; t < 8820; ++t) {
      state[2 * n] = std::sin(0.001 * t * (1.0 + 0.001 * t)) + (t == 100 ? 5.0 : 0.0);
      std::vector<double> next(2 * n + 1, 0.0);
      for (std::size_t i = 0; i < 2 * n; ++i) {
        for (std::size_t j = 0; j <= 2 * n; ++j) {
          next[i] += step[i][j] * state[j];
        }
      }
      const auto heard = bare.step({state[2 * n]});
      state = next;
      worst = std::max({worst, std::fabs(heard[0] - state[n - 1]), std::fabs(heard[1] - state[0])});
      peak = std::max(peak, std::fabs(state[0]));
    }
    INFO("round " << round << ", " << n << " masses: off by " << show(worst / peak));
    CHECK(worst < 1e-11 * peak);
  }
}

TEST_CASE("Passive links act on crossed modes as on masses", "[modes_crossed]") {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    std::string text = random_body(seed, 9) + "@in3 posInput 0.3\n";
    text += "@c contact @m0 @in3 0.5 0.02 0.\n@n nlSpring3 @m1 @m0 0.01 2. 0.001\n";
    const bool is_bowed = seed % 3 == 0;
    text += is_bowed ? "@b nlBow @in1 @m1 0.02 0.01\n" : "@p nlPluck @in1 @m1 0.02 0.05\n";
    const Program program = in_crossed_modes(text, Passivity::always);
    INFO(text);
    // The solver iterates until rounding is the only energy gain. This condition is weaker for a
    // weak bow than for other links.
    check_same<double>(program, {.frames = 8820, .seed = seed}, is_bowed ? 1e-6 : 1e-9);
  }
}

TEST_CASE("Force outputs of crossed modes equal the direct form", "[modes_crossed]") {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    std::string text = random_body(seed, 9);
    text += "@out3 frcOutput @m0\n@out4 frcOutput @g\n@out5 frcOutput @in1\n";
    check_same<double>(in_crossed_modes(text), {.frames = 8820, .seed = seed}, 1e-9);
    text += "@in3 posInput 0.3\n@c contact @m0 @in3 0.5 0.02 0.\n";
    check_same<double>(in_crossed_modes(text, Passivity::always), {.frames = 8820, .seed = seed},
                       1e-9);
  }
}

TEST_CASE("Symmetric, overdamped and creeping networks have crossed modes", "[modes_crossed]") {
  const std::string hands = "@in1 frcInput @m_m1_1\n" + scenes::output(1, "m_m2_3");
  const std::vector<std::string> bodies = {
      // A symmetric mesh: many modes have the same pole.
      scenes::square_mesh("m", 5, 5, "0.1", "0.001") +
          "@g ground 0.\n@c1 springDamper @g @m_m1_1 0. 0.05\n@c2 springDamper @g @m_m3_3 0. 0.05\n"
          "@c3 springDamper @g @m_m1_3 0. 0.05\n@c4 springDamper @g @m_m3_1 0. 0.05\n" +
          hands,
      // An overdamped chain: its poles are real, some of them negative.
      "@g ground 0.\n@a mass 1. 0.1 0.1\n@b mass 1.3 0. 0.\n@c mass 0.9 -0.2 -0.2\n"
      "@h springDamper @g @a 0.3 1.1\n@i springDamper @a @b 0.2 0.01\n"
      "@j springDamper @b @c 0.05 0.6\n@in1 frcInput @a\n@out1 posOutput @b\n",
      // No spring holds the network: it creeps until its force ends.
      "@g ground 0.\n@a mass 1. 0.1 0.1\n@b mass 1.3 0. 0.\n@c mass 0.9 -0.2 -0.2\n"
      "@h springDamper @g @a 0. 0.02\n@i springDamper @a @b 0.2 0.01\n"
      "@j springDamper @b @c 0.05 0.\n@in1 frcInput @a\n@out1 posOutput @b\n"};
  for (std::string text : bodies) {
    // The published mesh has parameters; here they are replaced by numbers.
    for (const auto& [name, number] :
         {std::pair<std::string, std::string>{"m_M", "1."}, {"m_K", "0.1"}, {"m_Z", "0.001"}}) {
      const std::string line = "@" + name + " param";
      if (const std::size_t at = text.find(line); at != std::string::npos) {
        text.erase(at, text.find('\n', at) - at + 1);
      }
      for (std::size_t at = 0; (at = text.find(" " + name, at)) != std::string::npos;) {
        text.replace(at + 1, name.size(), number);
      }
    }
    INFO(text);
    check_same<double>(in_crossed_modes(text), {.frames = 8820}, 1e-9);
  }
}

TEST_CASE("Hard contacts on crossed modes gain no energy", "[modes_crossed]") {
  // The energy is 1/2 d (M - Z/2) d + 1/2 x K x+ plus the mean potential of the contacts. None of a
  // hundred thousand samples increases it.
  const std::vector<double> mass = {1.0, 2.5, 0.8, 1.7};
  const std::vector<double> k = {0.3, 0.25, 0.1, 0.4};
  const std::vector<double> z = {2e-5, 0.0, 1e-5, 0.0};
  constexpr double hard = 5.0;
  constexpr double floor = -0.05;
  std::string text = "@g ground 0.\n@floor ground " + show(floor) + "\n";
  for (std::size_t i = 0; i < mass.size(); ++i) {
    const std::string x = show(0.3 * std::cos(2.0 * double(i)));
    const std::string at = "@m" + std::to_string(i);
    text += at + " mass " + show(mass[i]) + " " + x + " " + x + "\n@s" + std::to_string(i) +
            " springDamper " + (i == 0 ? std::string("@g") : "@m" + std::to_string(i - 1)) + " " +
            at + " " + show(k[i]) + " " + show(z[i]) + "\n" + "@c" + std::to_string(i) +
            " contact @floor " + at + " " + show(hard) + " 0. 0.\n" +
            scenes::output(int(i) + 1, at.substr(1));
  }
  support::Bare<double> bare(in_crossed_modes(text, Passivity::always));
  const auto energy = [&](const std::vector<double>& now, const std::vector<double>& next) {
    double sum = 0.0;
    for (std::size_t i = 0; i < mass.size(); ++i) {
      const double stretch = now[i] - (i == 0 ? 0.0 : now[i - 1]);
      const double after = next[i] - (i == 0 ? 0.0 : next[i - 1]);
      sum += 0.5 * mass[i] * (next[i] - now[i]) * (next[i] - now[i]);
      sum += 0.5 * k[i] * stretch * after - 0.25 * z[i] * (after - stretch) * (after - stretch);
      for (const double x : {now[i], next[i]}) {
        const double depth = std::max(0.0, floor - x);
        sum += 0.25 * hard * depth * depth;
      }
    }
    return sum;
  };
  std::vector<double> now = bare.step({});
  std::vector<double> next = bare.step({});
  double last = energy(now, next);
  const double first = last;
  double steepest = 0.0;
  for (int n = 0; n < 100'000; ++n) {
    now = std::exchange(next, bare.step({}));
    const double after = energy(now, next);
    steepest = std::max(steepest, after - last);
    last = after;
  }
  INFO("from " << show(first) << " to " << show(last) << ", up by " << show(steepest));
  CHECK(steepest < 1e-12 * first);
  CHECK(last < 0.9 * first);
}

TEST_CASE("Passive links require exact crossed modes that gain no energy", "[modes_crossed]") {
  const auto held = [](const std::string& damping) {
    const Program program = support::program_of(
        "@g ground 0.\n@a mass 1. 0.1 0.1\n@b mass 1.3 0. 0.\n@floor ground -0.02\n"
        "@h springDamper @g @a 0.3 0.01\n@i springDamper @a @b 0.2 " +
            damping + "\n@in1 frcInput @a\n@out1 posOutput @b\n@c contact @floor @b 3. 0. 0.\n",
        Passivity::always);
    return crossed_form(program, physical).has_value();
  };
  CHECK(held("0.02"));
  CHECK_FALSE(held("0."));
}

TEST_CASE("Crossed modes require constant coefficients and an equilibrium", "[modes_crossed]") {
  const auto has = [](const std::string& text, bool is_untuned = true) {
    return modal_form(support::program_of(text), {}, {}, is_untuned).has_value();
  };
  CHECK(has(triangle()));
  CHECK_FALSE(has(triangle(), false));  // a key changes the coefficients
  // A parameter changes a stiffness.
  CHECK_FALSE(has("@K param 0.3\n" + triangle() + "@x spring @g @b K\n"));
  CHECK(has("@K param 0.3\n" + triangle() + "@x contact @g @b K 0.\n"));
  // Masses without a ground drift away and have no equilibrium.
  CHECK_FALSE(
      has("@a mass 1. 0. 0.\n@b mass 2. 0. 0.\n@c mass 1. 0. 0.\n"
          "@i springDamper @a @b 0.1 0.001\n@j spring @b @c 0.1\n"
          "@in1 frcInput @a\n@out1 posOutput @b\n"));
}

}  // namespace
}  // namespace ressort::modes_crossed_test
