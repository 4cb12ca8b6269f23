#include "core/solids/solid_mesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/groups.h"

namespace ressort::solids {
namespace {

constexpr std::array<std::array<std::size_t, 3>, 4> faces = {
    // The faces of a tetrahedron of positive volume, seen from outside.
    {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}}};
constexpr double flat = 1e-7;  // Smallest volume, relative to the cube of the longest edge.

double six_volumes(const std::vector<Point3>& points, const Tetrahedron& t) {
  const Point3& a = points[at(t[0])];
  return inner(points[at(t[1])] - a, cross(points[at(t[2])] - a, points[at(t[3])] - a));
}

bool is_flat(const std::vector<Point3>& points, const Tetrahedron& t) {
  double longest = 0.0;
  for (const auto& edge : tetrahedron_edges) {
    longest = std::max(longest, length(points[at(t[edge[0]])] - points[at(t[edge[1]])]));
  }
  return !(std::abs(six_volumes(points, t)) > flat * longest * longest * longest);
}

}  // namespace

void drop_flat(TetrahedronMesh& mesh) {
  std::erase_if(mesh.tetrahedra, [&](const Tetrahedron& t) { return is_flat(mesh.points, t); });
}

Result<SolidMesh> quadratic(const TetrahedronMesh& mesh) {
  SolidMesh solid;
  std::vector<int> number(mesh.points.size(), -1);
  std::vector<Tetrahedron> corners;
  corners.reserve(mesh.tetrahedra.size());
  for (Tetrahedron t : mesh.tetrahedra) {
    for (const int corner : t) {
      if (corner < 0 || at(corner) >= mesh.points.size()) {
        return Error{"a tetrahedron refers to a missing point"};
      }
    }
    if (is_flat(mesh.points, t)) {
      return Error{"a tetrahedron at " + to_string(mesh.points[at(t[0])]) + " m is flat"};
    }
    if (six_volumes(mesh.points, t) < 0.0) {
      std::swap(t[2], t[3]);
    }
    for (int& corner : t) {
      if (number[at(corner)] < 0) {
        number[at(corner)] = static_cast<int>(solid.points.size());
        solid.points.push_back(mesh.points[at(corner)]);
      }
      corner = number[at(corner)];
    }
    corners.push_back(t);
  }
  if (corners.empty()) {
    return Error{"the mesh has no tetrahedron"};
  }
  struct Middle {
    int low;
    int high;
    std::size_t place;  // 6 element + edge
  };
  std::vector<Middle> middles;
  struct Face {
    Triangle sorted;
    Triangle outwards;
  };
  std::vector<Face> sides;
  for (std::size_t e = 0; e < corners.size(); ++e) {
    const Tetrahedron& t = corners[e];
    QuadraticTetrahedron element{};
    std::copy(t.begin(), t.end(), element.begin());
    solid.elements.push_back(element);
    for (std::size_t i = 0; i < tetrahedron_edges.size(); ++i) {
      const int a = t[tetrahedron_edges[i][0]];
      const int b = t[tetrahedron_edges[i][1]];
      middles.push_back({std::min(a, b), std::max(a, b), 6 * e + i});
    }
    for (const auto& face : faces) {
      const Triangle outwards{t[face[0]], t[face[1]], t[face[2]]};
      Triangle sorted = outwards;
      std::ranges::sort(sorted);
      sides.push_back({sorted, outwards});
    }
  }
  std::ranges::sort(middles, [](const Middle& a, const Middle& b) {
    return std::pair(a.low, a.high) < std::pair(b.low, b.high);
  });
  for (std::size_t i = 0; i < middles.size(); ++i) {
    const Middle& middle = middles[i];
    if (i == 0 || middle.low != middles[i - 1].low || middle.high != middles[i - 1].high) {
      solid.points.push_back(0.5 * (solid.points[at(middle.low)] + solid.points[at(middle.high)]));
    }
    solid.elements[middle.place / 6][4 + middle.place % 6] =
        static_cast<int>(solid.points.size()) - 1;
  }
  std::ranges::sort(sides, {}, &Face::sorted);
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const bool has_twin = (i > 0 && sides[i - 1].sorted == sides[i].sorted) ||
                          (i + 1 < sides.size() && sides[i + 1].sorted == sides[i].sorted);
    if (!has_twin) {
      solid.surface.push_back(sides[i].outwards);
    }
  }
  return solid;
}

