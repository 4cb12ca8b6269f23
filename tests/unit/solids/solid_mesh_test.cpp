#include "core/solids/solid_mesh.h"

#include <cmath>
#include <numbers>

#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/solids.h"

namespace ressort::solid_mesh_test {
namespace {

using namespace support;

double volume_of(const SolidMesh& solid) {
  double six = 0.0;
  for (const QuadraticTetrahedron& e : solid.elements) {
    const auto point = [&](std::size_t i) { return solid.points[static_cast<std::size_t>(e[i])]; };
    six += inner(point(1) - point(0), cross(point(2) - point(0), point(3) - point(0)));
  }
  return six / 6.0;
}

TEST_CASE("meshes of boxes and balls are complete and closed", "[solid_mesh]") {
  const auto box = quadratic(box_mesh({3.0, 2.0, 1.0}, {3, 2, 2}));
  REQUIRE(box);
  CHECK(box->points.size() == 7 * 5 * 5);  // Twice as many along each side, less one.
  CHECK(box->elements.size() == 72);
  CHECK(volume_of(*box) == Approx(6.0).epsilon(1e-12));
  const auto closed = close_surface({.points = box->points, .triangles = box->surface}, Progress());
  REQUIRE(closed);
  CHECK(closed->repairs.turned == 0);
  CHECK(closed->volume == Approx(6.0).epsilon(1e-12));
  CHECK(closed->surface.triangles.size() == 2 * 2 * (3 * 2 + 2 * 2 + 3 * 2));

  const auto ball = quadratic(ball_mesh(2.0, 4));
  REQUIRE(ball);
  const double round = 4.0 / 3.0 * std::numbers::pi * 8.0;
  CHECK(volume_of(*ball) < round);
  CHECK(volume_of(*ball) == Approx(round).epsilon(0.04));  // Its edges are straight.
  for (const Triangle& triangle : ball->surface) {
    for (const int corner : triangle) {
      CHECK(length(ball->points[static_cast<std::size_t>(corner)]) == Approx(2.0).epsilon(1e-12));
    }
  }
}

TEST_CASE("a box is recognised in any orientation, and nothing else is", "[solid_mesh]") {
  Random random(5);
  for (int round = 0; round < 20; ++round) {
    Surface box = box_surface({random.uniform(0.1, 2.0), random.uniform(0.1, 2.0), 1.0});
    // Rotated by two angles and moved.
    const double a = random.uniform(0.0, 6.0);
    const double b = random.uniform(0.0, 6.0);
    for (Point3& p : box.points) {
      p = {std::cos(a) * p[0] - std::sin(a) * p[1], std::sin(a) * p[0] + std::cos(a) * p[1], p[2]};
      p = {p[0], std::cos(b) * p[1] - std::sin(b) * p[2], std::sin(b) * p[1] + std::cos(b) * p[2]};
      p = p + Point3{3.0, -2.0, 1.0};
    }
    auto closed = close_surface(box, Progress());
    REQUIRE(closed);
    const auto found = as_box(*closed);
    REQUIRE(found);
    const auto mesh = quadratic(oriented_box_mesh(*found, 3000.0));
    REQUIRE(mesh);
    CHECK(volume_of(*mesh) == Approx(closed->volume).epsilon(1e-9));
    CHECK(mesh->unknowns() < 3300);
    CHECK(mesh->unknowns() > 1500);
    for (const Point3& corner : box.points) {
      double distance = 1.0;
      for (const Point3& point : mesh->points) {
        distance = std::min(distance, length(point - corner));
      }
      CHECK(distance < 1e-9);
    }
    // A box with one corner moved is not a box.
    box.points[random.below(8)][random.below(3)] += 0.05;
    closed = close_surface(box, Progress());
    REQUIRE(closed);
    CHECK_FALSE(as_box(*closed));
  }
  for (const Surface& other : {icosphere(1, 1.0, false), icosphere(0, 1.0, false),
                               revolved({{{0.0, 0.0}, {1.0, 0.0}, {1.0, 1.0}, {0.0, 1.0}}}, 8)}) {
    const auto closed = close_surface(other, Progress());
    REQUIRE(closed);
    CHECK_FALSE(as_box(*closed));
  }
  // A box with a notch in one side has the eight corners and more.
  Surface notched = box_surface({1.0, 1.0, 1.0});
  notched.points.push_back({0.5, 0.5, 0.5});
  const Triangle top = notched.triangles[2];
  notched.triangles.erase(notched.triangles.begin() + 2);
  notched.triangles.insert(notched.triangles.end(),
                           {{top[0], top[1], 8}, {top[1], top[2], 8}, {top[2], top[0], 8}});
  const auto closed = close_surface(notched, Progress());
  REQUIRE(closed);
  CHECK_FALSE(as_box(*closed));
}

TEST_CASE("a ball is recognised anywhere, and nothing else is", "[solid_mesh]") {
  Surface ball = icosphere(2, 0.7, false);
  for (Point3& point : ball.points) {
    point = point + Point3{10.0, -3.0, 2.0};
  }
  auto closed = close_surface(ball, Progress());
  REQUIRE(closed);
  const auto found = as_ball(*closed);
  REQUIRE(found);
  CHECK(found->radius == Approx(0.7).epsilon(1e-9));
  CHECK(length(found->middle - Point3{10.0, -3.0, 2.0}) < 1e-9);
  const auto mesh = quadratic(detected_ball_mesh(*found, 10000.0));
  REQUIRE(mesh);
  CHECK(mesh->unknowns() < 10000);
  // One point moved; a truncated ball; an elongated one; and a box, whose corners also lie on a
  // sphere.
  ball.points[7] = ball.points[7] + Point3{0.01, 0.0, 0.0};
  closed = close_surface(ball, Progress());
  REQUIRE(closed);
  CHECK_FALSE(as_ball(*closed));
  for (const Surface& other :
       {box_surface({1.0, 1.0, 1.0}),
        revolved({{{0.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {0.0, 1.0}}}, 40),
        revolved({{{0.0, -0.5}, {std::sqrt(0.75), -0.5}, {std::sqrt(0.75), 0.5}, {0.0, 0.5}}},
                 40)}) {
    closed = close_surface(other, Progress());
    REQUIRE(closed);
    CHECK_FALSE(as_ball(*closed));
  }
}

TEST_CASE("a grid fills a solid and its volume", "[solid_mesh]") {
  // A slab with a hole through it, and a part that no face joins to it.
  Surface ring = revolved({{0.5, 0.0}, {1.0, 0.0}, {1.0, 0.2}, {0.5, 0.2}, {0.5, 0.0}}, 48);
  const auto closed = close_surface(ring, Progress());
  REQUIRE(closed);
  const TetrahedronMesh mesh = grid_mesh(*closed, 30000, Progress());
  const auto solid = quadratic(mesh);
  REQUIRE(solid);
  CHECK(static_cast<double>(solid->unknowns()) == Approx(30000).epsilon(0.4));
  CHECK(volume_of(*solid) == Approx(closed->volume).epsilon(0.02));
  for (const Tetrahedron& t : mesh.tetrahedra) {
    Point3 middle{};
    for (const int corner : t) {
      middle = middle + 0.25 * mesh.points[static_cast<std::size_t>(corner)];
    }
    const double r = std::hypot(middle[0], middle[1]);
    REQUIRE((r > 0.42 && r < 1.08));
  }
}

TEST_CASE("flat, missing and absent tetrahedra are reported", "[solid_mesh]") {
  CHECK_FALSE(quadratic({}));
  CHECK_FALSE(quadratic({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}, {{0, 1, 2, 3}}}));
  CHECK_FALSE(quadratic({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2, 3}}}));
  // An inverted tetrahedron is flipped; an unused point is left out.
  const auto turned =
      quadratic({{{5, 5, 5}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{1, 3, 2, 4}}});
  REQUIRE(turned);
  CHECK(turned->points.size() == 10);
  CHECK(volume_of(*turned) == Approx(1.0 / 6.0).epsilon(1e-12));
}

