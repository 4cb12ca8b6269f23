// Passive links that share masses, in any number: the energy is computed from positions, with
// potentials defined in this file and not taken from the laws.
#include <numeric>

#include "core/laws/laws.h"
#include "tests/support/passive.h"

namespace ressort::clusters_test {
namespace {

using namespace support;

// Returns the nonlinear potential of a law at a distance d; arguments in the order of the text.
long double held(Law law, const LawNumbers& c, long double d) {
  const auto clipped = [&](long double u) -> long double {
    if (c[1] == 0.0 || c[0] >= c[2]) {
      return (c[1] == 0.0 ? c[0] : c[2]) / 2.0L * u * u;
    }
    const long double edge = (c[2] - c[0]) / c[1];  // squared
    const long double bent = std::min(u * u, edge);
    return c[0] / 2.0L * bent + c[1] / 4.0L * bent * bent + c[2] / 2.0L * (u * u - bent);
  };
  const long double far = std::fabs(d);
  switch (law) {
    case Law::quadratic_spring:
      return c[1] / 3.0L * far * far * far;
    case Law::cubic_spring:
      return c[1] / 4.0L * far * far * far * far;
    case Law::clipped_spring:
      return clipped(d);
    case Law::contact:
      return d > -c[2] ? c[0] / 2.0L * (d + c[2]) * (d + c[2]) : 0.0L;
    case Law::clipped_contact:
      return d > -c[4] ? clipped(d + c[4]) : 0.0L;
    case Law::power_contact:
      return d > -c[3] ? c[0] / (c[1] + 1.0L) * std::pow(d + c[3], c[1] + 1.0L) : 0.0L;
    case Law::pluck: {
      const long double slope = c[1] - std::clamp<long double>(far, c[1] / 10.0L, c[1]);
      const long double hill = std::max(0.0L, c[1] * c[1] / 100.0L - d * d);
      return c[0] / 20.0L * slope * slope + 0.45L * c[0] * hill;
    }
    case Law::spring:
    case Law::bow:
    case Law::smooth_bow:
    case Law::either_bow:
      return 0.0L;
  }
  return 0.0L;
}

// Compares a network's energy in each sample with its initial energy and the work of forces.
class EnergyJudge {
 public:
  explicit EnergyJudge(const std::string& text, Passivity passive = Passivity::always)
      : body_(text, passive), now_(body_.program().position), v_(body_.program().velocity) {
    const Program& program = body_.program();
    const auto value = [&](std::uint32_t c) {
      return coefficient_value(program, program.coefficients[c], program.parameters, 1.0);
    };
    mass_.resize(program.moving);
    gravity_.resize(program.moving);
    for (const MassRun& run : program.mass_runs) {
      for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
        mass_[i] = 1.0 / value(run.inverse_mass);
        gravity_[i] = run.has_gravity ? value(run.gravity) : 0.0;
      }
    }
    for (const LinkRun& run : program.link_runs) {
      LawNumbers numbers{};
      for (std::size_t i = 0; i < facts_of(run.law).count; ++i) {
        numbers[i] = value(run.coefficients[i]);
      }
      for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
        links_.push_back({run.law, numbers, program.ends[i]});
      }
    }
    // The initial energy from the text: kinetic energy, and the potentials at the start or one
    // sample earlier, whichever are larger.
    for (std::size_t i = 0; i < mass_.size(); ++i) {
      start += mass_[i] / 2.0L * v_[i] * v_[i];
    }
    for (const Link& link : links_) {
      const auto [d, speed] = of(link, now_, v_);
      const long double here = held(link.law, link.c, d);
      start += std::max(here, (here + held(link.law, link.c, d - speed)) / 2.0L);
    }
    passed = start;
  }