TetrahedronMesh box_mesh(const Point3& sides, const std::array<int, 3>& cells) {
  TetrahedronMesh mesh;
  const int nx = cells[0] + 1;
  const int ny = cells[1] + 1;
  for (int z = 0; z <= cells[2]; ++z) {
    for (int y = 0; y <= cells[1]; ++y) {
      for (int x = 0; x <= cells[0]; ++x) {
        mesh.points.push_back(
            {sides[0] * x / cells[0], sides[1] * y / cells[1], sides[2] * z / cells[2]});
      }
    }
  }
  // The Kuhn subdivision: six paths from one corner of the cell to the opposite one along three
  // edges. Neighbouring cells match.
  constexpr std::array<std::array<int, 3>, 6> ways = {
      {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}}};
  const std::array<int, 3> step = {1, nx, nx * ny};
  for (int z = 0; z < cells[2]; ++z) {
    for (int y = 0; y < cells[1]; ++y) {
      for (int x = 0; x < cells[0]; ++x) {
        for (const auto& way : ways) {
          Tetrahedron t{};
          t[0] = x + nx * (y + ny * z);
          for (std::size_t i = 0; i < 3; ++i) {
            t[i + 1] = t[i] + step[at(way[i])];
          }
          mesh.tetrahedra.push_back(t);
        }
      }
    }
  }
  return mesh;
}

TetrahedronMesh ball_mesh(double radius, int shells) {
  TetrahedronMesh mesh = box_mesh({2.0, 2.0, 2.0}, {2 * shells, 2 * shells, 2 * shells});
  for (Point3& point : mesh.points) {
    point = point - Point3{1.0, 1.0, 1.0};
    const double reach = std::max({std::abs(point[0]), std::abs(point[1]), std::abs(point[2])});
    // Equal angles on the faces of the cube keep the cells of equal size.
    Point3 direction{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      direction[axis] = reach > 0.0 ? std::tan(point[axis] / reach * std::atan(1.0)) : 0.0;
    }
    point = reach > 0.0 ? radius * reach / length(direction) * direction : Point3{};
  }
  return mesh;
}

std::optional<OrientedBox> as_box(const ClosedSurface& closed) {
  constexpr double tolerance = 1e-5;  // Relative to the size.
  const auto& points = closed.surface.points;
  if (closed.shells != 1 || points.size() < 8) {
    return std::nullopt;
  }
  // Takes the corner farthest from the centre and its three neighbours along the sides, which are
  // the nearest of the other corners. Every point must then lie on a face.
  Point3 middle{};
  for (const Point3& point : points) {
    middle = middle + 1.0 / static_cast<double>(points.size()) * point;
  }
  const auto farther = [&](const Point3& a, const Point3& b) {
    return length(a - middle) < length(b - middle);
  };
  const Point3 corner = *std::ranges::max_element(points, farther);
  const double size = box_around(points).diagonal();
  const double reach = length(corner - middle);
  std::vector<Point3> corners;
  for (const Point3& point : points) {
    if (std::abs(length(point - middle) - reach) < tolerance * size) {
      corners.push_back(point - corner);
    }
  }
  if (corners.size() != 8) {
    return std::nullopt;
  }
  std::ranges::sort(corners, {}, length);
  // From one corner: sides and face diagonals first, the space diagonal last. Three mutually
  // perpendicular ones are the sides.
  for (std::size_t i = 1; i < 7; ++i) {
    for (std::size_t j = i + 1; j < 7; ++j) {
      for (std::size_t k = j + 1; k < 7; ++k) {
        const Point3& a = corners[i];
        const Point3& b = corners[j];
        const Point3& c = corners[k];
        const double most = tolerance * size;
        if (std::abs(inner(a, b)) > most * length(b) || std::abs(inner(b, c)) > most * length(c) ||
            std::abs(inner(c, a)) > most * length(c)) {
          continue;
        }
        const double volume = inner(a, cross(b, c));
        if (std::abs(std::abs(volume) - closed.volume) > 1e-4 * closed.volume) {
          continue;
        }
        // A closed surface with the volume of the box between its corners is that box if no point
        // lies off its faces.
        for (const Point3& point : points) {
          double off = size;
          for (const Point3* side : {&a, &b, &c}) {
            const double along = inner(point - corner, *side) / length(*side);
            if (along < -most || along > length(*side) + most) {
              return std::nullopt;
            }
            off = std::min({off, std::abs(along), std::abs(along - length(*side))});
          }
          if (off > most) {
            return std::nullopt;
          }
        }
        return volume > 0.0 ? OrientedBox{corner, {a, b, c}} : OrientedBox{corner, {a, c, b}};
      }
    }
  }
  return std::nullopt;
}

