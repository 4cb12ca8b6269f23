// Bodies: modes given by frequency and decay, and places that move by weights of all modes.

#include <complex>
#include <numbers>

#include "core/analysis/modes/tune.h"
#include "core/analysis/stability.h"
#include "core/compile/stability_check.h"
#include "core/engine/energy.h"
#include "core/kernels/modal/modal_form.h"
#include "core/model/language/expression.h"
#include "core/sampled_mode.h"
#include "tests/support/dense.h"
#include "tests/support/networks/reference_network.h"
#include "tests/support/passive.h"

namespace ressort::bodies_test {
namespace {

using namespace support;

constexpr double pi = std::numbers::pi;

std::string digits(double value) {
  return print_number(value);
}

// Estimates the pole of a single mode from samples: x'' = a x' - b x, by least squares over every
// `stride`th sample.
std::complex<double> pole_of(const std::vector<double>& x, std::size_t stride) {
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (std::size_t n = 2 * stride; n < x.size(); ++n) {
    const Eigen::Vector2d row(x[n - stride], x[n - 2 * stride]);
    normal += row * row.transpose();
    right += row * x[n];
  }
  const Eigen::Vector2d found =
      support::least_squares(Eigen::MatrixXd(normal), Eigen::MatrixXd(right));
  const std::complex<double> root =
      std::sqrt(std::complex<double>(0.25 * found[0] * found[0] + found[1]));
  return std::pow(0.5 * found[0] + root, 1.0 / static_cast<double>(stride));
}

std::vector<double> struck(const std::string& text, double rate_hz, std::size_t frames,
                           const Form& form = Form()) {
  Program program = make_program(network_of(text), rate_hz, true);
  program.form = form;
  Bare<double> bare(program);
  std::vector<double> sound;
  for (std::size_t n = 0; n < frames; ++n) {
    sound.push_back(bare.step({n == 0 ? 1.0 : 0.0})[0]);
  }
  return sound;
}

}  // namespace

TEST_CASE("a mode has its frequency and its T60 at every rate", "[bodies]") {
  for (const double rate_hz : {22050.0, 44100.0, 48000.0, 96000.0}) {
    for (const double hz : {20.0, 310.7, 4186.0, 9000.0}) {
      for (const double t60_s : {0.05, 1.0, 20.0}) {
        const std::string text = "@b body 3. p\n@b1 mode @b " + digits(hz) + " " + digits(t60_s) +
                                 " 0.5\n@in1 frcInput [@b p]\n@out1 posOutput [@b p]\n";
        INFO(hz << " Hz, " << t60_s << " s at " << rate_hz);
        const auto stride = static_cast<std::size_t>(std::max(1.0, rate_hz / (8.0 * hz)));
        const std::complex<double> pole = pole_of(struck(text, rate_hz, 8000), stride);
        CHECK(std::fabs(std::arg(pole)) * rate_hz / (2.0 * pi) == Approx(hz).epsilon(1e-7));
        CHECK(std::abs(pole) == Approx(std::pow(10.0, -3.0 / (rate_hz * t60_s))).epsilon(1e-9));
      }
    }
  }
}

TEST_CASE("a T60 parameter sets a mode's decay with exact modes at any pitch", "[bodies]") {
  // Two modes. The second one's T60 is `ring` times 0.5 s, and changes from 0.5 s to 1.5 s. K = M
  // (w^2 + s^2) with s = ln 1000/T60, so a factor of 9 on it triples the frequency.
  const std::string text =
      "@ring param 1.\n@b body 2. p q\n@b1 mode @b 400. 2. 1. 0.\n"
      "@b2 mode @b 1100. 0.5*ring 0. 1.\n@in1 frcInput [@b q]\n@out1 posOutput [@b q]\n";
  Program program = make_program(network_of(text), 48000.0, true);
  const auto modes = modal_form(program, {}, {}, false, true);
  REQUIRE(modes);
  program.form = *modes;
  for (const double factor : {1.0, 9.0}) {
    for (const double ring : {1.0, 3.0}) {
      INFO("ring " << ring << ", stiffness times " << factor);
      Bare<double> bare(program);
      bare.set_coefficients(0, {ring}, factor, false);
      std::vector<double> sound;
      for (std::size_t n = 0; n < 8000; ++n) {
        sound.push_back(bare.step({n == 0 ? 1.0 : 0.0})[0]);
      }
      const std::complex<double> pole = pole_of(sound, 4);
      const double s = std::log(1000.0) / (0.5 * ring) / (2.0 * pi);
      CHECK(std::fabs(std::arg(pole)) * 48000.0 / (2.0 * pi) ==
            Approx(std::sqrt(factor * (1100.0 * 1100.0 + s * s) - s * s)).epsilon(1e-9));
      CHECK(std::abs(pole) == Approx(std::pow(10.0, -3.0 / (48000.0 * 0.5 * ring))).epsilon(1e-9));
    }
  }
}

TEST_CASE("a mode's first sample equals its weights times the force", "[bodies]") {
  // A unit force at a place of weight 0.5 moves a mode of mass 4 by 0.5/4, and a place of weight -2
  // by -2 times that.
  const std::string text =
      "@b body 4. hit heard\n@b1 mode @b 500. 1. 0.5 -2.\n@in1 frcInput [@b hit]\n"
      "@out1 posOutput [@b heard]\n";
  CHECK(struck(text, 44100.0, 1)[0] == Approx(-0.25).epsilon(1e-14));
}

TEST_CASE("an overdamped mode has two real poles at any decay time", "[bodies]") {
  // x'' + z x' + k x = 0 has the poles e^-(z/2 -+ sqrt(z^2/4 - k)); (1 - p)(1 - q) = K, 1 - p q =
  // Z.
  for (const double z : {0.1, 3.0, 800.0, 1600.0, 1e4, 1e9}) {
    for (const double k : {1e-6 * z * z, 0.2 * z * z}) {
      const double root = std::sqrt(0.25 * z * z - k);
      const double p = -k / (0.5 * z + root);
      const SampledMode mode = sampled_mode(2.0, k, z);
      CHECK(mode.mass == 2.0);
      CHECK(mode.stiffness ==
            Approx(2.0 * std::expm1(p) * std::expm1(-0.5 * z - root)).epsilon(1e-12));
      CHECK(mode.damping == Approx(-2.0 * std::expm1(-z)).epsilon(1e-12));
    }
  }
}

TEST_CASE("a mode above the Nyquist frequency responds with its static compliance", "[bodies]") {
  // k = (2 pi 30000 / 44100)^2 per sample and unit mass.
  const std::string text =
      "@b body 2. p\n@b1 mode @b 30000. 1. 0.5\n@in1 frcInput [@b p]\n@out1 posOutput [@b p]\n";
  const double alpha = 3.0 * std::numbers::ln10 / 44100.0;
  const double omega = 2.0 * pi * 30000.0 / 44100.0;
  const std::vector<double> sound = struck(text, 44100.0, 4);
  CHECK(sound[0] == Approx(0.25 / (2.0 * (omega * omega + alpha * alpha))).epsilon(1e-12));
  CHECK(std::fabs(sound[1]) < 1e-15);
  CHECK(std::fabs(sound[2]) < 1e-15);
}

TEST_CASE("the reference simulator plays bodies alike", "[bodies]") {
  const std::string text = R"(
    @tune param 1.1
    @at param 0.3
    @bell body 6. rim waist crown
    @b1 mode @bell 310.7*tune 0.4  1.00 -0.61 0.02
    @b2 mode @bell 601.2*tune 0.3  0.80  0.35 0.90
    @b3 mode @bell 5200. 0.1*tune  -0.3  0.5 0.7
    @hammer mass 2. 0. 0.
    @s stiffString 12 1. 0.1 0.02 0.001 0. 0.
    @hit contact [@bell rim] @hammer 0.05 0.01 0.001
    @tie springDamper [@bell waist] [@s 0.3] 0.03 0.002
    @up springDamper [@bell at] [@s 0.8] 0.02 0.001
    @in1 frcInput @hammer
    @in2 frcInput [@bell at]
    @out1 posOutput [@bell crown]
    @out2 posOutput [@bell at]
    @out3 posOutput @hammer
    @out4 frcOutput [@bell rim]
    )";
  const Network network = network_of(text);
  reference::Simulation simulation = reference::make_simulation(network, parameter_values(network));
  const Program program = make_program(network, 44100.0, true);
  Bare<double> bare(program);
  Random random(7);
  double worst = 0.0;
  double loudest = 0.0;
  for (int n = 0; n < 20000; ++n) {
    const std::vector<double> inputs = {n < 400 ? random.uniform(-1e-3, 1e-3) : 0.0,
                                        n % 3000 == 0 ? 0.01 : 0.0};
    const std::vector<double> found = bare.step(inputs);
    const std::vector<double> wanted = simulation.simulator.step(inputs);
    for (std::size_t i = 0; i < found.size(); ++i) {
      worst = std::max(worst, std::fabs(found[i] - wanted[i]));
      loudest = std::max(loudest, std::fabs(found[i]));
    }
  }
  CHECK(loudest > 1e-3);
  CHECK(worst < 1e-11 * loudest);
}

