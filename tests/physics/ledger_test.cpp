// A network of passive links never holds more energy than it was given, under any input.
#include "core/engine/energy.h"
#include "core/laws/laws.h"
#include "tests/support/passive.h"

namespace ressort::ledger_test {
namespace {

using namespace support;

// Returns a log-uniform random number.
double of_any_size(Random& random, double least, double most) {
  return least * std::pow(most / least, random.uniform(0.0, 1.0));
}

// Masses on stable springs, and nonlinear links of every law except plucks, far stiffer than the
// published scheme allows, most of them sharing masses; two position inputs, attached to nonlinear
// links only, whose reaction force is an output; two force inputs. Bows are as strong as the
// discrete gradient allows.
std::string abused(std::uint64_t seed) {
  Random random(seed);
  const std::size_t masses = 1 + random.below(6);
  const auto any = [&](double least, double most) {
    return show(of_any_size(random, least, most));
  };
  const auto mass = [&] { return "@m" + std::to_string(random.below(masses)); };
  std::string text = "@g ground 0.\n@w ground " + show(random.uniform(-.1, .1)) +
                     "\n@in1 posInput 0.\n@in2 posInput 0.1\n@out1 frcOutput @in1\n"
                     "@out2 frcOutput @in2\n@in3 frcInput @m0\n@in4 frcInput " +
                     mass() + "\n";
  for (std::size_t i = 0; i < masses; ++i) {
    const std::string name = "@m" + std::to_string(i);
    text +=
        name +
        (random.below(2) == 0 ? " mass " + any(.5, 5.) : " osc " + any(.5, 5.) + " 0.01 0.001") +
        " " + show(random.uniform(-.1, .1)) + " 0.\n";
    text += "@s" + std::to_string(i) + " springDamper " + name + " " +
            (i == 0 || random.below(2) == 0 ? "@g" : "@m0") + " " + any(1e-4, .05) + " " +
            any(1e-6, .01) + "\n";
  }
  const std::size_t links = 1 + random.below(8);
  for (std::size_t i = 0; i < links; ++i) {
    const std::string one = mass();
    static constexpr const char* others[] = {"@g", "@w", "@in1", "@in2"};
    std::string other = random.below(2) == 0 ? mass() : others[random.below(4)];
    other = other == one ? "@in1" : other;
    const std::string ends = random.below(2) == 0 ? one + " " + other : other + " " + one;
    const std::string reach = show(random.uniform(-.05, .05));
    const std::string name = "@x" + std::to_string(i);
    switch (random.below(9)) {
      case 0:
      case 1:
        text += name + " contact " + ends + " " + any(1e-2, 1e3) + " 0. " + reach + "\n";
        break;
      case 2:
        text += name + " contact " + ends + " " + any(1e-2, 1e3) + " " + any(1e-4, 2.) + " " +
                reach + "\n";
        break;
      case 3:
        text += name + " nlContact " + ends + " " + any(1e-3, 1e-1) + " " + any(1e-1, 1e4) + " " +
                any(1e-1, 1e3) + " " + any(1e-4, .5) + " " + reach + "\n";
        break;
      case 4:
        text += name + " nlSpring3 " + ends + " 0.01 " + any(1e-2, 1e4) + " 0.001\n";
        break;
      case 5:
        text += name + " nlSpring " + ends + " 0.01 " + any(1e-2, 1e4) + " 0.001\n";
        break;
      case 6:
        text += name + " nlSpringDamper " + ends + " 0.01 " + any(1e-2, 1e4) + " " +
                any(1e-1, 1e2) + " 0.001\n";
        break;
      default:
        text += name + " nlBow " + ends + " " + any(1e-3, .6) + " " + any(1e-4, 1.) +
                (random.below(2) == 0 ? " 1" : "") + "\n";
    }
  }
  return text;
}

// A network and the energy put into it.
class Ledger {
 public:
  Ledger(const std::string& text, Passivity passive)
      : body_(text, passive),
        passive_(program_of(text, Passivity::always)),
        force_(body_.x.size()),
        v_(body_.v) {
    for (const Coefficient& c : passive_.coefficients) {
      coefficients_.push_back(coefficient_value(passive_, c, passive_.parameters, 1.0));
    }
    go({0.0, 0.1, 0.0, 0.0});
    last_ = energy().value;
    passed = energy().scale;
    created = 0.0;
  }

