// The force laws against values computed by hand, and the kernel against the textbook simulator.
#include <string_view>

#include "core/laws/laws.h"
#include "tests/support/harness.h"
#include "tests/support/networks/reference_network.h"
#include "tests/support/passive.h"

namespace ressort::direct_test {
namespace {

using scenes::Example;
using support::Bare;
using support::Comparison;
using support::network_of;
using support::show;
using V = Pack<double, 16>;

constexpr std::size_t second = 44100;  // frames

V lanes(double value) {
  return V{} + value;
}
double pluck(double d, double v, double k, double s, double z) {
  return laws::Pluck<V>(lanes(k), lanes(s), lanes(z)).force(lanes(d), lanes(v))[0];
}
double bow(double v, double z, double s) {
  return laws::Bow<V>(lanes(z), lanes(s)).force(V{}, lanes(v))[0];
}
double smooth_bow(double v, double z, double s) {
  return laws::SmoothBow<V>{lanes(z), lanes(s)}.force(V{}, lanes(v))[0];
}
double contact(double d, double v, double k, double z, double t) {
  return laws::Contact<V>{lanes(k), lanes(z), lanes(t)}.force(lanes(d), lanes(v))[0];
}

// The input signals of a scene, the same for every kernel: inputs()[i] at frame n.
class Hands {
 public:
  Hands(const Network& network, const Example& example, std::uint64_t seed)
      : example_(example), position_(network.inputs.size()) {
    for (std::size_t i = 0; i < network.inputs.size(); ++i) {
      const bool is_force = network.inputs[i].is_force;
      motions_.emplace_back(seed + i, is_force ? 20.0 : 0.5, is_force ? 5000.0 : 6.0);
      position_[i] = network.masses[network.inputs[i].mass].position;
    }
  }
  const std::vector<double>& at(std::size_t n) {
    for (std::size_t i = 0; i < motions_.size(); ++i) {
      const double m = motions_[i](n);
      if (example_.name == "BowedString") {
        position_[i] += example_.reach * (0.6 + m);
      } else {
        position_[i] = (i == 0 ? example_.reach : 0.01) * m;
      }
    }
    return position_;
  }