// A string of n unit masses between walls as a body: its mode shapes are sines, and the scheme's
// poles for K and Z give frequency and decay.
TEST_CASE("a string and its own modes sound alike under a hammer", "[bodies]") {
  constexpr int n = 12;
  constexpr double k = 0.3;
  constexpr double z = 0.002;
  std::string string = "@s string " + std::to_string(n + 2) + " 1. 0.3 0.002 0. 0.\n";
  std::string body = "@s body 1. a b\n";
  for (int j = 1; j <= n; ++j) {
    const double angle = pi * j / (n + 1);
    const double square = 2.0 - 2.0 * std::cos(angle);
    const double r = std::sqrt(1.0 - z * square);
    const double w = std::acos((2.0 - (k + z) * square) / (2.0 * r));
    const auto shape = [&](int mass) { return std::sqrt(2.0 / (n + 1)) * std::sin(angle * mass); };
    body += "@m" + std::to_string(j) + " mode @s " + digits(w * 44100.0 / (2.0 * pi)) + " " +
            digits(-3.0 / (44100.0 * std::log10(r))) + " " + digits(shape(4)) + " " +
            digits(shape(9)) + "\n";
  }
  const auto rest = [](const std::string& a, const std::string& b) {
    return "@h mass 2. 0.5 -4410.\n@hit contact " + b + " @h 0.02 0.001\n@out1 posOutput " + a +
           "\n@out2 posOutput @h\n";
  };
  // The string's fourth mass is at 4/13 of its length.
  const std::string a4 = "[@s " + digits(4.0 / (n + 1)) + "]";
  const std::string a9 = "[@s " + digits(9.0 / (n + 1)) + "]";
  Bare<double> masses(make_program(network_of(string + rest(a4, a9)), 44100.0, true));
  Bare<double> modes(make_program(network_of(body + rest("[@s a]", "[@s b]")), 44100.0, true));
  double worst = 0.0;
  double loudest = 0.0;
  for (int i = 0; i < 6000; ++i) {
    const std::vector<double> one = masses.step({});
    const std::vector<double> other = modes.step({});
    worst = std::max({worst, std::fabs(one[0] - other[0]), std::fabs(one[1] - other[1])});
    loudest = std::max(loudest, std::fabs(one[0]));
  }
  CHECK(loudest > 0.1);
  CHECK(worst < 1e-10);
}