  void go(const std::vector<double>& forces = {}) {
    const std::vector<double> before = v_;
    body_.go(forces);
    for (std::size_t i = 0; i < forces.size(); ++i) {
      const std::uint32_t node = body_.program().inputs[i].node;
      const long double done = forces[i] * (static_cast<long double>(body_.v[node]) + before[node]);
      work += done / 2.0L;
      passed += std::fabs(done);
    }
    energy = 0.0L;
    for (std::size_t i = 0; i < mass_.size(); ++i) {
      const long double fall = gravity_[i] * (static_cast<long double>(body_.v[i]) + before[i]);
      work -= fall / 2.0L;
      passed += std::fabs(fall);
      energy += mass_[i] / 2.0L * body_.v[i] * body_.v[i];
    }
    for (const Link& link : links_) {
      const auto [there, last] = of(link, now_, body_.v);
      const auto [d, speed] = of(link, body_.x, body_.v);
      energy += (held(link.law, link.c, there) + held(link.law, link.c, d)) / 2.0L;
      const auto linear = [&](Role role) {
        const LawFacts& law = facts_of(link.law);
        return law.contains_spring ? link.c[law.slot(role)] : 0.0;
      };
      const long double straight =
          linear(Role::stiffness) / 2.0L * there * d - linear(Role::damping) / 4.0L * speed * speed;
      energy += straight;
      // Linear links exert no force in the first sample, and their normal force from the second
      // sample on.
      start += is_first_ ? straight : 0.0L;
    }
    is_first_ = false;
    now_ = body_.x;
    v_ = body_.v;
    excess = std::max(excess, static_cast<double>((energy - start - work) / passed));
    is_finite = is_finite && std::isfinite(static_cast<double>(energy));
  }

  const std::vector<double>& x() const { return body_.x; }
  const std::vector<double>& v() const { return body_.v; }
  // Returns the share of the available energy that is left.
  double kept() const { return static_cast<double>(energy / (start + work)); }

  long double start = 0.0L;
  long double work = 0.0L;
  long double passed = 0.0L;
  long double energy = 0.0L;
  double excess = 0.0;  // Largest surplus so far, relative to the total energy exchanged.
  bool is_finite = true;

 private:
  struct Link {
    Law law{};
    LawNumbers c{};
    Ends ends;
  };
  struct Distance {
    long double d;
    long double speed;
  };
  static Distance of(const Link& link, const std::vector<double>& x, const std::vector<double>& v) {
    const auto [a, b] = link.ends;
    return {static_cast<long double>(x[a]) - x[b], static_cast<long double>(v[a]) - v[b]};
  }

  bool is_first_ = true;
  Stepper<double> body_;
  std::vector<double> now_;
  std::vector<double> v_;
  std::vector<double> mass_;
  std::vector<double> gravity_;
  std::vector<Link> links_;
};

std::string mass(std::size_t i, double m, double x, double v) {
  return "@m" + std::to_string(i) + " mass " + show(m) + " " + show(x) + " " + show(v * 44100.) +
         "\n";
}