std::optional<DetectedBall> as_ball(const ClosedSurface& closed) {
  constexpr double tolerance = 1e-5;  // Relative to the radius.
  constexpr double round = 0.9;       // Least share of the ball's volume.
  if (closed.shells != 1 || closed.surface.points.size() < 42) {
    return std::nullopt;
  }
  // The bounding box gives the centre only if the ball has points on the axes, so the sphere
  // through four points is used.
  const auto& points = closed.surface.points;
  const Point3& first = points.front();
  const auto farthest = [&](auto&& measure) {
    return *std::ranges::max_element(points, {}, measure);
  };
  const Point3 a = farthest([&](const Point3& p) { return length(p - first); }) - first;
  const Point3 b = farthest([&](const Point3& p) { return length(cross(p - first, a)); }) - first;
  const Point3 c =
      farthest([&](const Point3& p) { return std::abs(inner(p - first, cross(a, b))); }) - first;
  const double volume = inner(a, cross(b, c));
  if (!(std::abs(volume) > 1e-3 * length(a) * length(a) * length(a))) {
    return std::nullopt;
  }
  const Point3 offset =
      0.5 / volume *
      (inner(a, a) * cross(b, c) + inner(b, b) * cross(c, a) + inner(c, c) * cross(a, b));
  const DetectedBall ball{first + offset, length(offset)};
  const bool fits = std::ranges::all_of(points, [&](const Point3& p) {
    return std::abs(length(p - ball.middle) - ball.radius) < tolerance * ball.radius;
  });
  const double whole = 4.0 / 3.0 * std::numbers::pi * ball.radius * ball.radius * ball.radius;
  return fits && closed.volume > round * whole ? std::optional(ball) : std::nullopt;
}

TetrahedronMesh detected_ball_mesh(const DetectedBall& ball, double unknowns) {
  // The mesh has (4 shells + 1)^3 nodes.
  const int shells = std::max(2, static_cast<int>((std::cbrt(unknowns / 3.0) - 1.0) / 4.0));
  TetrahedronMesh mesh = ball_mesh(ball.radius, shells);
  for (Point3& point : mesh.points) {
    point = ball.middle + point;
  }
  return mesh;
}

