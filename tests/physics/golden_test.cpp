// Poles and samples of a few networks, computed independently to many digits. A change here changes
// the sound of every model.
#include "core/analysis/linear.h"
#include "tests/support/poles.h"

namespace ressort::golden_test {
namespace {

using support::Bare;
using support::Pole;
using support::program_of;
using support::show;

constexpr double rate_hz = Network::reference_rate_hz;

void check(double found, double golden, double relative) {
  INFO("found " << show(found) << ", golden " << show(golden) << ", off by "
                << show(found / golden - 1.0));
  CHECK(std::fabs(found / golden - 1.0) <= relative);
}

std::string oscillator(const std::string& stiffness, const std::string& damping) {
  return "@m osc 1. " + stiffness + " " + damping + " 0. 0.\n" + scenes::output(1, "m");
}

std::string string50() {
  return scenes::string("s", 50, "0.1", "0.001") + scenes::output(1, "s_m37");
}

// Returns a mode's pole in the published scheme.
Pole published(double stiffness, double damping) {
  const double cosine = (2.0 - stiffness - damping) / (2.0 * std::sqrt(1.0 - damping));
  return support::pole_of(std::polar(std::sqrt(1.0 - damping), std::acos(cosine)));
}

struct Spectrum {
  Eigen::VectorXd stiffness;
  Eigen::VectorXd damping;
};

// For proportional damping and equal masses; the slowest mode first.
Spectrum modes_of(const Program& program) {
  const support::Matrices matrices = support::matrices_of(program);
  const support::Eigenbasis modes = support::eigenbasis_of(matrices.stiffness);
  const Eigen::MatrixXd& shapes = modes.vectors;
  return {
      .stiffness = modes.values / matrices.mass(0),
      .damping = (shapes.transpose() * matrices.damping * shapes).diagonal() / matrices.mass(0)};
}

// Returns the outputs, [n] after n samples, of a network whose mass `node` was at -0.01 one sample
// ago and is now at 0 like all others.
std::vector<double> impulse(Program program, std::uint32_t node, std::size_t frames) {
  program.position[node] = -0.01;
  program.velocity[node] = 0.01;
  Bare<double> bare(program, 1, Isa::base);
  std::vector<double> out;
  for (std::size_t n = 0; n <= frames; ++n) {
    out.push_back(bare.step({})[0]);
  }
  return out;
}

struct Sample {
  std::size_t n;
  double value;
};

}  // namespace

TEST_CASE("golden: an oscillator", "[golden]") {
  const Pole pole =
      support::poles_of(support::transition(program_of(oscillator("0.1", "0.001")))).at(0);
  check(pole.z.real(), 0.9495, 1e-12);
  check(pole.z.imag(), 0.31216942515243225, 1e-12);
  check(std::abs(pole.z), 0.99949987493746091, 1e-12);
  check(std::arg(pole.z), 0.317640143079315526, 1e-12);
  check(pole.hertz, 2229.431351291107, 1e-12);
  check(pole.t60_s, 0.31312021883938, 1e-11);
  const struct {
    const char* stiffness;
    const char* damping;
    double hertz;
    double continuous_hz;
  } others[] = {{"0.1", "0.001", 2229.431351291107, 2219.515479408327},
                {"0.1", "0.", 2228.87186149893, 2219.518253807878},
                {"1.", "0.", 7350.0, 7018.732990352584},
                {"2.", "0.", 11025.0, 9925.987385632094},
                {"3.9", "0.01", 20053.39558793548, 13860.84262644767},
                {"0.0001", "0.0001", 70.1884997450012, 70.1864525564186}};
  for (const auto& other : others) {
    INFO("K = " << other.stiffness << ", Z = " << other.damping);
    const Program program = program_of(oscillator(other.stiffness, other.damping));
    check(support::poles_of(support::transition(program)).at(0).hertz, other.hertz, 1e-11);
    check(support::continuous_poles(support::matrices_of(program)).at(0).hertz, other.continuous_hz,
          1e-11);
  }
}

TEST_CASE("golden: the triangle", "[golden]") {
  const Program program = program_of(scenes::triangle("0.1", "0.001") + scenes::output(1, "m_m2"));
  const auto poles = support::poles_of(support::transition(program));
  REQUIRE(poles.size() == 3);
  const struct {
    double real, imaginary, hertz, t60_s;
  } golden[] = {
      {.99120211769628440899, .1218413480239316437, 858.455895090791, .11704167662148},
      {.8485, .52635325590329542484, 3897.059050705478, .10426891092156},
      {.82729788230371559101, .55247951102418492576, 4132.595984001824, .030127177179114}};
  for (std::size_t i = 0; i < 3; ++i) {
    check(poles[i].z.real(), golden[i].real, 1e-12);
    check(poles[i].z.imag(), golden[i].imaginary, 1e-12);
    check(poles[i].hertz, golden[i].hertz, 1e-12);
    check(poles[i].t60_s, golden[i].t60_s, 1e-11);
  }
  const auto continuous = support::continuous_poles(support::matrices_of(program));
  REQUIRE(continuous.size() == 3);
  const double continuous_hz[] = {857.3469979368184, 3844.30396770083, 4062.585604505056};
  const double continuous_t60_s[] = {.11716233357043, .10442562780018, .030338267322174};
  for (std::size_t i = 0; i < 3; ++i) {
    check(continuous[i].hertz, continuous_hz[i], 1e-12);
    check(continuous[i].t60_s, continuous_t60_s[i], 1e-11);
  }

  const auto out = impulse(program, 1, 4410);
  for (const Sample& sample : {Sample{1, 1.0e-5},
                               {2, 1.02697e-3},
                               {3, 3.74273749e-3},
                               {10, 3.327901367135756860e-2},
                               {100, -6.146288135654975593e-4},
                               {1000, 9.342194981256161346e-5},
                               {4410, -5.578939292084521831e-5}}) {
    INFO("at " << sample.n);
    check(out[sample.n], sample.value, 1e-12);
  }
  const auto corner =
      impulse(program_of(scenes::triangle("0.1", "0.001") + scenes::output(1, "m_m0")), 1, 1000);
  check(corner[10], 2.585519636043072655e-2, 1e-12);
  check(corner[1000], 1.461510923604795940e-3, 1e-12);
}

TEST_CASE("golden: a string of 50", "[golden]") {
  const Program program = program_of(string50());
  const Spectrum modes = modes_of(program);
  const struct {
    int mode;  // Counted from 1.
    double hertz, continuous_hz;
  } golden[] = {{1, 136.70267890413, 136.700388536816},   {2, 273.289403833959, 273.27110459234},
                {3, 409.644225529081, 409.582598720605},  {10, 1347.89921816541, 1345.7051694068},
                {25, 3117.21221285319, 3090.15651280543}, {50, 4519.00407452929, 4436.90899643589}};
  const auto poles = support::poles_of(support::transition(program));
  const auto continuous = support::continuous_poles(support::matrices_of(program));
  REQUIRE(poles.size() == 50);
  REQUIRE(continuous.size() == 50);
  for (const auto& row : golden) {
    INFO("mode " << row.mode);
    const auto i = static_cast<std::size_t>(row.mode - 1);
    check(published(modes.stiffness(row.mode - 1), modes.damping(row.mode - 1)).hertz, row.hertz,
          1e-12);
    check(poles[i].hertz, row.hertz, 1e-10);  // Computed by stepping the kernel.
    check(continuous[i].hertz, row.continuous_hz, 1e-10);
  }
  check(published(modes.stiffness(0), modes.damping(0)).t60_s, 82.58581636, 1e-9);
  check(published(modes.stiffness(9), modes.damping(9)).t60_s, 0.8520512431, 1e-9);
  const auto lowest = lowest_shapes(support::network_of(string50()), program.parameters);
  REQUIRE(lowest);
  check(lowest->mode.frequency_hz, 136.70267890413, 1e-10);

  const auto out = impulse(program, 13, 44100);
  for (const Sample& sample : {Sample{100, 1.670305064242014102e-2},
                               {1000, 3.612944804382895155e-4},
                               {10000, -1.872396256509359642e-5},
                               {44100, -1.721404002942093605e-2}}) {
    INFO("at " << sample.n << ": " << show(out[sample.n]));
    CHECK(std::fabs(out[sample.n] - sample.value) <= 1e-12 * 1.7e-2);
  }
}

TEST_CASE("golden: the bowed string's string", "[golden]") {
  const Program program = program_of(scenes::string("s", 150, "0.3", "0.001"));
  const Spectrum modes = modes_of(program);
  const auto continuous_hz = [&](int mode) {
    const double sigma = 0.5 * modes.damping(mode);
    return std::sqrt(modes.stiffness(mode) - sigma * sigma) * rate_hz / (2.0 * std::numbers::pi);
  };
  const double golden[] = {79.9810014580398, 159.95599581816, 239.91897482901};
  for (int mode = 0; mode < 3; ++mode) {
    check(published(modes.stiffness(mode), modes.damping(mode)).hertz, golden[mode], 1e-12);
  }
  check(published(modes.stiffness(74), modes.damping(74)).hertz, 5554.85358342263, 1e-12);
  check(published(modes.stiffness(149), modes.damping(149)).hertz, 8145.37354227508, 1e-12);
  check(continuous_hz(74), 5408.33141490328, 1e-12);
  check(continuous_hz(149), 7688.20794789262, 1e-12);
}

// f0 = a M^b with b close to -1/2, for a string of 48 masses.
TEST_CASE("golden: a string's pitch by its mass is a power law", "[golden]") {
  double count = 0.0;
  double sum_x = 0.0;
  double sum_y = 0.0;
  double sum_xx = 0.0;
  double sum_xy = 0.0;
  double at_one = 0.0;
  for (double mass = 1.0; mass <= 16.0; mass *= 1.25) {
    Program program = program_of(scenes::string("s", 48, "0.06352", "0.01"));
    program.parameters[0] = mass;  // s_M
    const Spectrum modes = modes_of(program);
    const double hertz = published(modes.stiffness(0), modes.damping(0)).hertz;
    at_one = mass == 1.0 ? hertz : at_one;
    const double x = std::log(mass);
    const double y = std::log(hertz);
    count += 1.0;
    sum_x += x;
    sum_y += y;
    sum_xx += x * x;
    sum_xy += x * y;
  }
  const double slope = (count * sum_xy - sum_x * sum_y) / (count * sum_xx - sum_x * sum_x);
  INFO("b = " << show(slope) << ", a = " << show(at_one));
  CHECK(std::fabs(slope + 0.5) < 1e-4);
  CHECK(slope != -0.5);
  check(at_one, 113.4, 1e-3);
}

}  // namespace ressort::golden_test