namespace {

// The step of a random hybrid as a matrix, from its definition and without the project's code:
// masses, springs and dampers between masses, places and walls, all scaled by a factor.
struct Hybrid {
  explicit Hybrid(std::uint64_t seed) {
    Random random(seed);
    const std::size_t masses = 1 + random.below(4);
    const std::size_t modes = 1 + random.below(6);
    const std::size_t places = 1 + random.below(3);
    const double body_mass = random.uniform(0.5, 20.0);
    head = "@g ground 0.\n@b body " + digits(body_mass);
    for (std::size_t p = 0; p < places; ++p) {
      head += " p" + std::to_string(p);
    }
    head += "\n";
    size = static_cast<Eigen::Index>(masses + modes);
    mass = Eigen::VectorXd(size);
    own_k = Eigen::VectorXd::Zero(size);
    own_z = Eigen::VectorXd::Zero(size);
    Eigen::MatrixXd shape(places, modes);
    for (std::size_t m = 0; m < masses; ++m) {
      const auto row = static_cast<Eigen::Index>(m);
      mass[row] = random.uniform(0.5, 4.0);
      head += "@m" + std::to_string(m) + " mass " + digits(mass[row]) + " 0. 0.\n";
    }
    for (Eigen::Index j = 0; j < shape.cols(); ++j) {
      const double hz = random.uniform(30.0, 18000.0);
      const double t60_s = std::pow(10.0, random.uniform(-3.0, 1.0));
      head += "@b" + std::to_string(j) + " mode @b " + digits(hz) + " " + digits(t60_s);
      for (Eigen::Index p = 0; p < shape.rows(); ++p) {
        shape(p, j) = random.uniform(-1.0, 1.0);
        head += " " + digits(shape(p, j));
      }
      head += "\n";
      const auto row = static_cast<Eigen::Index>(masses) + j;
      const double r = std::pow(10.0, -3.0 / (44100.0 * t60_s));
      mass[row] = body_mass;
      own_z[row] = body_mass * (1.0 - r * r);
      own_k[row] = body_mass * (1.0 + r * r - 2.0 * r * std::cos(2.0 * pi * hz / 44100.0));
    }
    const auto end = [&](Eigen::VectorXd& row, double sign) -> std::string {
      const std::size_t which = random.below(masses + places + 1);
      if (which < masses) {
        row[static_cast<Eigen::Index>(which)] += sign;
        return "@m" + std::to_string(which);
      }
      if (which < masses + places) {
        row.tail(static_cast<Eigen::Index>(modes)) +=
            sign * shape.row(static_cast<Eigen::Index>(which - masses)).transpose();
        return "[@b p" + std::to_string(which - masses) + "]";
      }
      return "@g";
    };
    k = z = Eigen::MatrixXd::Zero(size, size);
    const std::size_t links = 1 + random.below(6);
    for (std::size_t l = 0; l < links; ++l) {
      Eigen::VectorXd row = Eigen::VectorXd::Zero(size);
      const std::string a = l == 0 ? "@m0" : end(row, 1.0);
      if (l == 0) {
        row[0] += 1.0;
      }
      std::string b = l == 0 ? "[@b p0]" : end(row, -1.0);
      if (l == 0) {
        row.tail(static_cast<Eigen::Index>(modes)) -= shape.row(0).transpose();
      }
      const double stiffness = std::pow(10.0, random.uniform(-2.0, 1.0));
      const double damping = random.below(2) == 0 ? 0.0 : random.uniform(0.0, 0.5) * stiffness;
      if (a == b) {
        continue;
      }
      k += stiffness * row * row.transpose();
      z += damping * row * row.transpose();
      links_.push_back({a + " " + b, stiffness, damping});
    }
  }

