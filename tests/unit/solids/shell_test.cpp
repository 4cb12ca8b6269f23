#include "core/solids/shell.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "core/solids/solid_modes.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/solids.h"

namespace ressort::shell_test {
namespace {

using namespace support;

constexpr double pi = std::numbers::pi;
const SolidMaterial steel{"", 2e11, 0.3, 7850.0};

SolidMesh meshed(const Surface& surface, double thickness, double unknowns) {
  const auto mesh = shell_mesh(surface, thickness, unknowns, Progress());
  REQUIRE(mesh);
  CHECK(static_cast<double>(mesh->unknowns()) >= unknowns - 6.0);
  return *mesh;
}

SolidModes modes_of(const SolidMesh& mesh, int count, const std::vector<SolidClamp>& clamps = {}) {
  const auto modes = find_solid_modes(mesh, steel, clamps, count, Progress());
  REQUIRE(modes);
  CHECK(modes->rigid == (clamps.empty() ? 6 : 0));
  CHECK(modes->skewness < 1e-9);
  CHECK(modes->residual < 1e-6);
  return *modes;
}

// Checks the frequencies, in Hz, of modes that come in pairs.
void check_pairs(const SolidModes& modes, const std::vector<double>& wanted) {
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    CHECK(modes.frequency_hz[2 * i] == Approx(wanted[i]).epsilon(0.01));
    CHECK(modes.frequency_hz[2 * i + 1] == Approx(wanted[i]).epsilon(0.01));
  }
}

TEST_CASE("a shell's triangle has the energy of its strain and curvature", "[shell]") {
  Random random(8);
  for (int round = 0; round < 50; ++round) {
    std::array<Point3, 3> corners{};
    for (Point3& corner : corners) {
      for (double& x : corner) {
        x = random.uniform(-1.0, 1.0);
      }
    }
    const Point3 area = cross(corners[1] - corners[0], corners[2] - corners[0]);
    const double twice = length(area);
    const Point3 n = 1.0 / twice * area;
    const Point3 along = corners[2] - corners[0];
    const Point3 ex = 1.0 / length(along) * along;
    const Point3 ey = cross(n, ex);
    const double h = 0.01;
    const ShellElement element = shell_element(corners, steel, h);
    // Energy of displacements and rotations that are functions of the place in the plane.
    const auto energy = [&](const std::function<std::array<Point3, 2>(double, double)>& field) {
      std::array<Point3, 6> x{};
      for (std::size_t i = 0; i < 3; ++i) {
        const Point3 arm = corners[i] - corners[0];
        const auto [u, turn] = field(inner(arm, ex), inner(arm, ey));
        x[i] = u[0] * ex + u[1] * ey + u[2] * n;
        x[3 + i] = turn[0] * ex + turn[1] * ey + turn[2] * n;
      }
      double sum = 0.0;
      for (std::size_t a = 0; a < 6; ++a) {
        for (std::size_t b = 0; b < 6; ++b) {
          for (std::size_t k = 0; k < 9; ++k) {
            sum += 0.5 * x[a][k % 3] * element.stiffness[a][b][k] * x[b][k / 3];
          }
        }
      }
      return sum;
    };
    const double p = random.uniform(-1.0, 1.0);
    const double q = random.uniform(-1.0, 1.0);
    const double r = random.uniform(-1.0, 1.0);
    const double plate = 2e11 / (1.0 - 0.09);
    const double form = p * p + q * q + 0.6 * p * q + 0.5 * 0.7 * r * r;
    // A deflection (p x^2 + q y^2 + r x y) / 2 has the curvatures p, q and r; here r is twice the
    // twist.
    CHECK(energy([&](double x, double y) {
            return std::array<Point3, 2>{
                Point3{0.0, 0.0, 0.5 * (p * x * x + q * y * y + r * x * y)},
                Point3{q * y + 0.5 * r * x, -p * x - 0.5 * r * y, 0.0}};
          }) == Approx(0.5 * plate * h * h * h / 12.0 * form * 0.5 * twice).epsilon(1e-9));
    // Strains p, q and r in the plane, with the rotation of the plane.
    CHECK(energy([&](double x, double y) {
            return std::array<Point3, 2>{Point3{p * x + 2.0 * r * y, q * y - r * x, 0.0},
                                         Point3{0.0, 0.0, -1.5 * r}};
          }) == Approx(0.5 * plate * h * form * 0.5 * twice).epsilon(1e-9));
    // A motion without strain.
    CHECK(std::abs(energy([&](double x, double y) {
            const Point3 turn{p, q, r};
            return std::array<Point3, 2>{Point3{1.0, q, p} + cross(turn, {x, y, 0.0}), turn};
          })) < 1e-9 * plate * h * twice);
  }
}

TEST_CASE("a shell's mesh is the surface in smaller triangles", "[shell]") {
  Surface fins = box_surface({1.0, 0.3, 0.1});
  fins.points.push_back({0.5, 0.15, 1.0});  // A third triangle on one edge.
  fins.triangles.push_back({0, 1, 8});
  const SolidMesh mesh = meshed(fins, 1e-3, 3000);
  const std::size_t half = mesh.points.size() / 2;
  CHECK(mesh.points.size() == 1000);
  std::vector<std::array<int, 2>> edges;
  double area = 0.0;
  for (const auto& [a, b, c] : mesh.surface) {
    const auto point = [&](int i) { return mesh.points[static_cast<std::size_t>(i)]; };
    area += 0.5 * length(cross(point(b) - point(a), point(c) - point(a)));
    for (const auto& [from, to] : {std::minmax(a, b), std::minmax(b, c), std::minmax(a, c)}) {
      edges.push_back({from, to});
      CHECK(length(point(from) - point(to)) < 0.126);
    }
    CHECK(static_cast<std::size_t>(std::max({a, b, c})) < half);
  }
  CHECK(area == Approx(2.0 * (0.3 + 0.1 + 0.03) + 0.5 * std::hypot(1.0, 0.15)).epsilon(1e-12));
  // Euler: a sphere has V - E + F = 2; the fin adds a disc along one path of edges, so 2 again.
  std::sort(edges.begin(), edges.end());
  const auto end = std::unique(edges.begin(), edges.end());
  CHECK(static_cast<long>(half + mesh.surface.size()) - (end - edges.begin()) == 2);
}

TEST_CASE("a clamped circular plate has Leissa's frequencies", "[shell]") {
  // lambda^2 = omega R^2 sqrt(rho h / D) of thin plates (Leissa 1969, table 2.1). The wall is a
  // hundredth of the diameter, and a ten-thousandth.
  const Surface disc = revolved({{0.0, 0.0}, {0.25, 0.0}, {0.5, 0.0}, {0.75, 0.0}, {1.0, 0.0}}, 96);
  for (const double h : {0.02, 0.0002}) {
    const SolidMesh mesh = meshed(disc, h, 15000);
    std::vector<SolidClamp> rim;
    for (std::size_t i = 0; i < mesh.points.size() / 2; ++i) {
      if (length(mesh.points[i]) > 0.9994) {
        rim.push_back({mesh.points[i], 1e-9});
      }
    }
    const SolidModes modes = modes_of(mesh, 8, rim);
    const double unit = std::sqrt(12.0 * 7850.0 * (1.0 - 0.09) / 2e11) / h * 2.0 * pi;
    const double wanted[] = {10.216, 21.26, 21.26, 34.88, 34.88, 39.771, 51.04, 51.04};
    for (std::size_t i = 0; i < 8; ++i) {
      CHECK(modes.frequency_hz[i] * unit == Approx(wanted[i]).epsilon(0.01));
    }
    CHECK(modes.mass == Approx(7850.0 * pi * h).epsilon(1e-3));
  }
}

TEST_CASE("free shells of revolution have the frequencies of the elastic continuum", "[shell]") {
  // From tests/bench/shells: Ritz's method for the three-dimensional solid, no theory of shells.
  // Radius 1 m, wall 2 cm: a hundredth of the size.
  const SolidModes cylinder =
      modes_of(meshed(revolved({{1.0, 0.0}, {1.0, 2.0}}, 96), 0.02, 30000), 8);
  check_pairs(cylinder, {12.979, 17.309, 36.697, 43.627});
  std::vector<std::array<double, 2>> arc;
  for (int i = 0; i <= 40; ++i) {
    arc.push_back({i == 0 ? 0.0 : std::sin(pi * i / 80), -std::cos(pi * i / 80)});
  }
  const Surface hemisphere = revolved(arc, 120);
  check_pairs(modes_of(meshed(hemisphere, 0.02, 40000), 4), {20.356, 55.206});
  check_pairs(modes_of(meshed(hemisphere, 0.002, 40000), 6), {2.1075, 5.8725, 11.2566});
}

}  // namespace
}  // namespace ressort::shell_test
