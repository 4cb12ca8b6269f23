// The pitch of keys. For every tuned preset at three rates: at the stiffness of a key, the
// published scheme's (z - 1)^2 M + z K + (z - 1) Z is singular at the key's frequency, found by
// inverse iteration with Eigen; and a render is analysed by linear prediction.
#include <Eigen/SparseLU>
#include <complex>
#include <cstdio>

#include "app/session/loader.h"
#include "core/compile/accuracy/pitches.h"
#include "core/laws/laws.h"
#include "core/model/topology.h"
#include "tests/support/dense.h"
#include "tests/support/player.h"

namespace ressort::tuning_test {
namespace {

using support::note_on;
using support::Player;
using Complex = std::complex<double>;
using Sparse = Eigen::SparseMatrix<Complex>;

struct Matrices {
  Sparse mass;
  Sparse stiffness;
  Sparse damping;
};

// Matrices of the part with the most masses, at a stiffness factor.
Matrices matrices_of(const Machine& machine, const Program& program, double factor) {
  const auto n = static_cast<Eigen::Index>(program.moving);
  const auto value = [&](std::uint32_t c) {
    return coefficient_value(program, program.coefficients[c], machine.parameters, factor);
  };
  std::vector<Eigen::Triplet<Complex>> mass;
  std::vector<Eigen::Triplet<Complex>> stiffness;
  std::vector<Eigen::Triplet<Complex>> damping;
  for (const MassRun& run : program.mass_runs) {
    for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
      mass.emplace_back(i, i, 1.0 / value(run.inverse_mass));
      if (run.is_oscillator) {
        stiffness.emplace_back(i, i, value(run.stiffness));
        damping.emplace_back(i, i, value(run.damping));
      }
    }
  }
  for (const LinkRun& run : program.link_runs) {
    for (std::uint32_t l = run.first; run.law == Law::spring && l < run.first + run.count; ++l) {
      const std::uint32_t ends[] = {program.ends[l].a, program.ends[l].b};
      for (const std::uint32_t a : ends) {
        for (const std::uint32_t b : ends) {
          if (a < program.moving && b < program.moving) {
            const double sign = a == b ? 1.0 : -1.0;
            stiffness.emplace_back(a, b, sign * value(run.coefficients[0]));
            damping.emplace_back(a, b, sign * value(run.coefficients[1]));
          }
        }
      }
    }
  }
  Matrices springs{Sparse(n, n), Sparse(n, n), Sparse(n, n)};
  springs.mass.setFromTriplets(mass.begin(), mass.end());
  springs.stiffness.setFromTriplets(stiffness.begin(), stiffness.end());
  springs.damping.setFromTriplets(damping.begin(), damping.end());
  return springs;
}

// Returns the pole nearest to z.
Complex nearest_pole(const Matrices& springs, Complex z) {
  Eigen::VectorXcd x = Eigen::VectorXcd::Random(springs.mass.rows());
  Eigen::SparseLU<Sparse> solver;
  for (int i = 0; i < 30; ++i) {
    const Sparse at =
        (z - 1.0) * (z - 1.0) * springs.mass + z * springs.stiffness + (z - 1.0) * springs.damping;
    const Sparse slope = 2.0 * (z - 1.0) * springs.mass + springs.stiffness + springs.damping;
    solver.compute(at);
    if (solver.info() != Eigen::Success) {
      return z;  // Singular: z is the pole.
    }
    const Eigen::VectorXcd next = solver.solve(slope * x);
    Eigen::Index largest = 0;
    x.cwiseAbs().maxCoeff(&largest);
    const Complex change = x(largest) / next(largest);
    x = next / next.norm();
    // The first vector gives no useful correction.
    if (i > 1) {
      z -= change;
      if (std::abs(change) < 1e-15) {
        return z;
      }
    }
  }
  return z;
}

double hz_of(int key, int transpose) {
  return 440.0 * std::exp2((key + transpose - 69) / 12.0);
}

void check_preset(const std::string& name, double rate_hz, int step) {
  auto scene = load_scene(name, {});
  REQUIRE(scene);
  const double ratio = Network::reference_rate_hz / rate_hz;
  // Uses the published scheme, because exact modes have other poles.
  const auto compiled = compile_network(scene->network, scene->preset,
                                        {.rate_hz = rate_hz, .method = Method::direct});
  REQUIRE(compiled);
  if (!compiled->instrument.mode) {
    return;
  }
  const Machine& machine = compiled->engine->machine();
  const auto shapes = lowest_shapes(expand_macros(scene->network), machine.parameters);
  REQUIRE(shapes);
  const Pitches pitches = make_pitches(
      *shapes, stepping_of_lowest(machine, *shapes, machine.parameters), rate_hz, ratio);
  double worst = 0.0;
  for (int key = 24; key <= 108; key += step) {
    const double hz = hz_of(key, scene->preset.transpose);
    if (hz > compiled->instrument.highest_frequency_hz) {
      break;  // The key is silent.
    }
    const double factor = pitches.factor_at(hz);
    const Matrices springs = matrices_of(machine, machine.parts[0], factor);
    const double theta = 2.0 * std::numbers::pi * hz / rate_hz;
    const double decay = 0.5 * shapes->mode.damping * ratio;
    const Complex pole = nearest_pole(springs, std::polar(std::exp(-decay), theta));
    const double cents = 1200.0 * std::log2(std::arg(pole) / theta);
    INFO(name << " at " << rate_hz << " Hz, key " << key << ": " << cents << " cents");
    CHECK(std::fabs(cents) < 0.05);
    // Excludes a higher mode, which would need a quarter of the stiffness.
    CHECK(factor * shapes->mode.stiffness * ratio * ratio > 0.9 * (2.0 - 2.0 * std::cos(theta)));
    worst = std::max(worst, std::fabs(cents));
  }
  std::printf("%s at %g Hz: keys at most %.2g cents off\n", name.c_str(), rate_hz, worst);
}

TEST_CASE("keys sound at the frequency of the damped pole", "[tuning]") {
  for (const double rate_hz : {44100.0, 48000.0, 96000.0}) {
    for (const char* const name : {"PolyTriangle", "IPlayTheTriangle", "BowedString",
                                   "PluckedHarmonics", "LargeTriangleMesh", "Resonator"}) {
      check_preset(name, rate_hz, 1);
    }
    check_preset("20x30mesh", rate_hz, 5);
    check_preset("1000massString", rate_hz, 5);
  }
}

// The poles of a sum of `order` exponentials: y[n] is a linear combination of earlier samples.
std::vector<Complex> poles_of_sound(const std::vector<double>& y, std::size_t first,
                                    std::size_t order, std::size_t apart) {
  const auto rows = static_cast<Eigen::Index>((y.size() - first) / apart - order);
  const auto columns = static_cast<Eigen::Index>(order);
  Eigen::MatrixXd past(rows, columns);
  Eigen::VectorXd now(rows);
  const auto at = [&](Eigen::Index i) { return y[first + apart * static_cast<std::size_t>(i)]; };
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index j = 0; j < columns; ++j) {
      past(i, j) = at(i + columns - 1 - j);
    }
    now(i) = at(i + columns);
  }
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(columns, columns);
  companion.row(0) = support::least_squares(past, now).transpose();
  companion.bottomLeftCorner(columns - 1, columns - 1).setIdentity();
  const Eigen::VectorXcd values = support::eigenvalues_of(companion);
  return {values.begin(), values.end()};
}

