#include "core/solids/solid_modes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/linear_algebra/eigen.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/solids.h"
#include "tests/support/thorough.h"

namespace ressort::solid_modes_test {
namespace {

using namespace support;

constexpr double pi = std::numbers::pi;

SolidMesh meshed(const TetrahedronMesh& mesh) {
  const auto solid = quadratic(mesh);
  REQUIRE(solid);
  return *solid;
}

SolidModes modes_of(const TetrahedronMesh& mesh, const SolidMaterial& material, int count,
                    const std::vector<SolidClamp>& clamps = {}) {
  const auto modes = find_solid_modes(meshed(mesh), material, clamps, count, Progress());
  REQUIRE(modes);
  // Holds for all results here: mass-normalised, orthogonal shapes that solve the equations.
  CHECK(modes->skewness < 1e-9);
  CHECK(modes->residual < 1e-6);
  CHECK(std::is_sorted(modes->frequency_hz.begin(), modes->frequency_hz.end()));
  return *modes;
}

double nearest(const SolidModes& modes, double frequency_hz) {
  double best = 0.0;
  for (const double found : modes.frequency_hz) {
    best = std::abs(found - frequency_hz) < std::abs(best - frequency_hz) ? found : best;
  }
  return best;
}

// The free modes of a box by Ritz's method with products of Legendre polynomials up to a total
// degree, independent of the tested code. Hz, ascending, the six rigid motions left out.
std::vector<double> ritz_box(const Point3& sides, const SolidMaterial& material, int degree) {
  // On -1..1 with P_n of unit norm, int P_i P_j is the identity; these are int P_i' P_j, int P_i'
  // P_j'.
  const auto n = static_cast<std::size_t>(degree + 1);
  std::vector<std::vector<double>> slope(n, std::vector<double>(n));
  std::vector<std::vector<double>> bend(n, std::vector<double>(n));
  constexpr int steps = 64;  // Gauss-Legendre nodes by Newton's method on P_64.
  for (int s = 0; s < steps; ++s) {
    double x = std::cos(pi * (s + 0.75) / (steps + 0.5));
    double derivative = 1.0;
    for (int newton = 0; newton < 100; ++newton) {
      double p0 = 1.0;
      double p1 = x;
      for (int k = 2; k <= steps; ++k) {
        p0 = std::exchange(p1, ((2 * k - 1) * x * p1 - (k - 1) * p0) / k);
      }
      derivative = steps * (x * p1 - p0) / (x * x - 1.0);
      x -= p1 / derivative;
    }
    const double weight = 2.0 / ((1.0 - x * x) * derivative * derivative);
    std::vector<double> value(n);
    std::vector<double> first(n);
    value[0] = 1.0;
    for (std::size_t k = 1; k < n; ++k) {
      const auto order = static_cast<double>(k);
      value[k] =
          k == 1 ? x
                 : ((2.0 * order - 1.0) * x * value[k - 1] - (order - 1.0) * value[k - 2]) / order;
      first[k] = order * value[k - 1] + x * first[k - 1];
    }
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        const double unit =
            std::sqrt((static_cast<double>(i) + 0.5) * (static_cast<double>(j) + 0.5));
        slope[i][j] += weight * unit * first[i] * value[j];
        bend[i][j] += weight * unit * first[i] * first[j];
      }
    }
  }
  std::vector<std::array<std::size_t, 3>> terms;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; i + j < n; ++j) {
      for (std::size_t k = 0; i + j + k < n; ++k) {
        terms.push_back({i, j, k});
      }
    }
  }
  const double lambda = material.young * material.poisson /
                        ((1.0 + material.poisson) * (1.0 - 2.0 * material.poisson));
  const double mu = 0.5 * material.young / (1.0 + material.poisson);
  Matrix k(3 * terms.size(), 3 * terms.size());
  for (std::size_t a = 0; a < terms.size(); ++a) {
    for (std::size_t b = 0; b < terms.size(); ++b) {
      // int (d term a / d x_p) (d term b / d x_q)
      const auto product = [&](std::size_t p, std::size_t q) {
        double all = 1.0;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const std::size_t i = terms[a][axis];
          const std::size_t j = terms[b][axis];
          const double scale = 2.0 / sides[axis];
          all *= p == axis && q == axis ? bend[i][j] * scale * scale
                 : p == axis            ? slope[i][j] * scale
                 : q == axis            ? slope[j][i] * scale
                 : i == j               ? 1.0
                                        : 0.0;
        }
        return all;
      };
      const double shear = mu * (product(0, 0) + product(1, 1) + product(2, 2));
      for (std::size_t p = 0; p < 3; ++p) {
        for (std::size_t q = 0; q < 3; ++q) {
          k(3 * a + p, 3 * b + q) =
              (lambda * product(p, q) + mu * product(q, p) + (p == q ? shear : 0.0)) /
              material.density;
        }
      }
    }
  }
  std::vector<double> frequencies;
  const Eigenpairs pairs = symmetric_eigenpairs(k);
  for (std::size_t i = 6; i < pairs.values.size(); ++i) {
    frequencies.push_back(std::sqrt(std::max(pairs.values[i], 0.0)) / (2.0 * pi));
  }
  return frequencies;
}

