// core/solids: natural modes of an elastic solid by the finite element method. Pure.
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

// An isotropic, linearly elastic material with its loss.
struct SolidMaterial {
  std::string_view name;
  double young = 0.0;    // Pa
  double poisson = 0.0;  // Between -1 and 0.5, exclusive.
  double density = 0.0;  // kg/m^3
  double loss = 0.0;     // Loss factor eta, typical of the material.
};

// The materials that can be selected by name.
std::span<const SolidMaterial> solid_materials();
std::optional<SolidMaterial> solid_material(std::string_view name);

// Decay of a mode: alpha = (a + b omega^2 + eta omega) / 2, T60 = ln 1000 / alpha.
struct SolidDamping {
  double a = 0.0;     // 1/s, Rayleigh damping proportional to mass.
  double b = 0.0;     // s, Rayleigh damping proportional to stiffness.
  double loss = 0.0;  // Loss factor eta.

  double t60_s(double frequency_hz) const;
};

// A ball; all nodes inside it are clamped.
struct SolidClamp {
  Point3 centre{};
  double radius = 0.0;
};
bool is_clamped(const Point3& point, std::span<const SolidClamp> clamps);

// The matrices K and M of a mesh: consistent mass, quadrature exact for straight edges.
struct SolidMatrices {
  SparseMatrix mass;                 // kg; one row per free node, shared by all three axes.
  std::vector<NodeBlock> stiffness;  // N/m, [element of `mass`].
  std::vector<int> node;             // [row] Node of the mesh.
};
SolidMatrices solid_matrices(const SolidMesh& mesh, const SolidMaterial& material,
                             std::span<const SolidClamp> clamps, const Progress& progress);

// Returns the lowest eigenpairs of K x = omega^2 M x with omega^2 above `shift`, rigid motions
// included. x has an element per axis of each row, normalised to x' M x = 1.
Result<Eigenpairs> lowest_solid_pairs(const SolidMesh& mesh, const SolidMatrices& matrices,
                                      double shift, int count, const Progress& progress);

struct SolidModes {
  std::vector<double> frequency_hz;  // ascending
  Matrix shapes;          // [3 node + axis, mode] in 1/sqrt(kg), normalised to x' M x = 1.
  int rigid = 0;          // Number of rigid-body motions, which are left out.
  double mass = 0.0;      // kg
  double residual = 0.0;  // Worst |K x - omega^2 M x| / |K x|.
  double skewness = 0.0;  // Worst |x' M y - 1 or 0|.
};

// Memory limit of the solver, in elements of eight bytes.
inline constexpr double most_factor_elements = 1e9;

// Returns the lowest `count` elastic modes, or fewer if the mesh has fewer. Returns an error for
// too many elements, a solid whose nodes are all clamped, or no convergence.
Result<SolidModes> find_solid_modes(const SolidMesh& mesh, const SolidMaterial& material,
                                    std::span<const SolidClamp> clamps, int count,
                                    const Progress& progress);

// A place on the surface where the body is struck or heard: a node and a direction.
struct SolidPlace {
  std::string name;
  int node = 0;
  Point3 direction{};  // Unit length.
};

// Returns the surface normal at each node of the mesh, of length 1; 0 inside.
std::vector<Point3> surface_normals(const SolidMesh& mesh);

// Returns the surface node nearest to a point. O(nodes)
int nearest_on_surface(const SolidMesh& mesh, const Point3& point);

// Returns `count` surface nodes far from each other, starting with the one farthest from the
// centre. Clamped nodes are excluded.
std::vector<int> spread_on_surface(const SolidMesh& mesh, std::span<const SolidClamp> clamps,
                                   int count);

// Returns the displacement of a place in its direction in one mode, in 1/sqrt(kg).
double shape_at(const SolidModes& modes, const SolidPlace& place, std::size_t mode);

}  // namespace ressort::solids
