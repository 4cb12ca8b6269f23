#include "core/solids/shell.h"

#include <algorithm>
#include <map>
#include <queue>
#include <span>
#include <tuple>
#include <utility>

namespace ressort::solids {
namespace {

// A linear function of the six vectors of a triangle, 3 vector + axis.
using Row = Vector;

// The component of a corner's displacement (`vector` < 3) or rotation along a direction.
Row component(std::size_t vector, const Point3& direction) {
  Row row(18);
  std::copy(direction.begin(), direction.end(), &row[3 * vector]);
  return row;
}

// Two components in the plane of the triangle.
using Planar = std::array<Row, 2>;

// Adds row' * factor * other.
void add(ShellElement& element, const Row& row, double factor, const Row& other) {
  for (std::size_t i = 0; i < 18; ++i) {
    for (std::size_t k = 0; k < 18; ++k) {
      element.stiffness[i / 3][k / 3][i % 3 + 3 * (k % 3)] += factor * row[i] * other[k];
    }
  }
}

// Halves edges. Every triangle of a halved edge becomes two.
class Halver {
 public:
  explicit Halver(Surface& surface) : surface_(surface) {
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
      for (std::size_t i = 0; i < 3; ++i) {
        use(surface.triangles[t][i], surface.triangles[t][(i + 1) % 3], static_cast<int>(t));
      }
    }
  }

  void halve_longest() {
    const int low = std::get<1>(longest_.top());
    const int high = std::get<2>(longest_.top());
    longest_.pop();
    const std::vector<int> around = std::move(triangles_.at({low, high}));
    triangles_.erase({low, high});
    const int middle = static_cast<int>(surface_.points.size());
    surface_.points.push_back(0.5 * (surface_.points[at(low)] + surface_.points[at(high)]));
    for (const int t : around) {
      Triangle& half = surface_.triangles[at(t)];
      Triangle other = half;
      std::replace(half.begin(), half.end(), high, middle);
      std::replace(other.begin(), other.end(), low, middle);
      const int apex = *std::ranges::find_if(
          half, [&](int corner) { return corner != low && corner != middle; });
      const int added = static_cast<int>(surface_.triangles.size());
      surface_.triangles.push_back(other);
      std::vector<int>& side = triangles_.at(std::minmax(high, apex));
      std::replace(side.begin(), side.end(), t, added);
      use(low, middle, t);
      use(middle, high, added);
      use(middle, apex, t);
      use(middle, apex, added);
    }
  }

 private:
  void use(int a, int b, int triangle) {
    const std::pair<int, int> edge = std::minmax(a, b);
    std::vector<int>& around = triangles_[edge];
    if (around.empty()) {
      const Point3 along = surface_.points[at(a)] - surface_.points[at(b)];
      longest_.emplace(inner(along, along), edge.first, edge.second);
    }
    around.push_back(triangle);
  }

  Surface& surface_;
  std::map<std::pair<int, int>, std::vector<int>> triangles_;  // [edge]
  std::priority_queue<std::tuple<double, int, int>> longest_;  // squared length, edge
};

}  // namespace

Result<SolidMesh> shell_mesh(Surface surface, double thickness, double unknowns,
                             const Progress& progress) {
  // A needle has no plane. The triangle beside its longest edge would have to end at its tip.
  constexpr double needle = 1e-5;  // Height relative to the longest edge.
  std::erase_if(surface.triangles, [&](const Triangle& t) {
    const Point3& a = surface.points[at(t[0])];
    const Point3 ab = surface.points[at(t[1])] - a;
    const Point3 ac = surface.points[at(t[2])] - a;
    const double longest = std::max({inner(ab, ab), inner(ac, ac), inner(ab - ac, ab - ac)});
    return length(cross(ab, ac)) < needle * longest;
  });
  if (surface.triangles.empty()) {
    return Error{"its triangles have no area"};
  }
  const auto wanted = static_cast<std::size_t>(unknowns / 6.0);
  for (Halver halver(surface); surface.points.size() < wanted;) {
    halver.halve_longest();
    progress.spend(100);
  }
  // The nodes of the rotations follow those of the displacements.
  SolidMesh mesh{std::move(surface.points), {}, std::move(surface.triangles), thickness};
  const std::size_t count = mesh.points.size();
  mesh.points.reserve(2 * count);
  std::copy_n(mesh.points.begin(), count, std::back_inserter(mesh.points));
  return mesh;
}