TEST_CASE("a steel bar has the frequencies of Ritz's method", "[solid_modes]") {
  // ME-T1, T-BAR: converged values of a 3-D Ritz computation of degree 20.
  const SolidModes modes =
      modes_of(box_mesh({0.2, 0.02, 0.01}, {40, 4, 2}), {"", 2e11, 0.3, 7850.0}, 12);
  CHECK(modes.rigid == 6);
  CHECK(modes.mass == Approx(0.314).epsilon(1e-12));
  for (const double hz : {1285.95, 2506.99, 3490.57, 6529.94, 6696.96, 12612.99}) {
    CHECK(nearest(modes, hz) == Approx(hz).epsilon(1e-3));
    CHECK(nearest(modes, hz) > hz * (1.0 - 1e-5));  // Finite elements converge from above.
  }
  CHECK(nearest(modes, 5800.8) == Approx(5800.8).epsilon(1e-2));  // Torsion.
}

TEST_CASE("a cube has double and triple modes", "[solid_modes]") {
  // ME-T2: Omega = omega L sqrt(rho / E), Demarest's problem at nu = 0.3.
  const SolidModes modes = modes_of(box_mesh({1.0, 1.0, 1.0}, {8, 8, 8}), {"", 1.0, 0.3, 1.0}, 14);
  CHECK(modes.rigid == 6);
  const double expected[] = {1.77125, 1.77125, 2.38517, 2.38517, 2.38517, 2.42566, 2.42566,
                             2.42566, 2.75536, 2.75536, 2.75536, 2.83592, 2.83592, 2.83592};
  for (std::size_t i = 0; i < std::size(expected); ++i) {
    CHECK(2.0 * pi * modes.frequency_hz[i] == Approx(expected[i]).epsilon(2.5e-3));
  }
  // Lame's modes are known exactly: omega = pi sqrt(2 G / rho) / L.
  CHECK(2.0 * pi * modes.frequency_hz[8] == Approx(pi * std::sqrt(2.0 / 2.6)).epsilon(1e-3));
}

TEST_CASE("a ball has Lamb's frequencies", "[solid_modes]") {
  // eta = omega R sqrt(rho / G) at nu = 0.3; the meshed ball is scaled to the volume of a sphere.
  TetrahedronMesh ball = ball_mesh(1.0, 4);
  const SolidMesh solid = meshed(ball);
  double six = 0.0;
  for (const Triangle& t : solid.surface) {
    six += inner(solid.points[static_cast<std::size_t>(t[0])],
                 cross(solid.points[static_cast<std::size_t>(t[1])],
                       solid.points[static_cast<std::size_t>(t[2])]));
  }
  for (Point3& point : ball.points) {
    point = std::cbrt(8.0 * pi / six) * point;
  }
  const SolidModes modes = modes_of(ball, {"", 2.6, 0.3, 1.0}, 27);  // G = 1
  CHECK(modes.rigid == 6);
  std::size_t next = 0;
  for (const auto& [eta, count] :
       {std::pair(2.50113, 5), {2.64622, 5}, {3.52999, 3}, {3.86470, 7}, {3.93740, 7}}) {
    for (int i = 0; i < count; ++i) {
      // Eight cells across; the body tests require 0.3 % of a finer mesh.
      CHECK(2.0 * pi * modes.frequency_hz[next++] == Approx(eta).epsilon(4e-3));
    }
  }
}

