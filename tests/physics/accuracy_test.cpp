// Budgets of pitch and decay are kept, or reported as not kept, on random networks. The test
// measures the engine's poles: impulses at one mass after another, observed at all masses, give the
// matrix of one time step, whose eigenvalues are the poles. They are compared with the poles of M
// s^2 + Z s + K, with the matrices that the model's text was written from.
#include <complex>
#include <cstdio>
#include <functional>
#include <numeric>

#include "tests/support/dense.h"
#include "tests/support/player.h"

namespace ressort::accuracy_test {
namespace {

using support::Player;
using support::Random;
using support::show;
using Poles = std::vector<std::complex<double>>;

constexpr double rate_hz = Network::reference_rate_hz;

// A network with an input and an output for every mass, and its matrices.
struct Scene {
  std::string text;
  Eigen::VectorXd mass;
  Eigen::MatrixXd stiffness;
  Eigen::MatrixXd damping;
  bool is_proportional = true;
  bool has_places = false;
  bool is_nonlinear = false;
};

class SceneWriter {
 public:
  explicit SceneWriter(std::uint64_t seed) : seed_(seed), random_(seed) {}

  Scene write() {
    scene_.is_proportional = seed_ % 2 == 0;
    scene_.has_places = seed_ / 2 % 2 == 0;
    scene_.is_nonlinear = seed_ % 3 == 0;
    top_ = random_.uniform(0.02, 0.9);
    ratio_ = std::exp(random_.uniform(std::log(1e-4), std::log(0.3)));
    add("@g ground 0.");
    scene_.has_places ? write_macro() : write_masses();
    for (std::size_t i = 0; i < ends_.size(); ++i) {
      const std::string number = std::to_string(i + 1);
      add("@in" + number + " frcInput " + ends_[i]);
      add("@out" + number + " posOutput " + ends_[i]);
    }
    if (scene_.is_nonlinear) {
      write_nonlinear();
    }
    return scene_;
  }

 private:
  void add(const std::string& line) { scene_.text += line + "\n"; }
  double damper(double k) {
    return scene_.is_proportional ? ratio_ * k
           : random_.below(3) == 0
               ? 0.0
               : k * ratio_ * std::exp(random_.uniform(std::log(0.05), std::log(20.0)));
  }

  void begin(std::size_t count) {
    const auto n = static_cast<Eigen::Index>(count);
    scene_.mass = Eigen::VectorXd::Zero(n);
    scene_.stiffness = scene_.damping = Eigen::MatrixXd::Zero(n, n);
  }
  // Adds a spring between two weighted sums of masses, or on one sum.
  using Sum = std::vector<std::pair<Eigen::Index, double>>;
  void bind(Sum sum, const Sum& other, double k, double z) {
    for (const auto& [i, share] : other) {
      sum.emplace_back(i, -share);
    }
    for (const auto& [i, a] : sum) {
      for (const auto& [j, b] : sum) {
        scene_.stiffness(i, j) += a * b * k;
        scene_.damping(i, j) += a * b * z;
      }
    }
  }
  void spring(const std::string& a, const Sum& at, const std::string& b, const Sum& to, double k,
              double z) {
    add("@l" + std::to_string(links_++) + " springDamper " + a + " " + b + " " + number(k) + " " +
        number(z));
    bind(at, to, k, z);
  }
  static std::string number(double value) {
    char text[40];
    std::snprintf(text, sizeof text, "%.17g", value);
    return text;
  }

  void write_masses() {
    const std::size_t count = 2 + random_.below(17);
    begin(count);
    for (std::size_t i = 0; i < count; ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      const std::string name = "@m" + std::to_string(i);
      const double m = random_.uniform(0.5, 3.0);
      scene_.mass(at) = m;
      if (random_.below(4) == 0) {
        const double k = 0.3 * top_ * random_.uniform(0.1, 1.0);
        const double z = damper(k);
        add(name + " osc " + number(m) + " " + number(k) + " " + number(z) + " 0. 0.");
        bind({{at, 1.0}}, {}, k, z);
      } else {
        add(name + " mass " + number(m) + " 0. 0.");
      }
      ends_.push_back(name);
    }
    for (std::size_t i = 0; i < count; ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      const double k = 0.5 * top_ * random_.uniform(0.1, 1.0);
      if (i == 0) {
        spring(ends_[0], {{0, 1.0}}, "@g", {}, k, damper(k));
      } else {
        const std::size_t to = random_.below(i);
        spring(ends_[i], {{at, 1.0}}, ends_[to], {{static_cast<Eigen::Index>(to), 1.0}}, k,
               damper(k));
      }
    }
    for (std::size_t i = 0; count > 2 && i < random_.below(count); ++i) {
      const std::size_t a = random_.below(count);
      const std::size_t b = random_.below(count);
      const double k = 0.3 * top_ * random_.uniform(0.05, 1.0);
      if (a != b) {
        spring(ends_[a], {{static_cast<Eigen::Index>(a), 1.0}}, ends_[b],
               {{static_cast<Eigen::Index>(b), 1.0}}, k, damper(k));
      }
    }
  }

