// core/solids: a solid divided into tetrahedra with ten nodes, and the ways to make one. Pure.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"
#include "core/solids/surface.h"

namespace ressort::solids {

// Four corners.
using Tetrahedron = std::array<int, 4>;
inline constexpr std::array<std::array<std::size_t, 2>, 6> tetrahedron_edges = {
    {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};

// Four corners, then the midpoints of the edges, in the order of CalculiX's C3D10.
using QuadraticTetrahedron = std::array<int, 10>;

struct TetrahedronMesh {
  std::vector<Point3> points;  // m
  std::vector<Tetrahedron> tetrahedra;
};

// The edges are straight, so curvature is only as fine as the surface's triangles. A shell has no
// elements: its surface is its middle, and the second half of its points are the rotations of the
// first.
struct SolidMesh {
  std::vector<Point3> points;  // m
  std::vector<QuadraticTetrahedron> elements;
  std::vector<Triangle> surface;  // Corners, counter-clockwise seen from outside.
  double thickness = 0.0;         // m, of a shell

  std::size_t unknowns() const { return 3 * points.size(); }
};

// Adds the mid-edge nodes, orients the tetrahedra and drops unused points. Returns an error for a
// flat tetrahedron, a missing node, or an empty mesh. O(n log n)
Result<SolidMesh> quadratic(const TetrahedronMesh& mesh);

// Meshes a box from (0, 0, 0) with `cells` along x, y and z, six tetrahedra per cell.
TetrahedronMesh box_mesh(const Point3& sides, const std::array<int, 3>& cells);

// Meshes a ball around (0, 0, 0): a cube of 2 `shells` cells a side, rounded shell by shell.
TetrahedronMesh ball_mesh(double radius, int shells);

// The box that a surface describes, in any orientation.
struct OrientedBox {
  Point3 corner{};
  std::array<Point3, 3> sides{};  // Right-handed.
};
std::optional<OrientedBox> as_box(const ClosedSurface& closed);

// The ball that a surface describes: all its points lie on one sphere, and its volume is at least
// nine tenths of the ball's.
struct DetectedBall {
  Point3 middle{};
  double radius = 0.0;
};
std::optional<DetectedBall> as_ball(const ClosedSurface& closed);

// Meshes this ball with about so many unknowns.
TetrahedronMesh detected_ball_mesh(const DetectedBall& ball, double unknowns);

// Meshes this box with about so many unknowns and cells as close to cubes as whole numbers allow.
TetrahedronMesh oriented_box_mesh(const OrientedBox& box, double unknowns);

// Meshes the cells of a grid whose middles are inside the surface, for surfaces that no mesher
// fills. The mesh has about so many unknowns and the surface of a staircase. Returns the largest
// part that hangs together by faces.
TetrahedronMesh grid_mesh(const ClosedSurface& closed, double unknowns, const Progress& progress);

// Drops tetrahedra without volume.
void drop_flat(TetrahedronMesh& mesh);

// Returns the node spacing, in m, that gives a solid of this volume about so many unknowns.
double edge_length(double volume, double unknowns);

// Formats of meshing programs. Errors give the line if there is one.
std::string as_stl(const ClosedSurface& closed);  // ASCII STL with one solid per shell.
// TetGen's format, with a point in every cavity.
std::string as_smesh(const ClosedSurface& closed);
// Reads the vertices and tetrahedra of Medit's ASCII format, which Gmsh and TetGen write. Drops the
// flat tetrahedra that they leave between points of one plane.
Result<TetrahedronMesh> read_medit(std::string_view text);

}  // namespace ressort::solids