  void go(const std::vector<double>& inputs) {
    const Program& program = body_.program();
    const std::vector<double> before = force_;
    v_ = body_.v;
    const std::vector<double> heard = body_.step(inputs);
    body_.kernel().save(0, body_.x.data(), body_.v.data());
    pull();
    double work = 0.0;
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const InputSlot& input = program.inputs[i];
      const double way = .5 * (body_.v[input.node] + v_[input.node]);
      // The reaction force on a position input includes the passive links of this sample and the
      // plain links of the next sample.
      const double force =
          input.is_force ? inputs[i] : -(before[input.node] + heard[i] - force_[input.node]);
      work += force * way;
      passed += std::fabs(force * way);
    }
    const double now = energy().value;
    created += std::max(0.0, now - last_ - work);
    last_ = now;
    is_finite = is_finite && std::isfinite(now);
  }

  // Returns the energy gained from nothing, relative to the initial energy and all work.
  double excess() const { return created / passed; }

  double created = 0.0;  // Sum over all samples with a gain.
  double passed = 0.0;
  bool is_finite = true;

 private:
  // Energy as if all links used the discrete gradient.
  Energy energy() const {
    return energy_of(passive_, LaneValues<double>{coefficients_.data(), 1}, body_.x.data(),
                     body_.v.data());
  }

  // Forces of plain links in the next sample.
  void pull() {
    std::fill(force_.begin(), force_.end(), 0.0);
    const Program& program = body_.program();
    for (const LinkRun& run : program.link_runs) {
      const auto c = [&](std::size_t i) {
        return coefficient_value(program, program.coefficients[run.coefficients[i]],
                                 program.parameters, 1.0);
      };
      if (run.scheme == Scheme::plain) {
        with_law<double>(run.law, c, [&](const auto& law) {
          for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
            const auto [a, b] = program.ends[i];
            const double f = law.force(body_.x[a] - body_.x[b], body_.v[a] - body_.v[b]);
            force_[a] -= f;
            force_[b] += f;
          }
        });
      }
    }
  }

  double last_ = 0.0;
  Stepper<double> body_;
  Program passive_;
  std::vector<double> coefficients_;  // Coefficients of `passive_`.
  std::vector<double> force_;         // [node]
  std::vector<double> v_;             // One sample ago.
};

// Strikes over six decades of force; position inputs that rest, sweep and jump.
void abuse(Ledger& ledger, std::uint64_t seed, int frames) {
  Random random(seed);
  std::vector<double> inputs = {0.0, 0.1, 0.0, 0.0};
  double sweep[2] = {0.0, 0.0};
  const auto any = [&](double least, double most) {
    return of_any_size(random, least, most) * (random.below(2) == 0 ? 1.0 : -1.0);
  };
  for (int n = 0; n < frames && ledger.is_finite; ++n) {
    for (std::size_t hand = 0; hand < 2; ++hand) {
      if (random.below(100) == 0) {
        sweep[hand] = random.below(2) == 0 ? 0.0 : any(1e-6, .1);
      }
      inputs[hand] = random.below(300) == 0 ? any(1e-3, 1.0) : inputs[hand] + sweep[hand];
      sweep[hand] = std::fabs(inputs[hand]) > 2.0 ? -inputs[hand] * .01 : sweep[hand];
      inputs[2 + hand] = random.below(200) == 0 ? any(1e-3, 1e3) : 0.0;
    }
    ledger.go(inputs);
  }
}

}  // namespace

TEST_CASE("passive links gain no energy under any input", "[ledger]") {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const std::string text = abused(seed);
    INFO("seed " << seed << "\n" << text);
    Ledger ledger(text, Passivity::always);
    abuse(ledger, seed, 4000);
    CAPTURE(show(ledger.excess()), show(ledger.passed));
    CHECK(ledger.is_finite);
    CHECK(ledger.passed > 0.0);
    CHECK(ledger.excess() < 1e-12);
  }
}

TEST_CASE("the published laws gain energy without limit under the same inputs", "[ledger]") {
  int exploded = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    Ledger ledger(abused(seed), Passivity::never);
    abuse(ledger, seed, 4000);
    exploded += ledger.is_finite ? 0 : 1;
  }
  CHECK(exploded > 40);
}

TEST_CASE("a single published contact gains energy", "[ledger]") {
  const std::string text =
      "@w ground 0.\n@in1 posInput -2.\n@in2 posInput 0.1\n@out1 frcOutput @in1\n"
      "@out2 frcOutput @in2\n@m0 mass 1. 0. 0.\n@s springDamper @w @m0 0.001 0.0001\n"
      "@x contact @in1 @m0 3. 0.\n@y contact @m0 @in2 0.01 0.\n@in3 frcInput @m0\n"
      "@in4 frcInput @m0\n";
  Ledger passive(text, Passivity::always);
  Ledger published(text, Passivity::never);
  abuse(passive, 1, 20000);
  abuse(published, 1, 20000);
  CHECK(passive.excess() < 1e-12);
  CHECK(published.excess() > 1.0);
}

}  // namespace ressort::ledger_test