  // Adds a string with fixed ends and springs at places between its masses.
  void write_macro() {
    const std::size_t count = 4 + random_.below(20);
    begin(count);
    const double m = random_.uniform(0.5, 2.0);
    const double k = top_ * m;
    const double z = ratio_ * k;
    add("@s chain " + std::to_string(count) + " " + number(m) + " " + number(k) + " " + number(z) +
        " 0. 0.");
    scene_.mass.setConstant(m);
    for (std::size_t i = 0; i < count; ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      if (i + 1 < count) {
        bind({{at, 1.0}}, {{at + 1, 1.0}}, k, z);
      }
      ends_.push_back("[@s " + number(static_cast<double>(i) / static_cast<double>(count - 1)) +
                      "]");
    }
    const std::size_t held = 1 + random_.below(3);
    for (std::size_t i = 0; i < held; ++i) {
      const double u = random_.uniform(0.02, 0.98);
      const double p = u * static_cast<double>(count - 1);
      const auto below = static_cast<Eigen::Index>(p);
      const double beyond = p - static_cast<double>(below);
      const double stiff = k * random_.uniform(0.2, 1.0);
      spring("[@s " + number(u) + "]", {{below, 1.0 - beyond}, {below + 1, beyond}}, "@g", {},
             stiff, damper(stiff));
    }
    if (!scene_.is_proportional) {
      spring(ends_[0], {{0, 1.0}}, "@g", {}, 0.2 * k, 0.2 * k * ratio_ * 8.0);
    }
  }

  // Too far away to touch.
  void write_nonlinear() {
    const std::string end = ends_[random_.below(ends_.size())];
    const std::string hand = "@in" + std::to_string(ends_.size() + 1);
    add(hand + " posInput -1000.");
    add(random_.below(2) == 0 ? "@n nlPluck " + hand + " " + end + " 0.3 0.05"
                              : "@n contact " + hand + " " + end + " 0.3 0.");
  }

