// core/solids: a solid cut into tetrahedra of ten nodes, and where they come from. Pure.
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

// Four corners, then the middles of the edges in their order, as CalculiX's C3D10 has them.
using QuadraticTetrahedron = std::array<int, 10>;

struct TetrahedronMesh {
  std::vector<Point3> points;  // m
  std::vector<Tetrahedron> tetrahedra;
};

// Straight edges: a round solid is as round as its surface was.
struct SolidMesh {
  std::vector<Point3> points;  // m
  std::vector<QuadraticTetrahedron> elements;
  std::vector<Triangle> surface;  // corners, counter-clockwise from outside

  std::size_t unknowns() const { return 3 * points.size(); }
};

// With middles. Tetrahedra are turned the right way; the error is for one that is flat, has a node
// that is not there, or where nothing is left. Points that belong to none are left out. O(n log n)
Result<SolidMesh> quadratic(const TetrahedronMesh& mesh);

// A box from (0, 0, 0), six tetrahedra to each of so many cells along x, y, z.
TetrahedronMesh box_mesh(const Point3& sides, const std::array<int, 3>& cells);

// A ball around (0, 0, 0): a box of 2 cells * `shells` a side, drawn round shell by shell.
TetrahedronMesh ball_mesh(double radius, int shells);

// The box that the surface is, if it is one, however it lies.
struct LyingBox {
  Point3 corner{};
  std::array<Point3, 3> sides{};  // right-handed
};
std::optional<LyingBox> as_box(const ClosedSurface& closed);

// The ball that the surface is drawn onto, if all of its points lie on one and it is round: its
// volume is at least nine tenths of the ball's.
struct LyingBall {
  Point3 middle{};
  double radius = 0.0;
};
std::optional<LyingBall> as_ball(const ClosedSurface& closed);

// A mesh of this ball with about so many unknowns.
TetrahedronMesh lying_ball_mesh(const LyingBall& ball, double unknowns);

// A mesh of this box with about so many unknowns, its cells as near to cubes as whole numbers
// allow.
TetrahedronMesh lying_box_mesh(const LyingBox& box, double unknowns);

// How far apart nodes are to be so that a solid of this volume has about so many unknowns. m
double edge_length(double volume, double unknowns);

// What meshing programs read and write. Errors with the line where there is one.
std::string as_stl(const ClosedSurface& closed);           // ASCII, a solid for each shell
std::string as_smesh(const ClosedSurface& closed);         // TetGen's, with a point in every hollow
Result<TetrahedronMesh> read_gmsh(std::string_view text);  // .msh, format 2, ASCII
Result<TetrahedronMesh> read_tetgen(std::string_view nodes, std::string_view elements);

}  // namespace ressort::solids