TEST_CASE("boxes of any size and material have the frequencies of Ritz's method", "[solid_modes]") {
  // ME-T4
  Random random(20261122);
  for (int round = 0; round < of_all(1, 3); ++round) {
    const Point3 sides{random.uniform(0.05, 0.2), random.uniform(0.05, 0.2),
                       random.uniform(0.05, 0.2)};
    const SolidMaterial material{"", random.uniform(1e9, 3e11), random.uniform(0.0, 0.4),
                                 random.uniform(500.0, 10000.0)};
    const std::vector<double> exact = ritz_box(sides, material, 9);
    const TetrahedronMesh mesh = oriented_box_mesh(
        {{}, {Point3{sides[0], 0.0, 0.0}, Point3{0.0, sides[1], 0.0}, Point3{0.0, 0.0, sides[2]}}},
        6000.0);
    const SolidModes modes = modes_of(mesh, material, 8);
    for (std::size_t i = 0; i < 8; ++i) {
      CHECK(modes.frequency_hz[i] == Approx(exact[i]).epsilon(5e-3));
    }
  }
}

TEST_CASE("a tapered membrane has the frequencies of the NAFEMS benchmark", "[solid_modes]") {
  // ME-T5, FV32: 10 m long, 5 m high at the root and 1 m at the tip. Motion is confined to its
  // plane by a stiff spring at every node of the middle plane.
  TetrahedronMesh mesh = box_mesh({10.0, 1.0, 0.05}, {32, 16, 2});
  std::vector<SolidClamp> root;
  for (Point3& point : mesh.points) {
    point[1] = (point[1] - 0.5) * (5.0 - 0.4 * point[0]);
  }
  const SolidMesh solid = meshed(mesh);
  for (const Point3& point : solid.points) {
    if (point[0] < 1e-9) {
      root.push_back({point, 1e-9});
    }
  }
  const SolidMaterial steel{"", 200e9, 0.3, 8000.0};
  SolidMatrices matrices = solid_matrices(solid, steel, root, Progress());
  for (std::size_t row = 0; row < matrices.node.size(); ++row) {
    if (std::abs(solid.points[static_cast<std::size_t>(matrices.node[row])][2] - 0.025) < 1e-9) {
      matrices.stiffness[static_cast<std::size_t>(matrices.mass.first[row])][8] += 1e15;
    }
  }
  const auto pairs = lowest_solid_pairs(solid, matrices, 0.0, 6, Progress());
  REQUIRE(pairs);
  const double target[] = {44.623, 130.03, 162.70, 246.05, 379.90, 391.44};
  for (std::size_t i = 0; i < 6; ++i) {
    CHECK(std::sqrt(pairs->values[i]) / (2.0 * pi) == Approx(target[i]).epsilon(2e-3));
  }
}

TEST_CASE("a clamped bar has the frequencies of a cantilever", "[solid_modes]") {
  // f = (beta L)^2 / 2 pi sqrt(E I / rho A) / L^2 with beta L = 1.87510, 4.69409 (Euler-Bernoulli).
  // At L / h = 100 shear lowers it by less than 0.1 %, and the clamp raises it by about as much.
  const double l = 1.0;
  const double h = 0.01;
  const SolidMaterial steel{"", 2e11, 0.0, 7850.0};
  const SolidModes modes =
      modes_of(box_mesh({l, 0.012, h}, {60, 1, 1}), steel, 4, {{{0.0, 0.006, 0.005}, 0.0079}});
  CHECK(modes.rigid == 0);
  const double unit = h / (2.0 * pi * l * l) * std::sqrt(2e11 / 7850.0 / 12.0);
  CHECK(modes.frequency_hz[0] == Approx(1.87510407 * 1.87510407 * unit).epsilon(5e-3));
  CHECK(modes.frequency_hz[2] == Approx(4.69409113 * 4.69409113 * unit).epsilon(5e-3));
  // Clamped at one node it can rotate about three axes, along an edge about one.
  CHECK(modes_of(box_mesh({0.1, 0.05, 0.05}, {2, 1, 1}), steel, 4, {{{}, 1e-6}}).rigid == 3);
  CHECK(modes_of(box_mesh({0.1, 0.05, 0.05}, {2, 1, 1}), steel, 4,
                 {{{}, 1e-6}, {{0.0, 0.0, 0.025}, 1e-6}, {{0.0, 0.0, 0.05}, 1e-6}})
            .rigid == 1);
  CHECK(modes_of(box_mesh({0.1, 0.05, 0.05}, {2, 1, 1}), steel, 1, {{{}, 1e-6}})
            .frequency_hz.size() == 1);
}

