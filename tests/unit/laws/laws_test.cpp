// Properties that every force law must have: its facts must agree with its force.
#include "core/laws/laws.h"

#include <cmath>
#include <set>
#include <string>

#include "core/analysis/stability.h"
#include "core/kernels/program.h"
#include "core/model/language/mdl.h"
#include "core/model/language/print.h"
#include "tests/support/random.h"
#include "tests/support/rooms.h"

namespace ressort::laws_test {
namespace {

using support::Random;

constexpr int draws = 2000;  // draws for each law

// Calls `use(type, random)` for every law.
template <class Use>
void each_law(Use&& use) {
  for (std::size_t i = 0; i < law_count; ++i) {
    with_law_type(static_cast<Law>(i), [&]<class Type>(Type type) {
      Random random(100 + i);  // so that a new law does not change the others' values
      INFO(type.facts.name);
      use(type, random);
    });
  }
}

// Returns random arguments within the usual ranges.
LawNumbers any_arguments(const LawFacts& law, Random& random) {
  LawNumbers values{};
  for (std::size_t i = 0; i < law.count; ++i) {
    switch (law.arguments[i].role) {
      case Role::stiffness:
      case Role::limit:
        values[i] = random.uniform(0.001, 2.0);
        break;
      case Role::bend:
        values[i] = random.uniform(0.0, 20.0);
        break;
      case Role::damping:
        values[i] = random.uniform(0.0, 0.5);
        break;
      case Role::reach:
        values[i] = random.uniform(0.05, 1.0);
        break;
      case Role::shape:
        values[i] = random.uniform(law.arguments[i].least, law.arguments[i].most);
        break;
    }
  }
  return values;
}

template <class Type>
auto law_with(const LawNumbers& values) {
  return law_of<Type, double>([&](std::size_t i) { return values[i]; });
}

// Returns the energy that a link stores by its discrete gradient between two samples.
template <class ForceLaw>
double held(const ForceLaw& law, double now, double before) {
  if constexpr (ForceLaw::facts.contains_spring && ForceLaw::facts.is_curved) {
    return (law.curved(now) + law.curved(before)) / 2.0;
  } else {
    return (law.potential(now) + law.potential(before)) / 2.0;
  }
}

}  // namespace

TEST_CASE("the facts of every law are complete, and its name is unique", "[laws]") {
  std::set<std::string_view> names;
  each_law([&](auto type, Random&) {
    const LawFacts& law = type.facts;
    CHECK(&facts_of(type.law) == &law_table()[static_cast<std::size_t>(type.law)]);
    CHECK(facts_of(type.law).name == law.name);
    CHECK(names.insert(law.name).second);
    CHECK((!law.one.empty() && !law.many.empty()));
    CHECK(law.has(Role::damping));
    CHECK((law.is_friction) != law.has(Role::stiffness));
    CHECK((law.zone == Zone::everywhere || law.has(Role::reach)));
    CHECK(law.solve_operations > 0.0);
    CHECK(!law.words[0].word.empty());
  });
}

TEST_CASE("the force of every law is the slope of its potential", "[laws]") {
  constexpr double h = 1e-5;
  each_law([&](auto type, Random& random) {
    for (int i = 0; i < draws; ++i) {
      const LawNumbers values = any_arguments(type.facts, random);
      const auto law = law_with<decltype(type)>(values);
      const double d = random.uniform(-2.0, 2.0);
      const double slope = (law.potential(d + h) - law.potential(d - h)) / (2.0 * h);
      const double steep = steepest(type.law, values, values, std::fabs(d) + h).stiffness;
      CAPTURE(d);
      CHECK(std::fabs(slope - law.force(d, 0.0)) <= steep * h + 1e-9);
    }
  });
}

TEST_CASE("the units of every law's arguments keep its sound at every sample rate", "[laws]") {
  // At twice the rate, a velocity per sample is half as large, and a force, as a change of velocity
  // per sample, a quarter. The published spring of mi.lib has a damping of 0.3 K, which does not
  // follow the rate, so it is tested at rest.
  constexpr double r = 0.5;
  each_law([&](auto type, Random& random) {
    for (int i = 0; i < draws; ++i) {
      const LawNumbers values = any_arguments(type.facts, random);
      LawNumbers faster = values;
      for (std::size_t k = 0; k < type.facts.count; ++k) {
        faster[k] *= rate_factor(type.facts.arguments[k].unit, r);
      }
      const double d = random.uniform(-2.0, 2.0);
      const bool is_published = steepest(type.law, values, values, 2.0).stiff_damping > 0.0;
      const double v = is_published ? 0.0 : random.uniform(-0.3, 0.3);
      const double wanted = r * r * law_with<decltype(type)>(values).force(d, v);
      CAPTURE(d, v);
      CHECK(law_with<decltype(type)>(faster).force(d, r * v) == Approx(wanted).epsilon(1e-12));
    }
  });
}

TEST_CASE("the slopes of every law reach their bounds and do not exceed them", "[laws]") {
  constexpr double h = 1e-6;
  constexpr double rounding = 1e-8;
  each_law([&](auto type, Random& random) {
    for (int i = 0; i < draws / 10; ++i) {
      const LawNumbers values = any_arguments(type.facts, random);
      const auto law = law_with<decltype(type)>(values);
      const Slopes most = steepest(type.law, values, values, 1.0);
      double stiffest = 0.0;
      double most_damped = 0.0;
      for (int k = 0; k < 500; ++k) {
        const double d = random.uniform(-1.0, 1.0);
        const double v = random.uniform(-1.0, 1.0);
        const double out = d < 0.0 ? -h : h;  // one step further from 0
        const double by_d = (law.force(d, 0.0) - law.force(d - out, 0.0)) / out;
        const double by_v = (law.force(d - out, v + h) - law.force(d - out, v)) / h;
        const double at_0 = (law.force(d - out, h) - law.force(d - out, 0.0)) / h;
        stiffest = std::max(stiffest, std::fabs(by_d));
        most_damped = std::max(most_damped, at_0);
        if (!(std::fabs(by_d) <= most.stiffness + rounding &&
              by_v <= most.damping + most.stiff_damping + rounding &&
              by_d + 2.0 * by_v <= most.pull + 2.0 * most.damping + rounding)) {
          CAPTURE(d, v, by_d, by_v, most.stiffness, most.damping, most.pull);
          FAIL("steeper than its bound");
        }
      }
      // A clipped law is steepest at a single point, which random points miss. For a law with
      // several shapes only the steepest shape reaches the bound.
      if (!type.facts.has(Role::limit) && !type.facts.has(Role::shape)) {
        CHECK(stiffest >= 0.8 * most.stiffness);
        CHECK(most_damped >= 0.99 * most.damping - rounding);
      }
    }
  });
}

TEST_CASE("a clipped law has the slope 3 k - 2 s just below its clip", "[laws]") {
  // s d + c d^3 reaches k d at b = sqrt((k - s)/c), with the slope s + 3 c b^2.
  const double s = 0.1;
  const double c = 7.0;
  const double k = 1.9;
  const double b = std::sqrt((k - s) / c);
  const double h = 1e-7;
  const laws::ClippedSpring<double> spring{s, c, k, 0.0};
  const laws::ClippedContact<double> contact{s, c, k, 0.0, 0.0};
  CHECK((spring.force(b, 0.0) - spring.force(b - h, 0.0)) / h == Approx(5.5).epsilon(1e-5));
  CHECK((contact.force(b, 0.0) - contact.force(b - h, 0.0)) / h == Approx(5.5).epsilon(1e-5));
  const LawNumbers values{s, c, k, 0.0, 0.0};
  CHECK(steepest(Law::clipped_spring, values, values, 0.0).pull == Approx(5.5));
  CHECK(steepest(Law::clipped_contact, values, values, 0.0).pull == Approx(5.5));
  // A late clip: beyond it the extra damper dominates.
  const LawNumbers flat{1.8, c, k, 0.0, 0.0};
  CHECK(steepest(Law::clipped_spring, flat, flat, 0.0).pull == Approx(1.6 * k));
  // Without a curve it is a spring of stiffness s.
  const LawNumbers straight{s, 0.0, k, 0.0, 0.0};
  CHECK(steepest(Law::clipped_spring, straight, straight, 0.0).pull == s);
  CHECK(steepest(Law::clipped_contact, straight, straight, 0.0).pull == s);
}

TEST_CASE("a mass that oscillates forever at the clip of a spring is not reported as stable",
          "[laws]") {
  // Although it is damped, near the clip each sample throws the mass to the other side.
  const std::string text =
      "@g ground 0.\n@m massG 1. 0.0783 -0.042 0.\n"
      "@l nlSpringDamper @g @m 0.1 1000. 1.9 0.001\n@out1 posOutput @m\n~motion velocity\n";
  const laws::ClippedSpring<double> spring{0.1, 1000.0, 1.9, 0.001};
  double x = -0.042;
  double v = 0.0;
  double f = 0.0;
  double lowest = 0.0;
  double highest = -1.0;
  for (int n = 0; n < 200'000; ++n) {
    v += f - 0.0783;
    x += v;
    f = spring.force(-x, -v);
    if (n > 199'000) {
      lowest = std::min(lowest, x);
      highest = std::max(highest, x);
    }
  }
  CHECK(lowest == Approx(-0.045396).margin(2e-6));
  CHECK(highest == Approx(-0.039831).margin(2e-6));

  const ParsedNetwork parsed = parse_network(text);
  REQUIRE(parsed.ok());
  Stability stability(parsed.network, 1.0);
  const Certificate certificate = stability.certify({});
  CHECK(certificate.verdict == Verdict::unstable);
  REQUIRE(certificate.culprit);
  CHECK(certificate.culprit->value == 1.9);
  // 3 k - 2 s + 2 Z = 4
  REQUIRE(certificate.culprit->limit);
  CHECK(*certificate.culprit->limit == Approx((4.0 + 0.2 - 0.002) / 3.0).epsilon(1e-6));
}

TEST_CASE("no law exerts a force beyond its reach", "[laws]") {
  each_law([&](auto type, Random& random) {
    const LawFacts& facts = type.facts;
    for (int i = 0; i < draws; ++i) {
      LawNumbers values = any_arguments(facts, random);
      double d = random.uniform(-2.0, 2.0);
      double v = random.uniform(-2.0, 2.0);
      if (facts.zone == Zone::everywhere) {
        for (std::size_t k = 0; k < facts.count; ++k) {
          values[k] = facts.is_strength(k) ? 0.0 : values[k];
        }
      } else {
        const double reach = values[facts.slot(Role::reach)];
        const double past = random.uniform(0.0, 1.0);
        const double side = random.uniform(-1.0, 1.0) < 0.0 ? -1.0 : 1.0;
        d = facts.zone == Zone::near    ? side * (reach + past)
            : facts.zone == Zone::below ? -reach - past
                                        : d;
        v = facts.zone == Zone::slow ? side * (reach + past) : v;
        CHECK(facts.gap(values, d) >= (facts.can_detach() ? past - 1e-12 : 0.0));
      }
      CHECK(law_with<decltype(type)>(values).force(d, v) == 0.0);
    }
  });
}

// A contact does not act at a distance of -1 or less, as no reach here exceeds 1.
TEST_CASE("a law whose zone is everywhere acts on both sides of 0", "[laws]") {
  each_law([&](auto type, Random& random) {
    int acts_above = 0;
    int acts_below = 0;
    for (int i = 0; i < draws; ++i) {
      const auto law = law_with<decltype(type)>(any_arguments(type.facts, random));
      const double d = random.uniform(1.0, 2.0);
      const double v = random.uniform(-0.3, 0.3);
      acts_above += law.force(d, v) != 0.0;
      acts_below += law.force(-d, v) != 0.0;
    }
    if (type.facts.zone == Zone::everywhere) {
      CHECK(acts_above > 0);
      CHECK(acts_below > 0);
    }
  });
}

TEST_CASE("the ends of an odd law may be exchanged", "[laws]") {
  each_law([&](auto type, Random& random) {
    int differs = 0;
    for (int i = 0; i < draws; ++i) {
      const auto law = law_with<decltype(type)>(any_arguments(type.facts, random));
      const double d = random.uniform(-2.0, 2.0);
      const double v = random.uniform(-2.0, 2.0);
      differs += law.force(-d, -v) == -law.force(d, v) ? 0 : 1;
    }
    CHECK((differs == 0) == type.facts.is_odd);
  });
}

TEST_CASE("a discrete gradient does not create energy", "[laws]") {
  // Force times displacement equals the change of the potential, to rounding; a damper only removes
  // energy. Where every moving mass is damped, at least this loss occurs.
  each_law([&](auto type, Random& random) {
    const LawFacts& facts = type.facts;
    for (int i = 0; i < draws; ++i) {
      LawNumbers values = any_arguments(facts, random);
      const bool is_damped = facts.is_friction || i % 2 == 0;
      double& damping = values[facts.slot(Role::damping)];
      damping = is_damped ? damping : 0.0;
      const auto law = law_with<decltype(type)>(values);
      laws::LinkState<double> link{.now = random.uniform(-1.0, 1.0),
                                   .speed = random.uniform(-0.3, 0.3),
                                   .gamma = random.uniform(0.0, 3.0)};
      link.fast = link.speed + random.uniform(-0.1, 0.1);
      link.free = link.now + link.fast;
      const double f = law.passive(link);
      const double after = link.free - link.gamma * f;
      double way = after - link.before();
      double work = f * way;
      double gained = 2.0 * (held(law, after, link.now) - held(law, link.now, link.before()));
      if constexpr (type.facts.contains_spring && type.facts.is_curved) {
        // this part uses the published scheme
        work -= (law.k * link.now + law.z * link.speed) * way;
      }
      CAPTURE(link.now, link.speed, link.free, link.gamma, f);
      CHECK(work >= gained - 1e-9);
      const Slopes slopes = steepest(type.law, values, values, 0.0);
      if (damping == 0.0 && slopes.stiff_damping == 0.0) {
        CHECK(work == Approx(gained).margin(1e-9));
      }
    }
  });
}

TEST_CASE("the passive force of every law is its steady part and its gradient", "[laws]") {
  // Links that share a mass and the FAUST export use these two parts, a link alone `passive`:
  // f = force + damping s + gradient(before, s), where s is the change of distance in two samples.
  each_law([&](auto type, Random& random) {
    for (int i = 0; i < draws; ++i) {
      const auto law = law_with<decltype(type)>(any_arguments(type.facts, random));
      laws::LinkState<double> link{.now = random.uniform(-1.0, 1.0),
                                   .speed = random.uniform(-0.3, 0.3),
                                   .gamma = random.uniform(0.0, 3.0)};
      link.fast = link.speed + random.uniform(-0.1, 0.1);
      link.free = link.now + link.fast;
      const double f = law.passive(link);
      const double way = link.free - link.gamma * f - link.before();
      const auto steady = law.steady(link);
      const double parts =
          steady.force + steady.damping * way + law.gradient(link.before(), way).value;
      CAPTURE(link.now, link.speed, link.free, link.gamma, way);
      CHECK(f == Approx(parts).margin(1e-9));
    }
  });
}

TEST_CASE("the slope of every gradient is that of its value", "[laws]") {
  // Central differences with steps of 1e-6 err by 1e-12 times the third derivative and by rounding
  // of 1e-16/1e-6. The corner of a force lies between the two for one step of 10^5.
  constexpr double h = 1e-6;
  each_law([&](auto type, Random& random) {
    int wrong = 0;
    for (int i = 0; i < draws; ++i) {
      const auto law = law_with<decltype(type)>(any_arguments(type.facts, random));
      const double before = random.uniform(-1.0, 1.0);
      const double step = random.uniform(0.05, 0.5) * (i % 2 == 0 ? 1.0 : -1.0);
      const double by_step =
          (law.gradient(before, step + h).value - law.gradient(before, step - h).value) / (2.0 * h);
      wrong +=
          std::fabs(law.gradient(before, step).slope - by_step) > 1e-6 * (1.0 + std::fabs(by_step));
    }
    CHECK(wrong <= 1);
  });
}

TEST_CASE("the force of a felt solves its equation to rounding", "[laws]") {
  // f = (P(after) - P(before))/step with after = free - gamma f. Each energy has about 4 roundings
  // of u = 2^-53, which the division by the step magnifies. Each depth has 2, which the slope turns
  // into a force. Newton's method stops after a step of 2^-34, whose tangent errs by less than
  // these. Twice these figures, for the solver and for this check.
  Random random(7);
  constexpr double u = 0x1p-53;
  int touching = 0;
  for (int i = 0; i < draws; ++i) {
    const double any = random.uniform(1.0, 5.0);
    // Multiples of 1/2 are computed by products and a root.
    const laws::PowerContact<double> felt{.k = random.uniform(0.001, 2.0),
                                          .p = i % 2 == 0 ? any : 0.5 * std::round(2.0 * any),
                                          .z = 0.0,
                                          .t = random.uniform(0.05, 1.0)};
    laws::LinkState<double> link{.now = random.uniform(-1.0, 1.0),
                                 .speed = random.uniform(-0.3, 0.3),
                                 .gamma = random.uniform(0.0, 3.0)};
    link.free = link.now + link.speed + random.uniform(-0.1, 0.1);
    const double f = felt.passive(link);
    const auto depth = [&](double d) { return std::max(0.0, d + felt.t); };
    const auto energy = [&](double d) {
      return felt.k / (felt.p + 1.0) * std::pow(depth(d), felt.p + 1.0);
    };
    const double before = link.before();
    const double after = link.free - link.gamma * f;
    const double step = after - before;
    const double far = std::fabs(before) + std::fabs(link.free) + 2.0 * felt.t;
    if (std::fabs(step) < 1e-3 * far) {
      continue;  // the midpoint rule
    }
    const double slope =
        felt.k * felt.p * std::pow(std::max({depth(before), depth(after)}), felt.p - 1.0);
    const double rounding =
        8.0 * u * ((energy(after) + energy(before)) / std::fabs(step) + slope * far + f);
    CAPTURE(before, link.free, link.gamma, felt.p, f);
    CHECK(std::fabs(f - (energy(after) - energy(before)) / step) <= rounding);
    touching += f > 0.0;
  }
  CHECK(touching > draws / 4);
}

TEST_CASE("the friction of a smooth bow solves its equation to rounding", "[laws]") {
  // f = 0.63 Z v exp(1/2 - 4 r^2) with r = v/s and v = wanted - half f. With u = 2^-53, the
  // exponent's 4 roundings change f by 4 r^2 u each, the 5 of the product by u each, and those of v
  // by the slope times u. Twice these figures, for the solver and for this check.
  Random random(11);
  constexpr double u = 0x1p-53;
  for (int i = 0; i < 10 * draws; ++i) {
    const laws::SmoothBow<double> bow{.z = random.uniform(0.01, 2.0),
                                      .s = random.uniform(0.01, 1.0)};
    const double half = random.uniform(0.0, 1.5);
    const double last = random.uniform(-0.5, 0.5);
    const double wanted = random.uniform(-1.0, 1.0);
    const double f = bow.grip(wanted, last, half);
    const double v = wanted - half * f;
    const double ratio = v / bow.s;
    const double grip = 0.63 * bow.z * std::exp(0.5 - 4.0 * ratio * ratio);
    const double slope = std::fabs(grip * (1.0 - 8.0 * ratio * ratio));
    const double rounding = u * (std::fabs(f) * (16.0 * ratio * ratio + 5.0) +
                                 slope * (std::fabs(wanted) + std::fabs(v)));
    CAPTURE(bow.z, bow.s, half, last, wanted, f);
    CHECK(std::fabs(f - grip * v) <= 2.0 * rounding);
  }
}

TEST_CASE("every law has a finite force if some of its arguments are 0", "[laws]") {
  constexpr double motions[] = {0.0, 1e-9, 1e-3, 1.0, 1e6};
  each_law([&](auto type, Random& random) {
    const LawFacts& law = type.facts;
    for (std::size_t zeros = 0; zeros < (std::size_t{1} << law.count); ++zeros) {
      LawNumbers values = any_arguments(law, random);
      for (std::size_t i = 0; i < law.count; ++i) {
        const bool may_be_0 = law.arguments[i].role != Role::shape || law.arguments[i].least <= 0.0;
        values[i] = (zeros >> i & 1) != 0 && may_be_0 ? 0.0 : values[i];
      }
      const auto with = law_with<decltype(type)>(values);
      for (const double d : motions) {
        for (const double v : motions) {
          CAPTURE(zeros, d, v);
          CHECK(std::isfinite(with.force(d, v)));
          CHECK(std::isfinite(with.force(-d, -v)));
          if constexpr (requires(laws::LinkState<double> link) { with.passive(link); }) {
            const laws::LinkState<double> link{
                .now = d, .speed = v, .free = d + v, .fast = v, .gamma = 1.0};
            CHECK(std::isfinite(with.passive(link)));
          }
        }
      }
    }
  });
}

TEST_CASE("a law restored from a kept row is the same", "[laws]") {
  each_law([&](auto type, Random& random) {
    using ForceLaw = typename decltype(type)::template With<double>;
    if constexpr (requires(const ForceLaw& law, double* row) { law.keep(row); }) {
      for (int i = 0; i < draws; ++i) {
        const auto law = law_with<decltype(type)>(any_arguments(type.facts, random));
        double row[most_kept_numbers] = {};
        law.keep(row);
        const double d = random.uniform(-2.0, 2.0);
        const double v = random.uniform(-2.0, 2.0);
        CHECK(ForceLaw(row).force(d, v) == law.force(d, v));
      }
    }
  });
}

TEST_CASE("a link of any law reads back unchanged after printing", "[laws]") {
  each_law([&](auto type, Random&) {
    for (const LawWord& word : type.facts.words) {
      for (int count = word.least; !word.word.empty() && count <= word.most; ++count) {
        std::string text = "@p param 0.5\n@a mass 1 0 0\n@b mass 1 0 0\n@out1 posOutput @a\n@l " +
                           std::string(word.word) + " @a @b";
        for (int i = 0; i < count; ++i) {
          text += i == 2 && type.facts.is_friction ? " p" : " 0." + std::to_string(i + 1);
        }
        INFO(text);
        const ParsedNetwork parsed = parse_network(text);
        REQUIRE(parsed.ok());
        const Link& link = parsed.network.links.at(0);
        CHECK(facts_of(link.law).one == type.facts.one);
        const ParsedNetwork again = parse_network(print_network(parsed.network));
        REQUIRE(again.ok());
        CHECK(canonical(again.network) == canonical(parsed.network));
      }
    }
  });
}

}  // namespace ressort::laws_test
