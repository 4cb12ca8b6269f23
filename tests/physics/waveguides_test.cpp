// One waveguide, judged by its render: pitch and decay by an independent estimator, junctions by
// closed forms and by an equivalent string of masses.
#include <complex>

#include "core/kernels/waveguides/design.h"
#include "tests/support/passive.h"

namespace ressort::waveguides_test {
namespace {

using namespace support;
using Complex = std::complex<double>;

constexpr double turn = 2.0 * std::numbers::pi;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

Program program_at(const std::string& text, double rate_hz) {
  const Network network = expand_macros(network_of(text));
  return make_program(network, rate_hz, true, schemes_of(network, Passivity::always).links);
}

struct Partial {
  double hz = 0.0;
  double t60_s = 0.0;
};

// Measures the partial near a guess: two windows at different times give its frequency from the
// phase advance and its decay from the level; a Blackman-Harris window suppresses other partials by
// 92 dB.
Partial partial_of(std::span<const double> y, double rate_hz, double guess_hz, std::size_t window,
                   std::size_t later) {
  const auto seen = [&](std::size_t from) {
    Complex sum = 0.0;
    for (std::size_t n = 0; n < window; ++n) {
      const double t = turn * (static_cast<double>(n) + 0.5) / static_cast<double>(window);
      const double weight = 0.35875 - 0.48829 * std::cos(t) + 0.14128 * std::cos(2.0 * t) -
                            0.01168 * std::cos(3.0 * t);
      sum += weight * y[from + n] *
             std::polar(1.0, -turn * guess_hz / rate_hz * static_cast<double>(n));
    }
    return sum;
  };
  const Complex ratio = seen(later) / seen(0) *
                        std::polar(1.0, -turn * guess_hz / rate_hz * static_cast<double>(later));
  const double samples = static_cast<double>(later);
  return {guess_hz + std::arg(ratio) / turn * rate_hz / samples,
          -3.0 * std::numbers::ln10 * samples / rate_hz / std::log(std::abs(ratio))};
}

// The response of a place to a tap on another.
std::vector<double> rendered(const std::string& line, double rate_hz, std::size_t frames) {
  Bare<double> bare(
      program_at("@s " + line + "\n@in1 frcInput [@s 0.37]\n@out1 posOutput [@s 0.23]\n", rate_hz));
  std::vector<double> y;
  for (std::size_t n = 0; n < frames; ++n) {
    y.push_back(bare.step({n == 0 ? 1.0 : 0.0})[0]);
  }
  return y;
}

double key_hz(int key) {
  return 440.0 * std::exp2((key - 69) / 12.0);
}

// A kernel whose node states are accessible; moving nodes come first.
struct Watched : Bare<double> {
  explicit Watched(const std::string& text, double rate_hz = Network::reference_rate_hz)
      : Bare(program_at(text, rate_hz)) {}
  std::pair<double, double> node(std::uint32_t index) {
    std::vector<double> x(lanes());
    std::vector<double> v(lanes());
    const std::uint32_t one[] = {index};
    kernel().read(one, x.data(), v.data());
    return {x[0], v[0]};
  }
};

}  // namespace

TEST_CASE("88 keys of waveguides have the requested pitch and decay", "[waveguides]") {
  double worst_cents = 0.0;
  double worst_t60 = 0.0;
  int row = 0;
  for (const double rate : {44100.0, 48000.0, 96000.0}) {
    for (int key = 21; key <= 108; ++key) {
      const double hz = key_hz(key);
      const double t60 = std::array{0.4, 2.0, 8.0}[static_cast<std::size_t>(row % 3)];
      const double brightness = std::array{0.0, 0.3, 0.7, 1.0}[static_cast<std::size_t>(row % 4)];
      const bool is_open = row % 5 == 0;
      ++row;
      const auto window = static_cast<std::size_t>(rate * std::max(0.25, 14.0 / hz));
      const auto later = static_cast<std::size_t>(rate * std::max(0.3 * t60, 8.0 / hz));
      const auto y = rendered((is_open ? "openWaveguide 1.3 " : "waveguide 1.3 ") + number(hz) +
                                  " " + number(t60) + " " + number(brightness) + " 0.",
                              rate, window + later);
      // An open waveguide drifts by a step, which the difference removes.
      std::vector<double> speed(y.size());
      std::adjacent_difference(y.begin(), y.end(), speed.begin());
      const Partial found = partial_of(speed, rate, hz, window, later);
      const double cents = std::fabs(1200.0 * std::log2(found.hz / hz));
      const double off = std::fabs(found.t60_s / t60 - 1.0);
      worst_cents = std::max(worst_cents, cents);
      worst_t60 = std::max(worst_t60, off);
      INFO("key " << key << " at " << rate << " Hz, T60 " << t60 << ", brightness " << brightness
                  << ": " << cents << " cents, T60 " << 100.0 * off << " %");
      CHECK(cents < 0.02);
      CHECK(off < 0.005);
    }
  }
}

TEST_CASE("a waveguide's loop never gains energy and stays within its memory", "[waveguides]") {
  Random random(14);
  for (int i = 0; i < 4000; ++i) {
    const double rate = std::array{44100.0, 48000.0, 96000.0, 192000.0}[random.below(4)];
    const WaveguideNumbers numbers{.frequency_hz = std::exp(random.uniform(0.0, 10.5)),
                                   .t60_s = std::exp(random.uniform(-9.0, 9.0)),
                                   .brightness = random.uniform(-0.2, 1.2)};
    const auto least = static_cast<std::uint32_t>(4 + 2 * random.below(20));
    const WaveguideDesign found = design_waveguide(numbers, least, 16383, rate);
    REQUIRE(found.samples >= least);
    REQUIRE(found.samples <= 16383);
    REQUIRE(std::fabs(found.allpass) < 1.0);
    double most = 0.0;
    for (int k = 0; k <= 4096; ++k) {
      const Complex back = std::polar(1.0, -std::numbers::pi * k / 4096.0);
      most = std::max(most, std::abs(found.gain * (1.0 - found.pole) / (1.0 - found.pole * back)));
    }
    REQUIRE(most <= 1.0 + 1e-15);
    // Checks the loop's own pole, if the requested values are reachable.
    if (numbers.frequency_hz < 20.0 || numbers.frequency_hz > highest_waveguide_hz(least, rate) ||
        numbers.t60_s * numbers.frequency_hz < least_t60_periods) {
      continue;
    }
    const Complex back = std::polar(std::exp(3.0 * std::numbers::ln10 / (numbers.t60_s * rate)),
                                    -turn * numbers.frequency_hz / rate);
    const Complex loop = std::pow(back, static_cast<double>(found.samples)) *
                         (found.allpass + back) / (1.0 + found.allpass * back) * found.gain *
                         (1.0 - found.pole) / (1.0 - found.pole * back);
    INFO(numbers.frequency_hz << " Hz, T60 " << numbers.t60_s << ", brightness "
                              << numbers.brightness << ", rate " << rate);
    CHECK(std::abs(loop - 1.0) < 1e-8);
  }
}

TEST_CASE("a waveguide is a string of masses with K = M", "[waveguides]") {
  // 41 nodes, 40 samples from end to end; a place at 0.3 is the thirteenth node.
  const std::string hammer =
      "@h mass 3. -0.02 0.001\n@k powerContact @h #1 2. 1.8 0.01 0.\n@in1 frcInput #2\n"
      "@out1 posOutput #3\n";
  const auto with_places = [&](std::string text, const char* a, const char* b, const char* c) {
    text.replace(text.find("#1"), 2, a);
    text.replace(text.find("#2"), 2, b);
    return text.replace(text.find("#3"), 2, c);
  };
  Watched string("~motion velocity\n@s string 41 1.7 1.7 0. 0.\n" +
                 with_places(hammer, "[@s 0.3]", "[@s 0.7]", "[@s 0.55]"));
  Watched guide("~motion velocity\n@s waveguide 1.7 " + number(44100.0 / 80.0) + " 1e30 1. 0.\n" +
                with_places(hammer, "[@s 0.3]", "[@s 0.7]", "[@s 0.55]"));
  Random random(3);
  double before = 0.0;
  double most = 0.0;
  for (int n = 0; n < 5000; ++n) {
    const double force = n < 300 ? random.uniform(-1e-3, 1e-3) : 0.0;
    const double masses = string.step({force})[0];
    const double waves = guide.step({force})[0];
    REQUIRE(waves == Approx(0.5 * (masses + before)).margin(1e-12));
    before = masses;
    most = std::max(most, std::fabs(waves));
  }
  CHECK(most > 1e-3);
}

TEST_CASE("a mass on a spring reflects waves as its impedance says", "[waveguides]") {
  constexpr double rate = 192000.0;
  constexpr double r = Network::reference_rate_hz / rate;
  constexpr double impedance = 2.0 * r;
  constexpr double mass = 0.5;
  constexpr double stiffness = 5.0 * r * r;
  // 6,000 samples from end to end: the signal at 0.35 comes from the place at 0.5 only.
  Watched guide(
      "@s waveguide 2. 16. 1e30 1. 0.\n@m mass 0.5 0. 0.\n@k spring [@s 0.5] @m 5.\n"
      "@in1 frcInput [@s 0.25]\n@out1 posOutput [@s 0.35]\n",
      rate);
  const std::uint32_t seen = guide.program().outputs[0].node;
  std::vector<double> v;
  double before = 0.0;
  for (int n = 0; n < 3000; ++n) {
    guide.step({n == 0 ? 1.0 : 0.0});
    const double now = guide.node(seen).second;
    v.push_back(0.5 * (now + before));
    before = now;
  }
  // The pulse passes 600 samples after it was made and returns 1800 samples later.
  const auto spectrum = [&](int first, int last, double theta) {
    Complex sum = 0.0;
    for (int n = first; n < last; ++n) {
      sum += v[static_cast<std::size_t>(n)] * std::polar(1.0, -theta * n);
    }
    return sum;
  };
  for (const double theta : {0.003, 0.01, 0.03, 0.07, 0.2, 0.5, 1.1, 2.3}) {
    const Complex z = std::polar(1.0, theta);
    const Complex spring = stiffness * 0.5 * (z + 1.0 / z);
    const Complex inertia = mass * (z - 2.0 + 1.0 / z);
    const Complex load = 2.0 / (z - 1.0 / z) / (1.0 / spring + 1.0 / inertia);
    const Complex wanted = -load / (2.0 * impedance + load);
    const Complex found =
        spectrum(2300, 3000, theta) / spectrum(500, 700, theta) * std::polar(1.0, theta * 1800.0);
    INFO("angle " << theta << ": " << found << " instead of " << wanted);
    CHECK(std::abs(found - wanted) < 1e-6);
  }
}

TEST_CASE("even and odd samples do not decouple", "[waveguides]") {
  Bare<double> guide(program_at(
      "@s waveguide 1. 196. 5. 0.4 0.\n@h mass 4. 0. 0.\n@g ground 0.\n@z spring @g @h 0.001 0.01\n"
      "@k powerContact [@s 0.13] @h 0.5 1.5 0. 0.\n@b spring [@s 0.97] @g 0.3 0.01\n"
      "@in1 frcInput @h\n@out1 posOutput [@s 0.4]\n",
      44100.0));
  double peak = 0.0;
  double y = 0.0;
  double odd = 0.0;
  for (int n = 0; n < 60 * 44100; ++n) {
    y = guide.step({n < 50 ? -0.01 : 0.0})[0];
    peak = std::max(peak, std::fabs(y));
    if (n >= 60 * 44100 - 4096) {
      odd += (n % 2 == 0 ? y : -y) / 4096.0;
    }
  }
  CHECK(peak > 1e-3);
  CHECK(std::fabs(odd) < 1e-5 * peak);
}

TEST_CASE("voices of different lengths sound alike in lanes and alone", "[waveguides]") {
  const std::string text =
      "@f param 220.\n@u param 0.3\n@s waveguide 1. f 3. 0.5 0.\n@h mass 2. 0. 0.\n"
      "@k contact @h [@s u] 0.3 0.01\n@in1 frcInput @h\n@out1 posOutput [@s 0.8]\n";
  Bare<double> many(program_at(text, 48000.0), 4);
  for (std::size_t lane = 0; lane < many.lanes(); ++lane) {
    Bare<double> one(program_at(text, 48000.0));
    const std::vector<double> numbers = {110.0 + 97.3 * static_cast<double>(lane),
                                         0.2 + 0.1 * static_cast<double>(lane)};
    many.set_coefficients(lane, numbers, 1.0, false);
    one.set_coefficients(0, numbers, 1.0, false);
    many.kernel().reset(lane);
    for (std::size_t other = 0; other < many.lanes(); ++other) {
      many.kernel().reset(other);
    }
    for (int n = 0; n < 3000; ++n) {
      const double force = n < 60 ? 0.003 : 0.0;
      many.step({force});
      REQUIRE(many.outputs(lane) == one.step({force}));
    }
  }
}

TEST_CASE("a glide reaches its pitch without noise", "[waveguides]") {
  Bare<double> guide(
      program_at("@f param 220.\n@s waveguide 1. f 8. 0.2 0.\n@in1 frcInput [@s 0.41]\n"
                 "@out1 posOutput [@s 0.3]\n",
                 48000.0));
  std::vector<double> y;
  double most = 0.0;
  double before = 0.0;
  for (int n = 0; n < 72000; ++n) {
    if (n >= 4000 && n < 30000 && n % 64 == 0) {  // Sweeps by a fifth in half a second.
      const double way = static_cast<double>(n - 4000) / 26000.0;
      guide.set_coefficients(0, {220.0 * std::pow(1.5, way)}, 1.0, false);
    }
    if (n == 30016) {
      guide.set_coefficients(0, {330.0}, 1.0, false);
    }
    const double now = guide.step({n < 100 ? 1e-2 * std::sin(0.03 * n) : 0.0})[0];
    if (n > 200 && n < 4000) {
      most = std::max(most, std::fabs(now - before));
    }
    if (n >= 4000) {
      REQUIRE(std::fabs(now - before) < 1.2 * most);
    }
    before = now;
    if (n > 31000) {
      y.push_back(now);
    }
  }
  const Partial found = partial_of(y, 48000.0, 330.0, 20000, 20000);
  CHECK(std::fabs(1200.0 * std::log2(found.hz / 330.0)) < 0.02);
}

TEST_CASE("a waveguide stays bounded for any parameter values", "[waveguides]") {
  const std::string text =
      "@f param 220.\n@t param 3.\n@b param 0.5\n@u param 0.3\n@R param 1.\n"
      "@s waveguide R f t b 0.\n@h mass 2. 0. 0.\n@m mass 0.5 0. 0.\n@g ground 0.\n"
      "@k1 contact @h [@s u] 3. 0.01\n@k2 spring [@s 0.3] @m 20.\n@k3 nlPluck @g [@s u*u] 1. 0.1\n"
      "@k4 nlBow @in2 [@s 1-u] 0.3 0.01\n@k5 spring [@s 0.3001] [@s 0.3] 5.\n"
      "@in1 frcInput @h\n@in2 posInput 0.\n@out1 posOutput [@s 0.8]\n@out2 frcOutput [@s u]\n";
  constexpr double infinity = std::numeric_limits<double>::infinity();
  constexpr double nowhere = std::numeric_limits<double>::quiet_NaN();
  Random random(8);
  Bare<double> guide(program_at(text, 44100.0));
  double most = 0.0;
  for (int n = 0; n < 100000; ++n) {
    if (n % 517 == 0) {
      const double odd[] = {0.0, -1.0, 1e30, infinity, nowhere};
      const auto number = [&](double lowest, double highest) {
        return random.below(8) == 0 ? odd[random.below(5)] : random.uniform(lowest, highest);
      };
      guide.set_coefficients(0,
                             {number(20.0, 4000.0), number(0.01, 9.0), number(0.0, 1.0),
                              number(0.0, 1.0), random.uniform(0.3, 3.0)},
                             1.0, false);
    }
    const double y = guide.step({1e-3 * std::sin(0.01 * n), 1e-2 * std::sin(0.0007 * n)})[0];
    REQUIRE(std::isfinite(y));
    most = std::max(most, std::fabs(y));
  }
  CHECK(most < 100.0);
}

TEST_CASE("twenty places on a short waveguide occupy distinct samples", "[waveguides]") {
  std::string text = "@s waveguide 1. 980. 1e30 1. 0.\n";
  for (int i = 0; i < 20; ++i) {
    const std::string n = std::to_string(i);
    text += "@m" + n + " mass 1. 0. 0.\n@k" + n + " spring @m" + n + " [@s " +
            number(0.45 + 0.002 * i) + "] 3.\n";
  }
  Bare<double> guide(program_at(text + "@in1 frcInput @m0\n@out1 posOutput [@s 0.5]\n", 44100.0));
  double early = 0.0;
  double late = 0.0;
  for (int n = 0; n < 200000; ++n) {
    const double y = guide.step({n < 50 ? 0.01 : 0.0})[0];
    double& most = n < 100000 ? early : late;
    most = std::max(most, std::fabs(y));
  }
  CHECK(late < 1.5 * early);
  CHECK(late > 0.3 * early);
}

// A loop of N samples has N(N-1)/2 pairs of places, with different shortest paths, across which
// samples must not be read as one block. Pitches, places and lanes are random.
TEMPLATE_TEST_CASE("block-wise processing of waves has the bits of sample-wise processing",
                   "[waveguides]", float, double) {
  const std::string text =
      "@f param 220.\n@t param 3.\n@b param 0.5\n@u param 0.3\n@w param 0.9\n"
      "@s waveguide 1.3 f t b 0.\n@o openWaveguide 0.7 1.5*f t b 0.\n@m mass 0.5 0. 0.\n"
      "@k1 spring [@s w] [@o 0.4] 0.4 0.01\n@k2 contact @m [@s u] 3. 0.01\n"
      "@k3 nlPluck @in2 [@o u*w] 1. 0.1\n"
      "@in1 frcInput [@s 0.37]\n@in2 posInput 0.\n@in3 frcInput @m\n"
      "@out1 posOutput [@s 0.81]\n@out2 posOutput [@o u]\n@out3 frcOutput [@s u]\n";
  Random random(20);
  for (const Isa isa : {Isa::base, best_isa()}) {
    for (const std::size_t voices : {1u, 16u}) {
      const Program program = program_at(text, 44100.0);
      const auto at_once = make_kernel<TestType>(program, voices, isa);
      const auto one_by_one = make_kernel<TestType>(program, voices, isa);
      const std::size_t width = at_once->width();
      const std::size_t inputs = program.inputs.size() * width;
      const std::size_t outputs = program.outputs.size() * width;
      Aligned<TestType> value(max_block_frames * inputs);
      Aligned<TestType> velocity(value.size());
      Aligned<TestType> heard(max_block_frames * outputs);
      Aligned<TestType> expected(heard.size());
      bool sounds = false;
      for (int block = 0; block < 400; ++block) {
        for (std::size_t lane = 0; block % 9 == 0 && lane < width; ++lane) {
          const double hz = 40.0 * std::exp2(random.uniform(0.0, 7.0));
          const std::vector<double> parameters{hz, random.uniform(0.1, 9.0),
                                               random.uniform(0.0, 1.0), random.uniform(0.0, 1.0),
                                               random.uniform(0.0, 1.0)};
          for (std::uint32_t c = 0; c < program.coefficients.size(); ++c) {
            const double number =
                coefficient_value(program, program.coefficients[c], parameters, 1.0);
            at_once->coefficients.set(lane, c, number, false);
            one_by_one->coefficients.set(lane, c, number, false);
          }
        }
        for (TestType& number : value) {
          number = static_cast<TestType>(random.uniform(-1e-2, 1e-2));
        }
        const std::size_t frames = 1 + random.below(max_block_frames);
        at_once->step({.frames = frames,
                       .value = value.data(),
                       .velocity = velocity.data(),
                       .outputs = heard.data()});
        for (std::size_t n = 0; n < frames; ++n) {
          one_by_one->step({.frames = 1,
                            .value = value.data() + n * inputs,
                            .velocity = velocity.data() + n * inputs,
                            .outputs = expected.data() + n * outputs});
        }
        for (std::size_t i = 0; i < frames * outputs; ++i) {
          INFO("block " << block << ", number " << i << " of " << width << " lanes");
          REQUIRE(heard[i] == expected[i]);
          sounds = sounds || std::fabs(heard[i]) > TestType(1e-3);
        }
      }
      CHECK(sounds);
    }
  }
}

}  // namespace ressort::waveguides_test