  std::uint64_t seed_;
  Random random_;
  Scene scene_;
  double top_ = 0.0;
  double ratio_ = 0.0;
  std::vector<std::string> ends_;
  std::size_t links_ = 0;
};

// Returns the oscillating poles s per sample of M s^2 + Z s + K.
Poles continuous_poles(const Scene& scene) {
  const Eigen::Index n = scene.mass.size();
  Eigen::MatrixXd flow = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  flow.topRightCorner(n, n).setIdentity();
  const Eigen::VectorXd w = scene.mass.cwiseInverse();
  flow.bottomLeftCorner(n, n) = -(w.asDiagonal() * scene.stiffness);
  flow.bottomRightCorner(n, n) = -(w.asDiagonal() * scene.damping);
  Poles poles;
  const Eigen::VectorXcd values = support::eigenvalues_of(flow);
  for (const std::complex<double>& s : values) {
    if (s.imag() > 1e-9) {
      poles.push_back(s);
    }
  }
  return poles;
}

// Returns the poles of the sound. The state is the positions of all masses in two successive
// samples. Impulses hit random masses; between them the network is free.
Poles sounding_poles(Player& player, Eigen::Index masses, std::uint64_t seed) {
  constexpr std::size_t gap = 11;
  constexpr std::size_t settled = 3;  // samples after an impulse
  const auto n = static_cast<std::size_t>(masses);
  const std::size_t inputs = player.compiled.instrument.inputs.size();
  const std::size_t frames = gap * 4 * n + gap;
  std::vector<std::vector<double>> in(inputs, std::vector<double>(frames, 0.0));
  Random random(seed);
  for (std::size_t blow = 0; blow < 4 * n; ++blow) {
    in[blow % n][blow * gap] = random.uniform(0.5, 1.0);
  }
  if (inputs > n) {
    in[n].assign(frames, -1000.0);
  }
  std::vector<const double*> channels;
  for (const auto& channel : in) {
    channels.push_back(channel.data());
  }
  player.run(frames, {}, {64}, channels);
  const std::size_t each = gap - settled - 2;
  const auto columns = static_cast<Eigen::Index>(each * 4 * n);
  Eigen::MatrixXd before(2 * masses, columns);
  Eigen::MatrixXd after(2 * masses, columns);
  Eigen::Index column = 0;
  for (std::size_t blow = 0; blow < 4 * n; ++blow) {
    for (std::size_t i = 0; i < each; ++i, ++column) {
      const std::size_t t = blow * gap + settled + i;
      for (Eigen::Index o = 0; o < masses; ++o) {
        const std::vector<double>& y = player.out[static_cast<std::size_t>(o)];
        before(o, column) = y[t];
        before(masses + o, column) = y[t + 1] - y[t];
        after(o, column) = y[t + 1];
        after(masses + o, column) = y[t + 2] - y[t + 1];
      }
    }
  }
  const Eigen::MatrixXd from = before.transpose();
  const Eigen::MatrixXd to = after.transpose();
  const Eigen::MatrixXd step = support::least_squares(from, to).transpose();
  Poles poles;
  const Eigen::VectorXcd values = support::eigenvalues_of(step);
  for (const std::complex<double>& z : values) {
    if (z.imag() > 1e-9) {
      poles.push_back(std::log(z));
    }
  }
  return poles;
}

bool is_heard(std::complex<double> s) {
  return s.imag() < 2.0 * std::numbers::pi * 20'000.0 / rate_hz &&
         s.imag() > -s.real() * 2.0 * std::numbers::pi / std::log(1000.0);
}

// Returns whether every audible partial has a partner among the measured poles, within the limits.
bool are_near(const Poles& wanted, const Poles& found, double cents, double t60_percent) {
  std::vector<std::vector<std::size_t>> near;
  for (const std::complex<double>& s : wanted) {
    if (!is_heard(s)) {
      continue;
    }
    near.emplace_back();
    for (std::size_t j = 0; j < found.size(); ++j) {
      const double pitch = std::fabs(1200.0 * std::log2(found[j].imag() / s.imag()));
      // Without damping, rounding errors are the only decay.
      const double decay = -s.real() < 1e-7 && -found[j].real() < 2e-7
                               ? 0.0
                               : std::fabs(100.0 * (s.real() / found[j].real() - 1.0));
      if (pitch <= cents && decay <= t60_percent) {
        near.back().push_back(j);
      }
    }
  }
  // Bipartite matching (Kuhn 1955).
  constexpr std::size_t nobody = static_cast<std::size_t>(-1);
  std::vector<std::size_t> owner(found.size(), nobody);
  for (std::size_t i = 0; i < near.size(); ++i) {
    std::vector<bool> seen(found.size());
    const std::function<bool(std::size_t)> place = [&](std::size_t from) {
      for (const std::size_t j : near[from]) {
        if (!seen[j]) {
          seen[j] = true;
          if (owner[j] == nobody || place(owner[j])) {
            owner[j] = from;
            return true;
          }
        }
      }
      return false;
    };
    if (!place(i)) {
      return false;
    }
  }
  return true;
}

struct Tally {
  std::size_t met = 0;
  std::size_t stated = 0;
  std::size_t silent = 0;
  std::size_t wrong_figure = 0;  // error above the reported one
  std::size_t published = 0;     // networks on which the published scheme fails
};

void judge(std::uint64_t seed, const Budget& budget, Tally& tally) {
  const Scene scene = SceneWriter(seed).write();
  const Network network = support::network_of(scene.text);
  const Poles wanted = continuous_poles(scene);
  const auto sound = [&](const Budget& asked) {
    auto player = std::make_unique<Player>(scene.text, default_preset(network, true),
                                           CompileOptions{.bare = true, .budget = asked});
    return std::pair(sounding_poles(*player, scene.mass.size(), seed), std::move(player));
  };
  const auto [found, player] = sound(budget);
  const Plan& plan = player->compiled.plan;
  INFO("seed " << seed << ", " << print_budget(budget) << "\n" << scene.text << describe(plan));
  // The error of the measurement itself.
  constexpr double noise_cents = 1e-3;
  constexpr double noise_percent = 1e-2;
  const bool is_near =
      are_near(wanted, found, budget.cents + noise_cents, budget.t60_percent + noise_percent);
  REQUIRE(plan.accuracy);
  const bool is_stated = missed_budget(plan).has_value();
  tally.met += is_near && !is_stated ? 1 : 0;
  tally.stated += is_stated ? 1 : 0;
  if (!is_near && !is_stated) {
    ++tally.silent;
    UNSCOPED_INFO("silent: " << describe(plan));
    CHECK(is_near);
  }
  if (plan.accuracy->is_known &&
      !are_near(wanted, found, 1.001 * plan.accuracy->cents + noise_cents,
                1.001 * plan.accuracy->t60_percent + noise_percent)) {
    ++tally.wrong_figure;
    CHECK(plan.accuracy->cents < 0.0);
  }
  tally.published += are_near(wanted, sound({}).first, budget.cents, budget.t60_percent) ? 0 : 1;
}

void judge_all(std::uint64_t first, std::size_t count) {
  const Budget budgets[] = {
      {.cents = 1.0}, {.cents = 3.0}, {.cents = 10.0}, {.t60_percent = 2.0}, {.t60_percent = 5.0}};
  for (const Budget& budget : budgets) {
    Tally tally;
    for (std::uint64_t seed = first; seed < first + count; ++seed) {
      judge(seed, budget, tally);
    }
    std::printf(
        "%s, seeds %llu to %llu: %zu met, %zu stated, %zu silent misses; as published %zu miss\n",
        print_budget(budget).c_str(), static_cast<unsigned long long>(first),
        static_cast<unsigned long long>(first + count - 1), tally.met, tally.stated, tally.silent,
        tally.published);
    CHECK(tally.silent == 0);
    CHECK(tally.wrong_figure == 0);
    // The test needs networks on which the published scheme fails.
    CHECK(tally.published > 0);
  }
}

TEST_CASE("A budget of pitch and decay is kept, or reported as not kept", "[accuracy]") {
  judge_all(1, 24);
}

TEST_CASE("A budget is kept, or reported as not kept, on 300 networks",
          "[.][accuracy_everywhere]") {
  judge_all(1001, 300);
}

Plan plan_of(const std::string& text, const Preset& preset, const Budget& budget) {
  auto compiled = compile_network(support::network_of(text), preset, {.budget = budget});
  REQUIRE(compiled);
  return std::move(compiled->plan);
}

// A mass on a spring: published, 2 asin(sqrt(K)/2) instead of sqrt(K).
double cents_of(double k) {
  return 1200.0 * std::log2(2.0 * std::asin(0.5 * std::sqrt(k)) / std::sqrt(k));
}

TEST_CASE("A budget holds over the whole range of a parameter", "[accuracy]") {
  const std::string text =
      "@k param 0.01\n@o osc 1. k 0. 0. 0.\n@in1 frcInput @o\n@out1 posOutput @o\n";
  Preset preset = support::struck(1);
  preset.keyboard = false;
  preset.parameters = {{.name = "k", .value = 0.01, .minimum = 0.005, .maximum = 0.01}};
  const Budget budget{.cents = 1.0};  // K = 0.01 is 0.72 cents off
  const Plan narrow = plan_of(text, preset, budget);
  REQUIRE(narrow.accuracy);
  CHECK(narrow.accuracy->cents == Approx(cents_of(0.01)).epsilon(1e-9));
  CHECK(narrow.parts.at(0).method != Method::modal);
  preset.parameters[0].maximum = 0.2;
  const Plan wide = plan_of(text, preset, {.cents = 20.0});
  REQUIRE(wide.accuracy);
  CHECK(wide.accuracy->cents == Approx(cents_of(0.2)).epsilon(1e-9));
  CHECK_FALSE(missed_budget(plan_of(text, preset, budget)));
  CHECK(plan_of(text, preset, budget).accuracy->cents < 1.0);
}

// Returns the frequency of 3000 samples of an oscillation, from the crossings of its mean value.
double oscillation_hz(std::span<const double> y) {
  const double mean = std::accumulate(y.begin(), y.end(), 0.0) / static_cast<double>(y.size());
  std::vector<double> crossings;
  for (std::size_t n = 1; n < y.size(); ++n) {
    if (y[n - 1] < mean && y[n] >= mean) {
      crossings.push_back(static_cast<double>(n) - (y[n] - mean) / (y[n] - y[n - 1]));
    }
  }
  return rate_hz * static_cast<double>(crossings.size() - 1) /
         (crossings.back() - crossings.front());
}

TEST_CASE("Nonlinear springs keep a budget of pitch at small amplitudes", "[accuracy]") {
  // A mass of 1 on K = 0.2 and 5 x^3. At small amplitudes its frequency is sqrt(K - Z^2/4), and the
  // published scheme is 14.7 cents sharp. A budget does not cover large amplitudes, where the pitch
  // is a third higher, but the error falls with the square of the steps a sample there too.
  constexpr double k = 0.2;
  constexpr double q = 5.0;
  constexpr double z = 0.0001;
  const std::string text = "@in1 frcInput @m\n@g ground 0.\n@m mass 1. 0. 0.\n@c nlSpring3 @g @m " +
                           show(k) + " " + show(q) + " " + show(z) + "\n@out1 posOutput @m\n";
  const auto heard_hz = [&](double blow, const Budget& budget) {
    Player player(text, default_preset(support::network_of(text), true),
                  {.bare = true, .budget = budget});
    std::vector<double> force(3072);
    force[0] = blow;
    const double* const input = force.data();
    player.run(force.size(), {}, {256}, {&input, 1});
    return oscillation_hz(std::span(player.y()).subspan(40, 3000));
  };
  const auto exact_hz = [&](double blow) {  // Runge-Kutta at 16 steps a sample
    double x = 0.0;
    double v = blow;
    constexpr double h = 1.0 / 16.0;
    const auto a = [&](double at, double speed) { return -k * at - q * at * at * at - z * speed; };
    std::vector<double> y;
    for (int n = 0; n < 16 * 3000; ++n) {
      const double v2 = v + h / 2 * a(x, v);
      const double v3 = v + h / 2 * a(x + h / 2 * v, v2);
      const double v4 = v + h * a(x + h / 2 * v2, v3);
      const double rise =
          a(x, v) + 2 * a(x + h / 2 * v, v2) + 2 * a(x + h / 2 * v2, v3) + a(x + h * v3, v4);
      x += h / 6 * (v + 2 * v2 + 2 * v3 + v4);
      v += h / 6 * rise;
      if (n % 16 == 15) {
        y.push_back(x);
      }
    }
    return oscillation_hz(y);
  };
  const double rest_hz = std::sqrt(k - z * z / 4.0) * rate_hz / (2.0 * std::numbers::pi);
  CHECK(exact_hz(1e-6) == Approx(rest_hz).epsilon(1e-5));
  const auto off_cents = [](double hz, double from) { return 1200.0 * std::log2(hz / from); };
  const Budget published{.passive = Passivity::always};
  CHECK(off_cents(heard_hz(1e-6, published), rest_hz) == Approx(14.7).epsilon(.01));
  for (const double cents : {10.0, 1.0}) {
    const Budget budget{.cents = cents, .passive = Passivity::always};
    CHECK(std::fabs(off_cents(heard_hz(1e-6, budget), rest_hz)) < cents);
    CHECK_FALSE(
        missed_budget(plan_of(text, default_preset(support::network_of(text), true), budget)));
  }
  const double sharp_hz = exact_hz(0.1);
  CHECK(off_cents(sharp_hz, rest_hz) > 350.0);
  CHECK(std::fabs(off_cents(heard_hz(0.1, published), sharp_hz)) > 50.0);
  const Budget fine{.cents = 1.0, .passive = Passivity::always};
  CHECK(std::fabs(off_cents(heard_hz(0.1, fine), sharp_hz)) < 10.0);
}

TEST_CASE("A budget is not reported as kept if the error is unknown", "[accuracy]") {
  // A mesh with one more damper: damping is not proportional, and there are too many masses.
  const std::string mesh =
      "@m mesh 30 30 1. 0.1 0.001 0. 0.\n@in1 frcInput [@m 0.3 0.4]\n"
      "@out1 posOutput [@m 0.6 0.7]\n";
  Preset preset = support::struck(1);
  preset.keyboard = false;
  const auto plan_for = [&](const std::string& text) {
    auto compiled = compile_network(support::network_of(text), preset,
                                    {.budget = Budget{.cents = 3.0}, .most_modes = 100});
    REQUIRE(compiled);
    return std::move(compiled->plan);
  };
  const Plan proportional = plan_for(mesh);
  REQUIRE(proportional.accuracy);
  CHECK(proportional.accuracy->is_known);
  CHECK(proportional.accuracy->is_bound);  // limited by the stiffness of the fastest mode
  CHECK_FALSE(missed_budget(proportional));
  const Plan crossed = plan_for(mesh + "@g ground 0.\n@d springDamper @g [@m 0.2 0.3] 0. 0.02\n");
  REQUIRE(crossed.accuracy);
  CHECK_FALSE(crossed.accuracy->is_known);
  REQUIRE(missed_budget(crossed));
  CHECK(missed_budget(crossed)->find("it is unknown whether") != std::string::npos);
}

}  // namespace
}  // namespace ressort::accuracy_test