TEST_CASE("files of meshing programs are read, and faulty ones reported", "[solid_mesh]") {
  const std::string gmsh =
      " MeshVersionFormatted 2\n Dimension\n 3\n Vertices\n 4\n 0 0 0 1\n 1 0 0 2\n 0 1 0 3\n"
      " 0 0 1 4\n Triangles\n 1\n 1 2 3 1\n Tetrahedra\n 1\n 1 2 3 4 1\n End\n";
  const auto mesh = read_medit(gmsh);
  REQUIRE(mesh);
  CHECK(mesh->points.size() == 4);
  REQUIRE(mesh->tetrahedra.size() == 1);
  CHECK(mesh->tetrahedra[0] == Tetrahedron{0, 1, 2, 3});
  const std::string tetgen =
      "MeshVersionFormatted 1\n\nDimension\n3\n\n# Set of mesh vertices\nVertices\n4\n"
      "0  0  0    0\n1  0  0    0\n0  1  0    0\n0  0  1    0\n\n# Set of Tetrahedra\n"
      "Tetrahedra\n1\n  1     2     3     4  0\n\nEnd\n";
  const auto same = read_medit(tetgen);
  REQUIRE(same);
  CHECK(same->tetrahedra == mesh->tetrahedra);
  // Truncated or corrupted files give a result or an error.
  Random random(9);
  for (int round = 0; round < 2000; ++round) {
    for (std::string broken : {gmsh, tetgen}) {
      const std::size_t place = random.below(broken.size());
      if (random.below(2) == 0) {
        broken.resize(place);
      } else {
        broken[place] = static_cast<char>(random.below(256));
      }
      const auto read = read_medit(broken);
      if (read) {
        static_cast<void>(quadratic(*read));
      } else {
        CHECK_FALSE(read.error().message.empty());
      }
    }
  }
}

}  // namespace
}  // namespace ressort::solid_mesh_test