namespace {

// Returns cells for a box of about so many unknowns, as close to cubes as whole numbers allow.
std::array<int, 3> box_cells(const Point3& sides, double unknowns) {
  // Nodes are half a cell apart: there are (2 nx + 1)(2 ny + 1)(2 nz + 1).
  const auto cells_of = [&](double cell) {
    std::array<int, 3> cells{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      cells[axis] = static_cast<int>(std::clamp(std::round(sides[axis] / cell), 1.0, 1000.0));
    }
    return cells;
  };
  const auto count = [](const std::array<int, 3>& cells) {
    return 3.0 * (2.0 * cells[0] + 1.0) * (2.0 * cells[1] + 1.0) * (2.0 * cells[2] + 1.0);
  };
  double cell = *std::ranges::max_element(sides);
  while (count(cells_of(cell / 1.02)) <= unknowns) {
    cell /= 1.02;
  }
  return cells_of(cell);
}

}  // namespace

TetrahedronMesh oriented_box_mesh(const OrientedBox& box, double unknowns) {
  const Point3 sides{length(box.sides[0]), length(box.sides[1]), length(box.sides[2])};
  TetrahedronMesh mesh = box_mesh({1.0, 1.0, 1.0}, box_cells(sides, unknowns));
  for (Point3& point : mesh.points) {
    point =
        box.corner + point[0] * box.sides[0] + point[1] * box.sides[1] + point[2] * box.sides[2];
  }
  return mesh;
}

TetrahedronMesh grid_mesh(const ClosedSurface& closed, double unknowns, const Progress& progress) {
  const Box3 box = box_around(closed.surface.points);
  const Point3 sides = box.high - box.low;
  const double filled = closed.volume / (sides[0] * sides[1] * sides[2]);
  const std::array<int, 3> cells = box_cells(sides, unknowns / std::clamp(filled, 0.02, 1.0));
  const std::size_t nx = at(cells[0]);
  const std::size_t nxy = nx * at(cells[1]);
  const std::size_t count = nxy * at(cells[2]);
  std::vector<char> is_inside(count, 0);
  Groups groups(count);
  const auto join = [&](std::size_t cell, std::size_t before) {
    if (is_inside[before] != 0) {
      groups.join(static_cast<std::uint32_t>(cell), static_cast<std::uint32_t>(before));
    }
  };
  for (std::size_t cell = 0; cell < count; ++cell) {
    progress.spend(8 * closed.surface.triangles.size());
    const std::array<std::size_t, 3> place = {cell % nx, cell % nxy / nx, cell / nxy};
    Point3 middle = box.low;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      middle[axis] += (static_cast<double>(place[axis]) + 0.5) * sides[axis] / cells[axis];
    }
    is_inside[cell] = windings(closed.surface, middle) > 0.5 ? 1 : 0;
    if (is_inside[cell] != 0) {
      const std::array<std::size_t, 3> step = {1, nx, nxy};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (place[axis] > 0) {
          join(cell, cell - step[axis]);
        }
      }
    }
  }
  const auto group_of = [&](std::size_t cell) {
    return groups.find(static_cast<std::uint32_t>(cell));
  };
  std::vector<std::size_t> size(count, 0);
  for (std::size_t cell = 0; cell < count; ++cell) {
    size[group_of(cell)] += is_inside[cell] != 0 ? 1 : 0;
  }
  const auto best = static_cast<std::size_t>(std::ranges::max_element(size) - size.begin());
  TetrahedronMesh mesh = box_mesh(sides, cells);
  std::size_t tetrahedron = 0;
  std::erase_if(mesh.tetrahedra, [&](const Tetrahedron&) {
    const std::size_t cell = tetrahedron++ / 6;
    return is_inside[cell] == 0 || group_of(cell) != best;
  });
  for (Point3& point : mesh.points) {
    point = box.low + point;
  }
  return mesh;
}

double edge_length(double volume, double unknowns) {
  // A tetrahedron with equal edges h has the volume h^3 / 8.5. With mid-edge nodes there are 1.4
  // nodes per tetrahedron inside a large solid, and twice as many if the solid is mostly surface.
  constexpr double nodes_per_tetrahedron = 1.7;
  return std::cbrt(8.5 * volume * 3.0 * nodes_per_tetrahedron / unknowns);
}

}  // namespace ressort::solids
