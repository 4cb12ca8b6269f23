// app/commands: fills a surface with tetrahedra. Runs gmsh or tetgen, or meshes boxes and balls
// itself.
#pragma once

#include <functional>
#include <string>

#include "app/rooms.h"
#include "core/result.h"
#include "core/solids/solid_mesh.h"

namespace ressort::commands {

enum class Mesher {
  automatic,  // the first of the others that is possible
  own,        // boxes and balls only
  gmsh,       // remeshes the surface
  tetgen,     // refines the surface of the file
};

struct MeshOrder {
  Mesher mesher = Mesher::automatic;
  double unknowns = 40000.0;  // approximate number; three per node
  double limit_s = 300.0;     // a mesher is stopped after this time
};

struct Meshed {
  TetrahedronMesh mesh;
  std::string by;  // "gmsh"
};

// Meshes the solid. Errors say what to install, or contain the last messages of the mesher.
// `should_continue` is called a few times a second; if it returns false, the mesher is ended and
// the error is `stopped`.
Result<Meshed> fill_with_tetrahedra(const ClosedSurface& closed, const MeshOrder& order,
                                    const std::function<bool()>& should_continue);

}  // namespace ressort::commands