// Up to 40 masses and up to 200 links of any law between them and two walls, with coefficients over
// six decades, most of them in one cluster.
std::string any_cluster(std::uint64_t seed) {
  Random random(seed);
  const auto any = [&](double least, double most) {
    return least * std::pow(most / least, random.uniform(0.0, 1.0));
  };
  const std::size_t masses = 1 + random.below(random.below(3) == 0 ? 40 : 8);
  const std::size_t links = 1 + random.below(random.below(3) == 0 ? 200 : 20);
  const double reach = any(1e-4, 1.0);
  const double speed = any(1e-6, 1.0);
  const double stiffest = any(1e-3, 1e6);
  std::string text =
      "~motion velocity\n@g ground 0.\n@w ground " + show(random.uniform(-.05, .05)) + "\n";
  for (std::size_t i = 0; i < masses; ++i) {
    text += mass(i, any(.3, 3.), reach * random.uniform(-1., 1.),
                 random.below(2) == 0 ? 0. : speed * random.uniform(-1., 1.));
    if (random.below(3) == 0) {
      text += "@s" + std::to_string(i) + " springDamper @g @m" + std::to_string(i) + " " +
              show(any(1e-4, .2)) + " " + show(any(1e-5, .05)) + "\n";
    }
  }
  const double size = std::max(reach, speed);
  for (std::size_t i = 0; i < links; ++i) {
    const std::string one = "@m" + std::to_string(random.below(masses));
    std::string other = "@m" + std::to_string(random.below(masses));
    other = other == one || random.below(5) == 0 ? (random.below(2) == 0 ? "@g" : "@w") : other;
    const std::string name = "@l" + std::to_string(i) + " ";
    const std::string ends = random.below(2) == 0 ? one + " " + other : other + " " + one;
    const double k = stiffest * any(1e-3, 1.0);
    const std::string stiffness = " " + show(k);
    const std::string bent =
        " " + show(any(1e-2, 1.) * k) + " " + show(any(1e-2, 1e2) * k / size / size) + stiffness;
    const std::string damping = " " + show(random.below(3) == 0 ? any(1e-4, 3.) : 0.);
    const std::string edge = " " + show(random.below(4) == 0 ? 0. : size * random.uniform(-1., 1.));
    const std::string slip = " " + show(any(1e-2, 1e3)) + " " + show(any(1e-4, 1.) * speed);
    switch (random.below(8)) {
      case 0:
        text += name + "contact " + ends + stiffness + damping + edge + "\n";
        break;
      case 1:
        text += name + "nlContact " + ends + bent + damping + edge + "\n";
        break;
      case 2:
        text += name + "nlSpring3 " + ends + " 0. " + show(k / size / size) + " 0.\n";
        break;
      case 3:
        text += name + "nlSpring2 " + ends + " 0. " + show(k / size) + " 0.\n";
        break;
      case 4:
        text += name + "nlSpringDamper " + ends + bent + damping + "\n";
        break;
      case 5:
        text += name + "nlPluck " + ends + stiffness + " " + show(size * any(.1, 1.)) + "\n";
        break;
      case 6:
        text += name + "nlBow " + ends + slip + "\n";
        break;
      default:
        text += name + "nlBow " + ends + slip + " 1\n";
    }
  }
  return text + "@in1 frcInput @m0\n@in2 frcInput @m" + std::to_string(random.below(masses)) +
         "\n@out1 posOutput @m0\n";
}

EnergyJudge tried(std::uint64_t seed, Passivity passive, int frames) {
  EnergyJudge judge(any_cluster(seed), passive);
  Random random(1000 + seed);
  const double force = std::pow(10., random.uniform(-6., 6.));
  for (int n = 0; n < frames && judge.is_finite; ++n) {
    std::vector<double> forces = {0., 0.};
    if (n > 0 && random.below(100) == 0) {
      forces[random.below(2)] = force * random.uniform(-1., 1.);
    }
    judge.go(forces);
  }
  return judge;
}

}  // namespace

TEST_CASE("no cluster of links gains energy", "[clusters]") {
  int exploded = 0;
  std::vector<std::uint64_t> seeds(120);
  std::iota(seeds.begin(), seeds.end(), 1);
  // Seeds below 3000 that once gained energy: masses that start at rest on a slope; links far too
  // stiff for their mass; a strike after which the forces are 1e16 times their sum.
  seeds.insert(seeds.end(), {399, 834, 907, 1275, 2026, 2120, 2136});
  for (const std::uint64_t seed : seeds) {
    INFO("seed " << seed << "\n" << any_cluster(seed));
    const EnergyJudge judge = tried(seed, Passivity::always, 300);
    CHECK(judge.is_finite);
    CHECK(judge.excess < 1e-12);
    const EnergyJudge published = tried(seed, Passivity::never, 300);
    exploded += published.is_finite && published.excess < 1.0 ? 0 : 1;
  }
  CHECK(exploded > 60);
}