  std::string text(double factor) const {
    std::string all = head;
    for (std::size_t l = 0; l < links_.size(); ++l) {
      all += "@r" + std::to_string(l) + " springDamper " + links_[l].ends + " " +
             digits(factor * links_[l].k) + " " + digits(factor * links_[l].z) + "\n";
    }
    return all + "@in1 frcInput @m0\n@out1 posOutput @m0\n";
  }

  // 4M - K - 2Z
  double slack(double factor) const {
    Eigen::MatrixXd matrix = -factor * (k + 2.0 * z);
    matrix.diagonal() += 4.0 * mass - own_k - 2.0 * own_z;
    return support::eigenbasis_of(matrix).values.minCoeff();
  }
  double limit() const {
    double low = 0.0;
    double high = 1.0;
    while (slack(high) > 0.0 && high < 1e9) {
      high *= 2.0;
    }
    for (int i = 0; i < 100; ++i) {
      (slack(0.5 * (low + high)) > 0.0 ? low : high) = 0.5 * (low + high);
    }
    return low;
  }
  // Returns the largest root of the step v += -(K x + Z v)/M, x += v.
  double largest_root(double factor) const {
    Eigen::MatrixXd stiffness = factor * k;
    stiffness.diagonal() += own_k;
    Eigen::MatrixXd damping = factor * z;
    damping.diagonal() += own_z;
    const auto inverse = mass.cwiseInverse().asDiagonal();
    const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(size, size);
    Eigen::MatrixXd step(2 * size, 2 * size);
    step << one - inverse * stiffness, one - inverse * damping, -(inverse * stiffness),
        one - inverse * damping;
    return support::eigenvalues_of(step).cwiseAbs().maxCoeff();
  }