 private:
  const Example& example_;
  std::vector<support::Motion> motions_;
  std::vector<double> position_;
};

}  // namespace

TEST_CASE("the laws match values computed by hand", "[direct]") {
  // Values printed by mi.lib itself; the force on a is -f.
  const double deltas[] = {.005, .0099, .01, .05, .099, .1, -.005, -.05};
  const double on_a[] = {.0045, .00891, .009, .005, .0001, 0, -.0045, -.005};
  for (std::size_t i = 0; i < std::size(deltas); ++i) {
    CAPTURE(deltas[i]);
    CHECK(std::fabs(-pluck(deltas[i], 7.0, 1.0, 0.1, 0.0) - on_a[i]) < 1e-16);
  }
  // The damping acts in both zones and ends with them.
  CHECK(std::fabs(pluck(.005, .02, 1.0, .1, .5) - (-.0045 + .01)) < 1e-16);
  CHECK(std::fabs(pluck(.05, .02, 1.0, .1, .5) - (-.005 + .01)) < 1e-16);
  CHECK(pluck(.1, .02, 1.0, .1, .5) == 0.0);

  // collision(.1, 0, .5) with x_a = 0, so d = -x_b.
  CHECK(contact(-.6, 0, .1, 0, .5) == 0.0);
  CHECK(contact(-.5, 0, .1, 0, .5) == 0.0);
  CHECK(std::fabs(contact(-.4, 0, .1, 0, .5) - .01) < 1e-16);
  CHECK(std::fabs(contact(.2, 0, .1, 0, .5) - .07) < 1e-16);
  // A contact may attract while it separates, as published: the damper acts alone.
  CHECK(std::fabs(contact(.1, -.2, 0, .5, 0) + .1) < 1e-16);
  CHECK(contact(0.0, -.2, 0, .5, 0) == 0.0);

  CHECK(laws::Spring<V>{lanes(.1), lanes(.05)}.force(lanes(.3), lanes(-.2))[0] ==
        .1 * .3 + .05 * -.2);
}

TEST_CASE("a bow's friction is strongest at s/3, a smooth bow's at s/sqrt 8", "[direct]") {
  const double z = 0.1;
  const double s = 0.05;
  const double peak = bow(s / 3, z, s);
  CHECK(std::fabs(peak - 2.0 / 9.0 * z * s) < 1e-18);
  CHECK(std::fabs(bow(s * (1 - 1e-9), z, s)) < 1e-11);
  CHECK(bow(s, z, s) == 0.0);
  CHECK(std::fabs(bow(s / 6, z, s) - peak / 2) < 1e-18);
  // The derivative of 0.63 z v exp(1/2 - 4 (v/s)^2) is 0 at v = s/sqrt 8; there exp(1/2 - 1/2) = 1.
  const double top = s / std::sqrt(8.0);
  CHECK(std::fabs(smooth_bow(top, z, s) - .63 * z * top) < 1e-18);
  CHECK(std::fabs(.63 / std::sqrt(8.0) - .2227) < 5e-5);
  double steepest = 0.0;
  for (int i = -2000; i <= 2000; ++i) {
    const double v = s * i / 1000.0;
    CHECK(std::fabs(bow(v, z, s)) <= peak * (1 + 1e-15));
    CHECK(std::fabs(smooth_bow(v, z, s)) <= .63 * z * top * (1 + 1e-15));
    CHECK(bow(-v, z, s) == -bow(v, z, s));
    CHECK(smooth_bow(-v, z, s) == -smooth_bow(v, z, s));
    CHECK(v * bow(v, z, s) >= 0.0);  // friction never drives the mass that it acts on
    steepest = std::max(steepest, smooth_bow(v + 1e-9, z, s) - smooth_bow(v, z, s));
  }
  // The slope at 0, which the stability bound uses.
  CHECK(steepest / 1e-9 == Approx(1.0387 * z).epsilon(1e-4));
}

TEST_CASE("the profile of a bow can change while it plays", "[direct]") {
  for (int i = -30; i <= 30; ++i) {
    const double v = 0.05 * i / 20.0;
    for (const double profile : {-1.0, 0.0, 1e-9, 0.5, 1.0, 7.0}) {
      const laws::EitherBow<V> either{lanes(0.1), lanes(0.05), lanes(profile)};
      const double found = either.force(V{}, lanes(v))[0];
      CHECK(found == (profile > 0.0 ? smooth_bow(v, 0.1, 0.05) : bow(v, 0.1, 0.05)));
    }
  }
}

TEST_CASE("the scenes have the published sizes", "[direct]") {
  for (const Example& example : scenes::nine_instruments()) {
    CAPTURE(example.name);
    const Network network = network_of(example.text);
    CHECK(static_cast<int>(make_program(network, 44100.0, true).moving) == example.moving);
    CHECK(static_cast<int>(network.links.size()) == example.links);
    const bool is_linear = std::all_of(network.links.begin(), network.links.end(),
                                       [](const Link& link) { return link.law == Law::spring; });
    CHECK(is_linear == example.is_linear);
  }
}

TEST_CASE("the direct kernel matches the textbook simulator for all nine instruments over a second",
          "[direct]") {
  for (const Example& example : scenes::nine_instruments()) {
    const Network network = network_of(example.text);
    auto oracle = reference::make_simulation(network, parameter_values(network));
    Bare<double> bare(make_program(network, 44100.0, true));
    Hands hands(network, example, 1);
    std::vector<Comparison> channels(bare.program().outputs.size());
    for (std::size_t n = 0; n < second; ++n) {
      const auto& inputs = hands.at(n);
      const auto expected = oracle.simulator.step(inputs);
      const auto found = bare.step(inputs);
      for (std::size_t c = 0; c < channels.size(); ++c) {
        channels[c].add(expected[c], found[c]);
      }
    }
    for (const Comparison& channel : channels) {
      INFO(example.name << ": residual " << show(channel.relative()));
      CHECK(channel.peak > 0.0);
      CHECK(channel.relative() < (example.is_linear ? 1e-12 : 1e-9));
    }
  }
}

TEST_CASE("the direct kernel matches the textbook simulator for all other laws and initial states",
          "[direct]") {
  // Damped plucks, smooth bows, thresholds, oscillators, unequal masses, speeds at the start.
  const Network network = network_of(
      "@k param 0.05\n@g ground 0.3\n@in1 posInput 0.5\n@in2 frcInput @o\n"
      "@o osc 2. 0.02 0.001 1. -500.\n@a mass 1.5 0.1 20.\n@b mass 0.7 0. 0.\n"
      "@s springDamper @a @g k 0.002\n@t spring @b @g k*0.8\n@d damper @o @b 0.003\n"
      "@p nlPluck @in1 @a 0.05 0.2 0.01\n@w nlBow @in1 @b 0.1 0.01 1\n"
      "@v nlBow @b @a 0.05 0.02\n@c contact @o @a 0.02 0.01 0.5\n"
      "@out1 posOutput @a\n@out2 posOutput @b\n@out3 posOutput @o\n@out5 posOutput @g\n");
  REQUIRE(network.third == ThirdArgument::velocity_per_second);
  auto oracle = reference::make_simulation(network, parameter_values(network));
  Bare<double> bare(make_program(network, 44100.0, true));
  const support::Motion hand(41, 0.5, 30.0);
  const support::Motion force(42, 20.0, 2000.0);
  std::vector<Comparison> channels(5);
  for (std::size_t n = 0; n < second; ++n) {
    const std::vector<double> inputs = {0.5 + 0.5 * hand(n), 0.1 * force(n)};
    const auto expected = oracle.simulator.step(inputs);
    const auto found = bare.step(inputs);
    for (std::size_t c = 0; c < channels.size(); ++c) {
      channels[c].add(expected[c], found[c]);
    }
  }
  for (const std::size_t c : {0u, 1u, 2u}) {
    INFO("output " << c + 1 << ": residual " << show(channels[c].relative()));
    CHECK(channels[c].peak > 0.1);
    CHECK(channels[c].relative() < 1e-9);
  }
  CHECK(channels[3].peak == 0.0);  // a channel without an output
  CHECK(channels[3].worst == 0.0);
  CHECK(channels[4].peak == 0.3);
  CHECK(channels[4].worst == 0.0);
}

TEST_CASE(
    "nonlinear springs, clipped contacts, gravity and force outputs match the textbook simulator",
    "[direct]") {
  // Both meanings of gravity, a limiter that clips in both directions, and reaction forces at a
  // position input and at a ground.
  for (const char* const text :
       {"@g ground 0.\n@in1 posInput 0.\n@in2 frcInput @a\n@a mass 1. 0.3 0.3\n"
        "@b massG 2. 0.00001 0. 0.\n@c osc 1. 0.01 0.001 0. 0. drawing 1. 2.\n"
        "@q nlSpring2 @a @g 0.02 0.05 0.002\n@k nlSpring3 @b @g 0.01 0.2 0.003\n"
        "@h springDamper @in1 @c 0.02 0.01\n@l nlSpring @a @b 0.01 0.03 0.001\n"
        "@out1 posOutput @a\n@out2 posOutput @b\n@out3 frcOutput @g\n@out4 frcOutput @in1\n"
        "@out5 frcOutput @a\n",
        "@g ground 0.\n@in1 posInput 1.\n@in2 frcInput @b\n@a mass 1. 0.5 [0. 0. 0.3] 0.\n"
        "@b osc 1. 0.01 0.002 0.2 0. 0.\n@s nlSpringDamper @a @g .01 .02 .03 .002\n"
        "@t nlSpringDamper @b @a .02 0. .1 .001\n@u nlContact @b @in1 .001 .05 .04 .002 .3\n"
        "@v nlContact @g @b .05 .1 .02 .001\n@out1 posOutput @a\n@out2 posOutput @b\n"
        "@out3 frcOutput @in1\n@out4 frcOutput @b\n@out5 frcOutput @g\n"}) {
    const Network network = network_of(text);
    auto oracle = reference::make_simulation(network, parameter_values(network));
    Bare<double> bare(make_program(network, 44100.0, true));
    const support::Motion hand(51, 0.5, 30.0);
    const support::Motion force(52, 20.0, 2000.0);
    std::vector<Comparison> channels(5);
    // Impacts are chaotic: later even the results in double differ.
    for (std::size_t n = 0; n < 2000; ++n) {
      const double rest = network.masses[1].position;
      const std::vector<double> inputs = {rest + 0.8 * hand(n), 0.02 * force(n)};
      const auto expected = oracle.simulator.step(inputs);
      const auto found = bare.step(inputs);
      for (std::size_t c = 0; c < channels.size(); ++c) {
        channels[c].add(expected[c], found[c]);
      }
    }
    for (std::size_t c = 0; c < channels.size(); ++c) {
      INFO("output " << c + 1 << ": residual " << show(channels[c].relative()));
      CHECK(channels[c].peak > 0.0);
      CHECK(channels[c].relative() < 1e-11);
    }
  }
}

TEST_CASE("a clipped spring is continuous at its clip", "[direct]") {
  // b = sqrt((k - s)/c) = sqrt(0.49/10) = 0.2213594: the force on both sides, by hand.
  const auto force = [](double d) {
    const laws::ClippedSpring<V> spring{lanes(0.01), lanes(10.0), lanes(0.5), V{}};
    return spring.force(lanes(d), V{})[0];
  };
  const double b = std::sqrt(0.049);
  CHECK(force(0.2) == Approx(0.01 * 0.2 + 10.0 * 0.008).epsilon(1e-14));
  CHECK(force(b - 1e-9) == Approx(0.5 * b).epsilon(1e-7));
  CHECK(force(b + 1e-9) == Approx(0.5 * b).epsilon(1e-7));
  CHECK(force(-1.0) == Approx(-0.5).epsilon(1e-14));
}

TEST_CASE("single precision keeps 90 dB over a second in linear networks", "[direct]") {
  for (const Example& example : scenes::nine_instruments()) {
    if (!example.is_linear) {
      continue;
    }
    const Network network = network_of(example.text);
    Bare<double> fine(make_program(network, 44100.0, true));
    Bare<float> coarse(make_program(network, 44100.0, true));
    Hands hands(network, example, 1);
    std::vector<Comparison> channels(fine.program().outputs.size());
    for (std::size_t n = 0; n < second; ++n) {
      const auto& inputs = hands.at(n);
      const auto expected = fine.step(inputs);
      const auto found = coarse.step(inputs);
      for (std::size_t c = 0; c < channels.size(); ++c) {
        channels[c].add(expected[c], found[c]);
      }
    }
    for (const Comparison& channel : channels) {
      INFO(example.name << ": " << channel.snr_db() << " dB");
      CHECK(channel.snr_db() >= 90.0);
    }
  }
}

TEST_CASE("voices in neighbouring lanes do not affect each other", "[direct]") {
  for (const Example& example : scenes::nine_instruments()) {
    CAPTURE(example.name);
    const Network network = network_of(example.text);
    Bare<double> both(make_program(network, 44100.0, true));
    Bare<double> alone[] = {Bare<double>(both.program()), Bare<double>(both.program())};
    Hands hands[] = {Hands(network, example, 1), Hands(network, example, 77)};
    bool differ = false;
    for (std::size_t n = 0; n < 1000; ++n) {
      std::vector<double> expected[2];
      for (std::size_t lane = 0; lane < 2; ++lane) {
        const auto& inputs = hands[lane].at(n);
        expected[lane] = alone[lane].step(inputs);
        for (std::size_t i = 0; i < inputs.size(); ++i) {
          both.feed(lane, i, inputs[i]);
        }
      }
      both.run(0);
      REQUIRE(both.outputs(0) == expected[0]);
      REQUIRE(both.outputs(1) == expected[1]);
      differ |= expected[0] != expected[1];
    }
    CHECK((differ || example.moving > 100));  // The end of a long string may not have moved yet.
  }
}

// --- golden values of the published laws --------------------------------------------------------

namespace {

struct Golden {
  std::size_t n;
  const char* printed;
};

// Returns half a unit of the last printed digit.
double half_a_digit(std::string_view printed) {
  const std::size_t exponent = std::min(printed.find('e'), printed.size());
  const std::size_t point = std::min(printed.find('.'), exponent);
  const auto decimals = static_cast<double>(exponent - std::min(point + 1, exponent));
  const double power =
      exponent < printed.size() ? std::stod(std::string(printed.substr(exponent + 1))) : 0.0;
  return 0.5 * std::pow(10.0, power - decimals);
}

// Runs a one-input scene and compares channel `c` times `gain` in every printed digit.
template <class Input>
void check_golden(const std::string& text, std::size_t c, double gain, Input&& input,
                  std::initializer_list<Golden> values) {
  const Network network = network_of(text);
  Bare<double> bare(make_program(network, 44100.0, true));
  std::size_t n = 0;
  for (const Golden& golden : values) {
    std::vector<double> out;
    for (; n <= golden.n; ++n) {
      out = bare.step({input(n)});
    }
    INFO("y[" << golden.n << "] = " << show(out[c] * gain) << ", printed " << golden.printed);
    CHECK(std::fabs(out[c] * gain - std::stod(golden.printed)) <
          half_a_digit(golden.printed) * (1 + 1e-6));
  }
}

double impulse(std::size_t n) {
  return n == 0 ? 0.1 : 0.0;
}

}  // namespace

// Laws may use multiply-adds in the loops of other kernels.
TEMPLATE_TEST_CASE("passive links have the same bits with every instruction set", "[direct]",
                   double, float) {
  for (const char* link : {"contact @in1 @m 0.9 0.01", "nlContact @in1 @m 0.1 20. 3. 0.01 0.005",
                           "nlSpring3 @in1 @m 0.01 5. 0.", "nlPluck @in1 @m 0.4 0.01",
                           "nlBow @in1 @m 0.3 0.01", "nlSpring @in1 @m 0.01 2. 0.001"}) {
    CAPTURE(link);
    const Program program = support::program_of(
        "@g ground 0.\n@m mass 1.1 0. 0.\n@s springDamper @g @m 0.03 0.001\n@in1 posInput 0.\n@l " +
            std::string(link) + "\n@out1 posOutput @m\n",
        Passivity::always);
    // Played with 16 voices, so that packs have their full width.
    const auto played = [&](Isa isa) {
      const auto kernel = make_kernel<TestType>(program, 16, isa);
      const std::size_t width = kernel->width();
      for (std::uint32_t c = 0; c < program.coefficients.size(); ++c) {
        for (std::size_t lane = 0; lane < width; ++lane) {
          kernel->coefficients.set(
              lane, c, coefficient_value(program, program.coefficients[c], program.parameters, 1.0),
              false);
        }
      }
      Aligned<TestType> value(max_block_frames * width);
      Aligned<TestType> velocity(value.size());
      Aligned<TestType> outputs(value.size());
      for (std::size_t i = 0; i < value.size(); ++i) {
        const double turn = 0.3 * static_cast<double>(i / width);
        value[i] = static_cast<TestType>(0.02 * std::sin(turn));
        velocity[i] = static_cast<TestType>(0.006 * std::cos(turn));
      }
      std::vector<TestType> heard;
      for (int block = 0; block < 20; ++block) {
        kernel->step({.frames = max_block_frames,
                      .value = value.data(),
                      .velocity = velocity.data(),
                      .audio = nullptr,
                      .outputs = outputs.data()});
        for (std::size_t n = 0; n < max_block_frames; ++n) {
          heard.push_back(outputs[n * width]);
        }
      }
      return heard;
    };
    const std::vector<TestType> base = played(Isa::base);
    CHECK(*std::max_element(base.begin(), base.end()) > 1e-3);
    for (const Isa isa : support::isas()) {
      CAPTURE(isa_name(isa));
      CHECK(played(isa) == base);
    }
  }
}

TEST_CASE("golden values of appendix A, current laws", "[direct]") {
  check_golden(scenes::poly_triangle("0.0001"), 0, 0.5, impulse,
               {{0, "0.000000000"},
                {1, ".005005"},
                {2, ".018511999"},
                {3, ".041436285"},
                {4, ".07176335"},
                {10, "0.155141067"},
                {50, "-0.0147254664"},
                {100, "-0.00255296694"},
                {500, "-0.122221384"},
                {1000, "-0.0215601488"},
                {1999, "0.0190004315"}});
  check_golden(scenes::physical_lfo(), 0, 0.1, impulse,
               {{10, "5.71300381e-5"},
                {50, "0.00148543615"},
                {100, "0.00666381924"},
                {500, "0.297542289"},
                {1000, "1.55014677"},
                {1999, "5.0586694"}});
  check_golden(scenes::resonator(), 0, 10.0, [](std::size_t n) { return n == 0 ? 1.0 : 0.0; },
               {{10, "0.000000000"},
                {50, "0.190713507"},
                {100, "-0.110236012"},
                {500, "0.11196581"},
                {1000, "-0.0625427952"},
                {1999, "-0.140598832"}});
  check_golden(scenes::iplay_the_triangle(), 0, 50.0,
               [](std::size_t n) { return 0.0005 * static_cast<double>(n) - 0.05; },
               {{10, "0.000000000"},
                {50, "0.000000000"},
                {100, "0.0396658493"},
                {500, "-0.00264249204"},
                {1000, "-0.0257241709"},
                {1999, "0.00658646672"}});
  const auto draw = [](std::size_t n) { return 1.0 + 2e-5 * static_cast<double>(n); };
  check_golden(scenes::bowed_string(), 0, 200.0, draw,
               {{200, "0.00176033512"},
                {500, "3.79666878e-6"},
                {1000, "1.93920418e-5"},
                {2000, "0.00222590725"}});
  check_golden(scenes::bowed_string(), 1, 200.0, draw,
               {{200, "0.00442131741"},
                {500, "-1.28619177e-5"},
                {1000, "1.57433644e-5"},
                {2000, "0.00518850612"}});
}

// --- sample values, from an independent simulation ----------------------------------------------

namespace {

// Initial state: x[-1] = -0.01 at one mass, and all others at rest at 0. The first output is x[0].
std::string kicked(std::string text, const std::string& mass) {
  const std::size_t start = text.find("@" + mass + " mass");
  const std::size_t end = text.find('\n', start);
  return text.replace(start, end - start, "@" + mass + " mass 1. -0.01 -0.02");
}

// The index and the value of a sample in the tables, compared to 1e-12 of the largest sample so
// far.
struct Sample {
  std::size_t n;
  std::size_t channel;
  double value;
};

void check_samples(const std::string& text, std::initializer_list<Sample> samples) {
  Bare<double> bare(make_program(network_of(text), 44100.0, true));
  std::vector<double> out;
  std::size_t n = 0;
  double peak = 0.0;
  for (const Sample& sample : samples) {
    for (; n <= sample.n; ++n) {
      out = bare.step({});
      peak = std::max(peak, std::fabs(out[0]));
    }
    const double residual = std::fabs(out[sample.channel] - sample.value) / peak;
    INFO("x[" << sample.n << "]: residual " << show(residual));
    CHECK(residual < 1e-12);
  }
}

}  // namespace

TEST_CASE("impulse values of the triangle and of the string of 50", "[direct]") {
  check_samples(kicked(scenes::triangle("0.1", "0.001"), "m_m1") + scenes::output(1, "m_m2") +
                    scenes::output(2, "m_m0"),
                {{1, 0, 1.0e-5},
                 {2, 0, 1.02697e-3},
                 {3, 0, 3.74273749e-3},
                 {10, 0, 3.327901367135756860e-2},
                 {10, 1, 2.585519636043072655e-2},
                 {100, 0, -6.146288135654975593e-4},
                 {1000, 0, 9.342194981256161346e-5},
                 {1000, 1, 1.461510923604795940e-3},
                 {4410, 0, -5.578939292084521831e-5}});
  check_samples(
      kicked(scenes::string("s", 50, "0.1", "0.001"), "s_m13") + scenes::output(1, "s_m37"),
      {{100, 0, 1.670305064242014102e-2},
       {1000, 0, 3.612944804382895155e-4},
       {10000, 0, -1.872396256509359642e-5},
       {44100, 0, -1.721404002942093605e-2}});
}

}  // namespace ressort::direct_test
