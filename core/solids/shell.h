// core/solids: shells: a surface with a wall, in flat triangles with three displacements and three
// rotations per corner: Kirchhoff's bending, and constant strain in the plane. Pure.
#pragma once

#include <array>

#include "core/linear_algebra/fronts.h"
#include "core/solids/solid_mesh.h"
#include "core/solids/solid_modes.h"

namespace ressort::solids {

// Meshes a shell with about so many unknowns: halves the longest edges of the surface, if it has
// fewer. O(n log n)
Result<SolidMesh> shell_mesh(Surface surface, double thickness, double unknowns,
                             const Progress& progress);

// Matrices of one triangle. Its six vectors are the displacements of its corners, then their
// rotations.
struct ShellElement {
  std::array<std::array<NodeBlock, 6>, 6> stiffness{};  // N/m, N and N m
  double mass = 0.0;                                    // kg
};
ShellElement shell_element(const std::array<Point3, 3>& corners, const SolidMaterial& material,
                           double thickness);

}  // namespace ressort::solids