ShellElement shell_element(const std::array<Point3, 3>& corners, const SolidMaterial& material,
                           double thickness) {
  const Point3 first = corners[1] - corners[0];
  const Point3 normal_area = cross(first, corners[2] - corners[0]);
  const double area = 0.5 * length(normal_area);
  const Point3 n = 0.5 / area * normal_area;
  const std::array<Point3, 2> axis = {1.0 / length(first) * first,
                                      1.0 / length(first) * cross(n, first)};
  ShellElement element{.mass = material.density * thickness * area};

  // The displacement of the corners in the plane, and the slope of the deflection at the corners
  // and at the middles of the edges that follow them, which Kirchhoff's hypothesis ties to the
  // rotations (Batoz, Bathe and Ho 1980).
  std::array<Planar, 3> motion;
  std::array<Planar, 6> slope;
  std::array<Point3, 3> share_slope;  // Gradients of the barycentric coordinates.
  Row turn(18);                       // Rotation of the plane about its normal.
  for (std::size_t i = 0; i < 3; ++i) {
    motion[i] = {component(i, axis[0]), component(i, axis[1])};
    slope[i] = {component(i + 3, -1.0 * axis[1]), component(i + 3, axis[0])};
    share_slope[i] = 0.5 / area * cross(n, corners[(i + 2) % 3] - corners[(i + 1) % 3]);
    turn += 0.5 * component(i, cross(n, share_slope[i]));
  }
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    const Point3 edge = corners[j] - corners[i];
    const std::array<double, 2> along = {inner(edge, axis[0]), inner(edge, axis[1])};
    const Row rise = 1.5 * (component(j, n) - component(i, n));
    const Row ends =
        along[0] * (slope[i][0] + slope[j][0]) + along[1] * (slope[i][1] + slope[j][1]);
    const Row excess = 1.0 / inner(edge, edge) * (rise - 0.75 * ends);
    for (std::size_t c = 0; c < 2; ++c) {
      slope[3 + i][c] = 0.5 * (slope[i][c] + slope[j][c]) + along[c] * excess;
    }
  }

  const double plane_stress = material.young / (1.0 - material.poisson * material.poisson);
  const double mu = material.young / (2.0 * (1.0 + material.poisson));
  // Adds the energy of the symmetric gradient of a field, `weight` times that of a unit volume.
  const auto add_strain = [&](std::span<const Planar> field, std::span<const Point3> gradient,
                              double weight) {
    std::array<Row, 3> strain = {Row(18), Row(18), Row(18)};
    for (std::size_t k = 0; k < field.size(); ++k) {
      const double x = inner(gradient[k], axis[0]);
      const double y = inner(gradient[k], axis[1]);
      strain[0] += x * field[k][0];
      strain[1] += y * field[k][1];
      strain[2] += y * field[k][0] + x * field[k][1];
    }
    for (std::size_t r = 0; r < 2; ++r) {
      add(element, strain[r], plane_stress * weight, strain[r]);
      add(element, strain[r], material.poisson * plane_stress * weight, strain[1 - r]);
    }
    add(element, strain[2], mu * weight, strain[2]);
  };
  add_strain(motion, share_slope, thickness * area);
  // Three points, at the middles of the edges: exact for products of linear curvatures.
  for (std::size_t q = 0; q < 3; ++q) {
    std::array<Point3, 6> gradient;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t j = (i + 1) % 3;
      const double at_i = i == q ? 0.0 : 0.5;
      const double at_j = j == q ? 0.0 : 0.5;
      gradient[i] = (4.0 * at_i - 1.0) * share_slope[i];
      gradient[3 + i] = 4.0 * (at_i * share_slope[j] + at_j * share_slope[i]);
    }
    add_strain(slope, gradient, thickness * thickness * thickness / 36.0 * area);
  }
  // The membrane does not need the rotations about the normal. They follow the plane, softly: a
  // stiff tie, or a membrane that uses them (Allman 1984), locks the bending of thin curved shells.
  constexpr double tie = 1e-3;
  for (std::size_t i = 0; i < 3; ++i) {
    const Row drift = component(i + 3, n) - turn;
    add(element, drift, tie * mu * thickness * area, drift);
  }
  return element;
}

}  // namespace ressort::solids