TEST_CASE("size, stiffness and density scale frequencies exactly", "[solid_modes]") {
  // ME-T7: f scales with sqrt(E / rho) / L.
  TetrahedronMesh mesh = box_mesh({0.1, 0.06, 0.03}, {4, 3, 2});
  for (Point3& point : mesh.points) {
    point[1] += point[0] * point[0];
  }
  const SolidMaterial material{"", 1e11, 0.3, 5000.0};
  const SolidModes plain = modes_of(mesh, material, 10);
  TetrahedronMesh large = mesh;
  for (Point3& point : large.points) {
    point = 2.0 * point;
  }
  const SolidModes larger = modes_of(large, material, 10);
  const SolidModes stiffer = modes_of(mesh, {"", 4e11, 0.3, 5000.0}, 10);
  const SolidModes heavier = modes_of(mesh, {"", 1e11, 0.3, 20000.0}, 10);
  for (std::size_t i = 0; i < 10; ++i) {
    CHECK(larger.frequency_hz[i] == Approx(0.5 * plain.frequency_hz[i]).epsilon(1e-9));
    CHECK(stiffer.frequency_hz[i] == Approx(2.0 * plain.frequency_hz[i]).epsilon(1e-9));
    CHECK(heavier.frequency_hz[i] == Approx(0.5 * plain.frequency_hz[i]).epsilon(1e-9));
  }
}

TEST_CASE("a bar's ends, middle and nodes move like a beam's", "[solid_modes]") {
  // ME-T8, Euler-Bernoulli, free: phi_end^2 m = 4, phi_mid / phi_end = -0.6079, a node at 0.2242 L.
  const SolidMaterial steel{"", 2e11, 0.3, 7850.0};
  const TetrahedronMesh mesh = box_mesh({1.0, 0.012, 0.008}, {125, 1, 1});
  const SolidMesh solid = meshed(mesh);
  const SolidModes modes = modes_of(mesh, steel, 2);
  const auto weight = [&](double x) {
    const SolidPlace place{"", nearest_on_surface(solid, {x, 0.012, 0.008}), {0.0, 0.0, 1.0}};
    return std::sqrt(modes.mass) * shape_at(modes, place, 0);
  };
  CHECK(weight(0.0) * weight(0.0) == Approx(4.0).epsilon(1e-2));
  CHECK(weight(1.0) == Approx(weight(0.0)).epsilon(1e-6));
  CHECK(0.5 * (weight(0.496) + weight(0.504)) / weight(0.0) == Approx(-0.6079).epsilon(1e-2));
  CHECK(std::abs(weight(0.224) / weight(0.0)) < 0.01);  // 40 dB
}