  struct Spring {
    std::string ends;
    double k;
    double z;
  };
  std::string head;
  std::vector<Spring> links_;
  Eigen::Index size = 0;
  Eigen::VectorXd mass;
  Eigen::VectorXd own_k;
  Eigen::VectorXd own_z;
  Eigen::MatrixXd k;
  Eigen::MatrixXd z;
};

// Tests hybrids 1 % below and above their limit; returns how many the proof misjudged.
int misjudged(std::uint64_t first, int count) {
  int wrong = 0;
  for (int i = 0; i < count; ++i) {
    const Hybrid hybrid(first + static_cast<std::uint64_t>(i));
    const double limit = hybrid.limit();
    for (const double share : {0.99, 1.01}) {
      const Network network = network_of(hybrid.text(share * limit));
      const auto values = parameter_values(network);
      const bool is_stable = Stability(network, 1.0).prove({values, values}) == Verdict::stable;
      const double root = hybrid.largest_root(share * limit);
      const bool grows = root > 1.0 + 1e-6;  // Free masses have a double root of 1.
      if (is_stable != (share < 1.0) || grows != (share > 1.0)) {
        WARN("seed " << first + static_cast<std::uint64_t>(i) << " at " << share
                     << " of its limit: root " << root);
        ++wrong;
      }
    }
  }
  return wrong;
}

}  // namespace

TEST_CASE("masses and bodies are stable exactly while 4M - K - 2Z is positive definite",
          "[bodies]") {
  CHECK(misjudged(1, 500) == 0);
}

TEST_CASE("the stability of 20,000 hybrids is decided correctly", "[.][bodies_everywhere]") {
  CHECK(misjudged(1'000'001, 20'000) == 0);
}

TEST_CASE("a body is tuned by its own lines", "[bodies]") {
  const Network network = network_of(
      "@b body 40. p\n@b1 mode @b 300. 1. 1.\n@in1 frcInput [@b p]\n@out1 posOutput [@b p]\n");
  const std::vector<double> wanted = {500.0};
  const auto tuned = tune_modes(network, parameter_values(network), wanted, {});
  REQUIRE_FALSE(tuned);
  CHECK(tuned.error().message == "'b' gets its frequencies from its own lines; change them there");
  CHECK(tuned.error().line == 1);
}

}  // namespace ressort::bodies_test