TEST_CASE("a key is in tune in the sound of the engine", "[tuning]") {
  const Network network = support::network_of(scenes::poly_triangle());
  Preset preset = support::struck(1);
  preset.parameters = {};
  for (const auto& [key, budget] : std::vector<std::pair<int, Budget>>{{33, {}},
                                                                       {36, {}},
                                                                       {45, {}},
                                                                       {60, {}},
                                                                       {69, {}},
                                                                       {45, {.cents = 1.0}},
                                                                       {69, {.cents = 1.0}}}) {
    // The samples used are spaced so that a partial advances by about a radian.
    const double hz = hz_of(key, 0);
    const auto apart =
        static_cast<std::size_t>(std::max(1.0, 44100.0 / (2.0 * std::numbers::pi * hz) / 4.0));
    Player player(scenes::poly_triangle(), preset, {.budget = budget});
    player.run(300 * apart + 200, {note_on(0, key)});
    double nearest = 1e9;
    for (const Complex& z : poles_of_sound(player.out[0], 100, 6, apart)) {
      const double found =
          std::arg(z) * 44100.0 / (2.0 * std::numbers::pi * static_cast<double>(apart));
      if (found > 0.0) {
        const double cents = 1200.0 * std::log2(found / hz);
        nearest = std::fabs(cents) < std::fabs(nearest) ? cents : nearest;
      }
    }
    INFO("key " << key << " is " << nearest << " cents off");
    CHECK(std::fabs(nearest) < 0.05);
  }
}

}  // namespace
}  // namespace ressort::tuning_test
