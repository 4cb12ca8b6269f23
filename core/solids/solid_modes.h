// core/solids: the natural modes of an elastic solid by finite elements. Pure.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/linear_algebra/eigen.h"
#include "core/linear_algebra/fronts.h"
#include "core/linear_algebra/matrix.h"
#include "core/progress.h"
#include "core/result.h"
#include "core/solids/solid_mesh.h"

namespace ressort::solids {

// Isotropic and linearly elastic, and how it loses energy.
struct SolidMaterial {
  std::string_view name;
  double young = 0.0;    // Pa
  double poisson = 0.0;  // -1..0.5, both left out
  double density = 0.0;  // kg/m^3
  double loss = 0.0;     // loss factor eta; a typical one of its kind
};

// What can be asked for by name.
std::span<const SolidMaterial> solid_materials();
std::optional<SolidMaterial> solid_material(std::string_view name);

// The decay of a mode: alpha = (a + b omega^2 + eta omega) / 2, T60 = ln 1000 / alpha.
struct SolidDamping {
  double a = 0.0;     // 1/s, Rayleigh's share of the mass
  double b = 0.0;     // s, of the stiffness
  double loss = 0.0;  // eta

  double t60_s(double frequency_hz) const;
};

// A ball whose nodes are held.
struct SolidClamp {
  Point3 centre{};
  double radius = 0.0;
};
bool is_clamped(const Point3& point, std::span<const SolidClamp> clamps);

// K and M of a mesh: consistent mass, quadrature that is exact for straight edges.
struct SolidMatrices {
  SparseMatrix mass;                 // kg; a row for each free node, alike in all three axes
  std::vector<NodeBlock> stiffness;  // N/m, [element of `mass`]
  std::vector<int> node;             // [row] of the mesh
};
SolidMatrices solid_matrices(const SolidMesh& mesh, const SolidMaterial& material,
                             std::span<const SolidClamp> clamps, const Progress& progress);

// The lowest eigenpairs of K x = omega^2 M x, omega^2 above `shift`, with the motions as a whole; x
// has an element for each axis of each row, x' M x = 1.
Result<Eigenpairs> lowest_solid_pairs(const SolidMesh& mesh, const SolidMatrices& matrices,
                                      double shift, int count, const Progress& progress);

struct SolidModes {
  std::vector<double> frequency_hz;  // ascending
  Matrix shapes;                     // [3 node + axis, mode], 1/sqrt(kg): x' M x = 1
  int rigid = 0;                     // motions as a whole, which are left out
  double mass = 0.0;                 // kg
  double residual = 0.0;             // the worst |K x - omega^2 M x| / |K x|
  double skewness = 0.0;             // the worst |x' M y - 1 or 0|
};

// What the solver is asked not to exceed: eight bytes each.
inline constexpr double most_factor_elements = 1e9;

// The lowest `count` modes that bend it; fewer where it has fewer. Errors: more elements than can
// be held, a solid that is held at all nodes, no convergence.
Result<SolidModes> find_solid_modes(const SolidMesh& mesh, const SolidMaterial& material,
                                    std::span<const SolidClamp> clamps, int count,
                                    const Progress& progress);

// Where a body is touched: a node of its surface, and which way.
struct SolidPlace {
  std::string name;
  int node = 0;
  Point3 direction{};  // of length 1
};

// The normal of the surface at each node of the mesh, of length 1; 0 inside.
std::vector<Point3> surface_normals(const SolidMesh& mesh);

// The node of the surface that is nearest to a point. O(nodes)
int nearest_on_surface(const SolidMesh& mesh, const Point3& point);

// `count` nodes of the surface far from each other, the first farthest from the middle; none that
// is clamped.
std::vector<int> spread_on_surface(const SolidMesh& mesh, std::span<const SolidClamp> clamps,
                                   int count);

// How far a place moves, its way, in a mode. 1/sqrt(kg)
double shape_at(const SolidModes& modes, const SolidPlace& place, std::size_t mode);

}  // namespace ressort::solids
