// Compares random solids with CalculiX, an independent finite element program.
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>
#include <string>

#include "core/solids/solid_modes.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/rooms.h"

namespace ressort::calculix_test {
namespace {

using namespace support;

constexpr int modes_compared = 20;
constexpr int rigid = 6;

bool has_calculix() {
  return std::system("command -v ccx >/dev/null 2>&1") == 0;
}

// Bars, blocks, plates, rings and balls, bent, tapered, twisted and bulged.
TetrahedronMesh random_solid(Random& random, bool is_fine) {
  Point3 sides{random.uniform(0.1, 0.4), random.uniform(0.03, 0.2), random.uniform(0.01, 0.1)};
  TetrahedronMesh mesh;
  const std::size_t kind = random.below(4);
  if (kind == 0) {
    mesh = ball_mesh(0.5, is_fine ? 4 : 2);
    sides[1] = random.uniform(0.5, 1.0) * sides[0];
    sides[2] = random.uniform(0.5, 1.0) * sides[0];
    for (Point3& p : mesh.points) {
      p = p + Point3{0.5, 0.5, 0.5};
    }
  } else {
    const double cell = std::cbrt(sides[0] * sides[1] * sides[2] / 400.0);
    std::array<int, 3> cells{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      cells[axis] = is_fine ? std::max(3, static_cast<int>(std::lround(sides[axis] / cell)))
                            : 1 + static_cast<int>(random.below(axis == 0 ? 8 : 3));
    }
    mesh = box_mesh({1.0, 1.0, 1.0}, cells);
    if (kind == 1 && cells[0] > 2 && cells[1] > 2) {  // A hole through the middle.
      std::vector<Tetrahedron> kept;
      for (const Tetrahedron& t : mesh.tetrahedra) {
        Point3 middle{};
        for (const int corner : t) {
          middle = middle + 0.25 * mesh.points[static_cast<std::size_t>(corner)];
        }
        const double rim = is_fine ? 2.0 : 1.0;
        const double x = std::floor(middle[0] * cells[0]);
        const double y = std::floor(middle[1] * cells[1]);
        if (x < rim || x >= cells[0] - rim || y < rim || y >= cells[1] - rim) {
          kept.push_back(t);
        }
      }
      mesh.tetrahedra = kept;
    }
  }
  const double taper = random.uniform(-0.5, 0.5);
  const double twist = random.uniform(-1.0, 1.0);
  const double bend = random.uniform(-1.0, 1.0);
  const double bulge = random.uniform(-0.3, 0.5);
  for (Point3& p : mesh.points) {
    const double x = p[0] - 0.5;
    const double width = (1.0 + taper * x) * (1.0 + bulge * (0.25 - x * x));
    const double y = (p[1] - 0.5) * sides[1] * width;
    const double z = (p[2] - 0.5) * sides[2] * width;
    const double turn = twist * x;
    p = {sides[0] * x, std::cos(turn) * y - std::sin(turn) * z,
         std::sin(turn) * y + std::cos(turn) * z + bend * sides[0] * x * x};
  }
  return mesh;
}

std::vector<double> calculix(const SolidMesh& mesh, const SolidMaterial& material) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("ressort-ccx-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  {
    std::ofstream deck(folder / "solid.inp");
    deck.precision(12);  // CalculiX reads twenty characters per number.
    deck << "*NODE,NSET=ALL\n";
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
      const Point3& p = mesh.points[i];
      deck << i + 1 << "," << p[0] << "," << p[1] << "," << p[2] << "\n";
    }
    deck << "*ELEMENT,TYPE=C3D10,ELSET=SOLID\n";
    for (std::size_t e = 0; e < mesh.elements.size(); ++e) {
      deck << e + 1;
      for (const int node : mesh.elements[e]) {
        deck << "," << node + 1;
      }
      deck << "\n";
    }
    deck << "*MATERIAL,NAME=M\n*ELASTIC\n"
         << material.young << "," << material.poisson << "\n*DENSITY\n"
         << material.density << "\n*SOLID SECTION,ELSET=SOLID,MATERIAL=M\n*STEP\n*FREQUENCY\n"
         << modes_compared + rigid << "\n*END STEP\n";
  }
  std::vector<double> frequencies;
  const std::string command =
      "cd '" + folder.string() + "' && OMP_NUM_THREADS=1 ccx -i solid >log 2>&1";
  if (std::system(command.c_str()) == 0) {
    // Rows of the first table: number, omega^2, omega, Hz, imaginary part.
    std::ifstream table(folder / "solid.dat");
    std::string line;
    while (std::getline(table, line) && line.find("P A R T") == std::string::npos) {
      std::istringstream row(line);
      int number = 0;
      double square = 0.0;
      double omega = 0.0;
      double hz = 0.0;
      if (row >> number >> square >> omega >> hz) {
        frequencies.push_back(hz);
      }
    }
  }
  std::filesystem::remove_all(folder);
  return frequencies;
}