TEST_CASE("all modes of a small solid equal those of its dense matrices", "[solid_modes]") {
  TetrahedronMesh mesh = box_mesh({1.0, 0.7, 0.5}, {1, 1, 1});
  for (Point3& point : mesh.points) {
    point[0] += 0.2 * point[1] * point[2];
  }
  const SolidMesh solid = meshed(mesh);
  const SolidMaterial material{"", 7.0, 0.2, 3.0};
  const SolidMatrices matrices = solid_matrices(solid, material, {}, Progress());
  const std::size_t size = solid.unknowns();
  Matrix k(size, size);
  Matrix m(size, size);
  for (int column = 0; column < matrices.mass.size(); ++column) {
    for (int i = matrices.mass.first[static_cast<std::size_t>(column)];
         i < matrices.mass.first[static_cast<std::size_t>(column) + 1]; ++i) {
      const auto e = static_cast<std::size_t>(i);
      const auto r = 3 * static_cast<std::size_t>(matrices.mass.row[e]);
      const auto c = 3 * static_cast<std::size_t>(column);
      for (std::size_t a = 0; a < 3; ++a) {
        m(r + a, c + a) = m(c + a, r + a) = matrices.mass.value[e];
        for (std::size_t b = 0; b < 3; ++b) {
          k(r + a, c + b) = k(c + b, r + a) = matrices.stiffness[e][a + 3 * b];
        }
      }
    }
  }
  // K M^-1 has the same eigenvalues, and the mass sums to that of the solid in each axis.
  double total = 0.0;
  for (const double value : m.values) {
    total += value;
  }
  const SolidModes modes = modes_of(mesh, material, static_cast<int>(size) - 6);
  CHECK(total == Approx(3.0 * modes.mass).epsilon(1e-12));
  CHECK(modes.frequency_hz.size() == size - 6);
  // ME-T6: exactly six rigid motions.
  const auto all = lowest_solid_pairs(solid, matrices, -0.01, 8, Progress());
  REQUIRE(all);
  CHECK(std::abs(all->values[5]) < 1e-9 * all->values[6]);
  Matrix unit(size, size);
  for (std::size_t i = 0; i < size; ++i) {
    unit(i, i) = 1.0;
  }
  const auto inverse = positive_solution(m, unit);
  REQUIRE(inverse);
  std::vector<double> exact;
  for (const auto& value : eigenvalues(product(k, *inverse))) {
    exact.push_back(value.real());
  }
  std::sort(exact.begin(), exact.end());
  for (std::size_t i = 6; i < size; ++i) {
    const double omega = 2.0 * pi * modes.frequency_hz[i - 6];
    CHECK(omega * omega == Approx(exact[i]).epsilon(1e-9));
  }
  // Completeness: the sum over all modes, rigid motions included, equals the inverse of the mass
  // matrix. The rigid part is known, 1/m + |(p - c) x d|^2 / J; here it is the remainder.
  for (std::size_t row = 0; row < size; row += 7) {
    double sum = 0.0;
    for (std::size_t i = 0; i + 6 < size; ++i) {
      sum += modes.shapes(row, i) * modes.shapes(row, i);
    }
    const double rigid = (*inverse)(row, row) - sum;
    CHECK(rigid > 1.0 / modes.mass);
    CHECK(rigid < 12.0 / modes.mass);
  }
}

TEST_CASE("refining lowers every frequency", "[solid_modes]") {
  const SolidMaterial steel{"", 2e11, 0.3, 7850.0};
  const SolidModes coarse = modes_of(box_mesh({0.2, 0.1, 0.01}, {4, 2, 1}), steel, 12);
  const SolidModes fine = modes_of(box_mesh({0.2, 0.1, 0.01}, {8, 4, 2}), steel, 12);
  for (std::size_t i = 0; i < 12; ++i) {
    CHECK(fine.frequency_hz[i] < coarse.frequency_hz[i]);
  }
}

TEST_CASE("decays follow their formulas", "[solid_modes]") {
  // T-DAMP: a = 5, b = 3e-8; 13.8155 / (a + b omega^2).
  const SolidDamping rayleigh{5.0, 3e-8, 0.0};
  CHECK(rayleigh.t60_s(200.0) == Approx(2.737).epsilon(5e-4));
  CHECK(rayleigh.t60_s(1000.0) == Approx(2.234).epsilon(5e-4));
  CHECK(rayleigh.t60_s(5000.0) == Approx(0.399).epsilon(1e-3));
  // A loss factor of 2e-4 at 440 Hz: the bandwidth is eta f, T60 = ln 1000 / (pi eta f).
  CHECK(SolidDamping{.loss = 2e-4}.t60_s(440.0) ==
        Approx(std::log(1000.0) / (pi * 2e-4 * 440.0)).epsilon(1e-12));
}

TEST_CASE("fully clamped solids and excessive requests are reported", "[solid_modes]") {
  const SolidMesh solid = meshed(box_mesh({1.0, 1.0, 1.0}, {1, 1, 1}));
  const SolidMaterial steel{"", 2e11, 0.3, 7850.0};
  const auto held =
      find_solid_modes(solid, steel, std::vector<SolidClamp>{{{}, 10.0}}, 3, Progress());
  REQUIRE_FALSE(held);
  CHECK(held.error().message.find("clamped") != std::string::npos);
  const auto many = find_solid_modes(solid, steel, {}, 1000, Progress());
  REQUIRE(many);
  CHECK(many->frequency_hz.size() == 75);  // 27 nodes, less six rigid motions.
  // Cancelled.
  CHECK_THROWS_AS(
      find_solid_modes(solid, steel, {}, 3, Progress([](std::string_view) { return false; })),
      Stopped);
}

}  // namespace
}  // namespace ressort::solid_modes_test