TEST_CASE("lossless networks conserve energy with any number of links at a mass", "[clusters]") {
  // Networks in which a law links every mass to every other and to a wall; chains; Newton's cradles
  // whose balls touch at the start. The start must not lose more than a thousandth of the initial
  // energy.
  const auto all_to_all = [](const std::string& law, std::size_t masses) {
    std::string text = "~motion velocity\n@g ground 0.\n";
    for (std::size_t i = 0; i < masses; ++i) {
      text += mass(i, 1. + .1 * static_cast<double>(i), 0., i % 2 == 0 ? .01 : -.007);
      for (std::size_t k = 0; k <= i; ++k) {
        text += "@l" + std::to_string(i) + "_" + std::to_string(k) + " " + law + " " +
                (k == i ? std::string("@g") : "@m" + std::to_string(k)) + " @m" +
                std::to_string(i) + "\n";
        text.insert(text.size() - 1, law == "nlSpring3" ? " 0. 100000. 0." : " 0. 300. 0.");
      }
    }
    return text;
  };
  const auto chain = [](const std::string& law, const std::string& arguments, double apart,
                        std::size_t masses) {
    std::string text = "~motion velocity\n@g ground 0.\n";
    for (std::size_t i = 0; i < masses; ++i) {
      text += mass(i, 1., apart * static_cast<double>(i + 1), i % 5 == 2 ? -.03 : 0.);
      text += "@l" + std::to_string(i) + " " + law + " " +
              (i == 0 ? std::string("@g") : "@m" + std::to_string(i - 1)) + " @m" +
              std::to_string(i) + " " + arguments + "\n";
    }
    return text;
  };
  for (const std::string& text :
       {all_to_all("nlSpring3", 6), all_to_all("nlSpring2", 5), all_to_all("nlSpring3", 12),
        chain("nlSpring3", "0. 10. 0.", 0., 40), chain("contact", "1000. 0. .05", .0551, 16),
        chain("nlContact", "10. 1e5 1000. 0. .05", .0551, 16),
        chain("nlSpringDamper", "1. 0. 5. 0.", 0., 30)}) {
    INFO(text);
    EnergyJudge judge(text + "@out1 posOutput @m0\n");
    judge.go();
    const long double first = judge.energy;
    for (int n = 0; n < 3000; ++n) {
      judge.go();
    }
    CHECK(judge.excess < 1e-12);
    CHECK(static_cast<double>(judge.energy / first) == Approx(1.0).epsilon(1e-10));
  }
}

TEST_CASE("a mass that starts inside a wall is held in its first sample", "[clusters]") {
  // A ball at 0.01 per sample, 0.001 before a wall with K/M = 10^4. It is elastic, so the ball
  // leaves at the speed it came with. Its depth is at most v/sqrt(K/M) beyond the point where the
  // mean potential of two samples is v^2/2.
  EnergyJudge ball(
      "~motion velocity\n@w ground 0.\n@m0 mass 1. -0.001 441.\n@c contact @m0 @w 10000. 0.\n"
      "@out1 posOutput @m0\n");
  double deepest = 0.0;
  for (int n = 0; n < 50; ++n) {
    ball.go();
    deepest = std::max(deepest, ball.x()[0]);
  }
  CHECK(ball.v()[0] == Approx(-.01).epsilon(1e-12));
  CHECK(deepest > 0.0);
  CHECK(deepest < std::sqrt(2.0) * .01 / 100.);
}

TEST_CASE("a cluster in one lane depends on no other lane", "[clusters]") {
  const std::string text = any_cluster(7);
  const Program program = program_of(text, Passivity::always);
  const auto play = [&](std::size_t voices, double other) {
    Bare<double> body(program, voices, Isa::base);
    std::vector<double> x = program.position;
    for (std::size_t lane = 1; lane < body.lanes(); ++lane) {
      for (double& at : x) {
        at *= other;
      }
      body.kernel().set_state(lane, x.data(), program.velocity.data());
    }
    std::vector<double> heard;
    for (int n = 0; n < 200; ++n) {
      for (std::size_t i = 0; i < 2; ++i) {
        body.feed(0, i, n == 30 ? .01 : 0.);
        for (std::size_t lane = 1; lane < body.lanes(); ++lane) {
          body.feed(lane, i, n % 7 == 0 ? other : 0.);
        }
      }
      heard.push_back(body.run(0)[0]);
    }
    return heard;
  };
  CHECK(play(2, 0.5) == play(2, -30.0));
}

}  // namespace ressort::clusters_test