// CalculiX integrates the mass of a C3D10 at four points, which is exact for degree two but not for
// these polynomials of degree four.
void take_mass_of_four_points(const SolidMesh& mesh, double density, SolidMatrices& matrices) {
  constexpr std::size_t edges[6][2] = {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}};
  matrices.mass.value.assign(matrices.mass.value.size(), 0.0);
  for (const QuadraticTetrahedron& element : mesh.elements) {
    const auto point = [&](std::size_t i) {
      return mesh.points[static_cast<std::size_t>(element[i])];
    };
    const double volume =
        inner(point(1) - point(0), cross(point(2) - point(0), point(3) - point(0))) / 6.0;
    for (std::size_t q = 0; q < 4; ++q) {
      double share[4];
      for (std::size_t i = 0; i < 4; ++i) {
        share[i] = i == q ? (5.0 + 3.0 * std::sqrt(5.0)) / 20.0 : (5.0 - std::sqrt(5.0)) / 20.0;
      }
      double n[10];
      for (std::size_t i = 0; i < 10; ++i) {
        n[i] = i < 4 ? share[i] * (2.0 * share[i] - 1.0)
                     : 4.0 * share[edges[i - 4][0]] * share[edges[i - 4][1]];
      }
      for (std::size_t a = 0; a < 10; ++a) {
        for (std::size_t b = 0; b < 10; ++b) {
          if (element[a] >= element[b]) {  // All nodes are free, so rows are nodes.
            matrices.mass.value[matrices.mass.find(element[a], element[b])] +=
                0.25 * density * volume * n[a] * n[b];
          }
        }
      }
    }
  }
}

struct Case {
  SolidMesh mesh;
  SolidMaterial material;
};
Case random_case(int seed, bool is_fine) {
  Random random(static_cast<std::uint64_t>(seed));
  auto mesh = quadratic(random_solid(random, is_fine));
  REQUIRE(mesh);
  return {*std::move(mesh),
          {"", random.uniform(1e9, 3e11), random.uniform(0.05, 0.42), random.uniform(500.0, 1e4)}};
}

// Returns the largest error with CalculiX's own mass matrix: equal to the printed digits.
double worst_with_its_mass(int seed) {
  const auto [mesh, material] = random_case(seed, false);
  SolidMatrices matrices = solid_matrices(mesh, material, {}, Progress());
  take_mass_of_four_points(mesh, material.density, matrices);
  const double size = box_around(mesh.points).diagonal();
  const auto pairs =
      lowest_solid_pairs(mesh, matrices, -1e-3 * material.young / material.density / (size * size),
                         modes_compared + rigid, Progress());
  REQUIRE(pairs);
  const std::vector<double> theirs = calculix(mesh, material);
  INFO("seed " << seed);
  REQUIRE(theirs.size() >= static_cast<std::size_t>(modes_compared + rigid));
  double worst = 0.0;
  for (std::size_t i = rigid; i < modes_compared + rigid; ++i) {
    const double hz = std::sqrt(pairs->values[i]) / (2.0 * std::numbers::pi);
    worst = std::max(worst, std::abs(hz / theirs[i] - 1.0));
    CHECK(hz == Approx(theirs[i]).epsilon(2e-5));
  }
  return worst;
}

// Returns the largest error with the exact mass, on a mesh so fine that the integration rule does
// not matter.
double worst_as_they_come(int seed) {
  const auto [mesh, material] = random_case(seed, true);
  const auto modes = find_solid_modes(mesh, material, {}, modes_compared, Progress());
  INFO("seed " << seed);
  REQUIRE(modes);
  CHECK(modes->rigid == rigid);
  const std::vector<double> theirs = calculix(mesh, material);
  REQUIRE(theirs.size() >= static_cast<std::size_t>(modes_compared + rigid));
  double worst = 0.0;
  for (std::size_t i = 0; i < modes_compared; ++i) {
    worst = std::max(worst, std::abs(modes->frequency_hz[i] / theirs[i + rigid] - 1.0));
    CHECK(modes->frequency_hz[i] == Approx(theirs[i + rigid]).epsilon(5e-3));
  }
  return worst;
}

void compare(int first, int count, double (*worst_of)(int seed)) {
  if (!has_calculix()) {
    WARN("skipped: CalculiX is not installed (apt install calculix-ccx)");
    return;
  }
  double worst = 0.0;
  for (int seed = first; seed < first + count; ++seed) {
    worst = std::max(worst, worst_of(seed));
  }
  UNSCOPED_INFO("CalculiX differs by at most " << show(worst));
  CHECK(worst < 1.0);
}

TEST_CASE("a solid's modes agree with CalculiX", "[calculix]") {
  compare(1, 2, worst_with_its_mass);
}

TEST_CASE("twenty solids' modes agree with CalculiX for the same mass matrix",
          "[calculix_everywhere]") {
  compare(3, 20, worst_with_its_mass);
}

TEST_CASE("twenty solids' modes agree with CalculiX", "[calculix_everywhere]") {
  compare(23, 20, worst_as_they_come);
}

}  // namespace
}  // namespace ressort::calculix_test
